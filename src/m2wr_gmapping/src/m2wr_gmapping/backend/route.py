# SPDX-License-Identifier: BSD-3-Clause
"""The path of the best particle and what was seen on it."""
from __future__ import annotations

from dataclasses import dataclass
from typing import Sequence

import numpy as np

from m2wr_gmapping.frontend.scan import ScanReading
from m2wr_node.array_types import FloatArray


@dataclass(frozen=True)
class Route:
    """Path of the best particle, with the scans of its nodes.

    Attributes
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    along : (K,) float64
        Length of the path up to each node [m].
    readings : sequence of K ScanReading
        Scans of the path's nodes.
    """

    path: FloatArray
    along: FloatArray
    readings: Sequence[ScanReading]


def distances_along(path: FloatArray) -> FloatArray:
    """Return the length (K,) of a path (K, 3) up to each node [m]."""
    return np.concatenate([[0.0], np.cumsum(np.sqrt(np.square(np.diff(path[:, :2], axis=0)).sum(axis=1)))])

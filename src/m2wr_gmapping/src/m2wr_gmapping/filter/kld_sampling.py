# SPDX-License-Identifier: BSD-3-Clause
"""Adaptive number of particles (KLD-sampling): few if they agree, many if they spread."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping.se2 import wrap

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray

BIN = np.array([0.1, 0.1, 0.05])    # size of a bin of poses [m, m, rad]
ERROR = 0.15                # bound of the Kullback-Leibler distance between sample and distribution
QUANTILE = 2.326            # quantile of the normal distribution for 99 %
CHANGED = 0.2               # relative change of the number that triggers a resampling


def needed(poses: FloatArray, best: int) -> int:
    """Return the number of particles by KLD-sampling.

    Parameters
    ----------
    poses : (N, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    best : int
        Particle at the centre of its bin.

    Notes
    -----
    D. Fox, Adapting the sample size in particle filters through KLD-sampling, IJRR 22(12), 2003.
    """
    away = poses - poses[best]
    away[:, 2] = wrap(away[:, 2])
    free = len(np.unique(np.rint(away / BIN).astype(np.int64), axis=0)) - 1
    if not free:
        return 1
    part = 2.0 / (9.0 * free)
    return math.ceil(free / (2.0 * ERROR) * (1.0 - part + math.sqrt(part) * QUANTILE)**3)


def next_count(poses: FloatArray, best: int, least: int, most: int) -> int:
    """Return the number of particles for the next scans; small changes are not made.

    Parameters
    ----------
    poses : (N, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    best : int
        Particle at the centre of its bin.
    least : int
        Limits of the number.
    most : int
        Limits of the number.
    """
    count = len(poses)
    wanted = min(max(needed(poses, best), least), most)
    return wanted if abs(wanted - count) > CHANGED * count or not least <= count <= most else count

# SPDX-License-Identifier: BSD-3-Clause
"""Adaptive number of particles (KLD-sampling): few if they agree, many if they spread."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.se2 import wrap

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray


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
    free = len(np.unique(np.rint(away / tuning.PARTICLES.bin).astype(np.int64), axis=0)) - 1
    if not free:
        return 1
    part = 2.0 / (9.0 * free)
    return math.ceil(free / (2.0 * tuning.PARTICLES.kld[0])
                     * (1.0 - part + math.sqrt(part) * tuning.PARTICLES.kld[1])**3)


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
    much = abs(wanted - count) > tuning.PARTICLES.changed_count * count
    return wanted if much or not least <= count <= most else count

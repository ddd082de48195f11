# SPDX-License-Identifier: BSD-3-Clause
"""Weights of a particle set: effective number, entropy, low-variance resampling, and the number of particles."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Optional

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.se2 import wrap

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray


def effective_number(weights: FloatArray) -> float:
    """Return 1 / sum(w^2), the effective number of particles."""
    return 1.0 / float(np.square(weights).sum())


def entropy(weights: FloatArray) -> float:
    """Return -sum(w ln w), between 0 and ln(N)."""
    positive = weights[weights > 0.0]
    return float(max(0.0, -(positive * np.log(positive)).sum()))


def systematic_resample(weights: FloatArray, start: float, count: Optional[int] = None,
                        keep: Optional[int] = None) -> IndexArray:
    """Low-variance resampling from one uniform number.

    Parameters
    ----------
    weights : (N,) float64
        Weights; sum 1.
    start : float
        Uniform number in [0, 1).
    count : int or None
        Number of new particles; default N.
    keep : int or None
        Particle that survives in any case.

    Returns
    -------
    (count,) int64
        Ancestor of each new particle. Survivors keep their index if possible.
    """
    count = len(weights) if count is None else count
    targets = (start + np.arange(count)) / count
    drawn = np.minimum(np.searchsorted(np.cumsum(weights), targets, side="right"), len(weights) - 1)
    if keep is not None and keep not in drawn:
        drawn[min(int(np.searchsorted(drawn, keep)), count - 1)] = keep
    copies = np.bincount(drawn, minlength=len(weights))
    ancestors = np.full(count, -1, np.int64)
    stay = np.flatnonzero(copies[:count])
    ancestors[stay] = stay
    copies[stay] -= 1
    ancestors[ancestors < 0] = np.repeat(np.arange(len(weights)), copies)
    return ancestors


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

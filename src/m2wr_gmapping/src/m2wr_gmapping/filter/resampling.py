# SPDX-License-Identifier: BSD-3-Clause
"""Weights of a particle set: normalising, effective number, entropy, low-variance resampling."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray, IndexArray


def normalise(log_weights: ArrayLike, gain: float) -> FloatArray:
    """Return normalised weights of smoothed log-weights.

    Parameters
    ----------
    log_weights : (N,) float64
        Log-weights.
    gain : float
        Divisor of the log-weights (gmapping: ogain times the number of particles).
    """
    logs = np.asarray(log_weights, float)
    weights: FloatArray = np.exp((logs - logs.max()) / gain)
    return weights / weights.sum()


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
        Ancestor of each new particle. Survivors keep their index if possible, so that only copies move.
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

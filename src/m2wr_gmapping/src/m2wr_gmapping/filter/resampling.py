# SPDX-License-Identifier: BSD-3-Clause
"""Weights of a particle set: normalising, effective number, entropy, low-variance resampling."""
import numpy as np


def normalise(log_weights, gain):
    """Return weights that sum to 1 from log-weights smoothed by ``gain`` (upstream: ogain times the particles)."""
    log_weights = np.asarray(log_weights, float)
    weights = np.exp((log_weights - log_weights.max()) / gain)
    return weights / weights.sum()


def effective_number(weights):
    """Return 1 / sum(w^2): the number of particles that really carry the weight."""
    return 1.0 / float(np.square(weights).sum())


def entropy(weights):
    """Return -sum(w ln w), between 0 and ln(N)."""
    positive = weights[weights > 0.0]
    return float(max(0.0, -(positive * np.log(positive)).sum()))


def systematic_resample(weights, start, count=None, keep=None):
    """Low-variance resampling from one uniform number.

    Parameters
    ----------
    weights : (N,) float64
        Sum to 1.
    start : float
        Uniform draw in [0, 1).
    count : int, optional
        Number of new particles; default N.
    keep : int, optional
        A particle that survives in any case.

    Returns
    -------
    (count,) int64
        Ancestor of each new particle. One that survives keeps its place if there is one, so that only copies move.
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

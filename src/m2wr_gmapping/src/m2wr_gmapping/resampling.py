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


def systematic_resample(weights, start):
    """Low-variance resampling from one uniform number.

    Parameters
    ----------
    weights : (N,) float64
        Sum to 1.
    start : float
        Uniform draw in [0, 1).

    Returns
    -------
    (N,) int64
        Ancestor of each new particle. A particle that survives keeps its place, so that only copies move.
    """
    count = len(weights)
    targets = (start + np.arange(count)) / count
    drawn = np.minimum(np.searchsorted(np.cumsum(weights), targets, side="right"), count - 1)
    copies = np.bincount(drawn, minlength=count)
    ancestors = np.full(count, -1, np.int64)
    kept = copies > 0
    ancestors[kept] = np.flatnonzero(kept)
    ancestors[~kept] = np.repeat(np.arange(count), np.maximum(copies - 1, 0))
    return ancestors

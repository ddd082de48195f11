# SPDX-License-Identifier: BSD-3-Clause
"""Covariance of the published pose, from the particles about the best one."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.se2 import wrap

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray


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


def covariance(poses: FloatArray, weights: FloatArray, best: int) -> FloatArray:
    """Return the covariance (3, 3) of x, y [m], theta [rad] about the best pose.

    Parameters
    ----------
    poses : (N, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    weights : (N,) float64
        Weights; sum 1.
    best : int
        Index of the pose that is reported.
    """
    away = poses - poses[best]
    away[:, 2] = wrap(away[:, 2])
    return np.einsum("n,ni,nj->ij", weights, away, away) + np.diag(np.square(tuning.PARTICLES.covariance_floor))

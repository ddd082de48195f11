# SPDX-License-Identifier: BSD-3-Clause
"""How sure the particles are of the pose: their covariance about the best of them."""
import numpy as np

from m2wr_gmapping.se2 import wrap

FLOOR = np.square([0.01, 0.01, 0.005])      # a map of cells does not tell better [m^2, m^2, rad^2]


def covariance(poses, weights, best):
    """Return the covariance (3, 3) of x, y [m], theta [rad] about the best pose.

    Parameters
    ----------
    poses : (N, 3) float64
    weights : (N,) float64
        Sum to 1.
    best : int
        Index of the pose that is reported.
    """
    away = poses - poses[best]
    away[:, 2] = wrap(away[:, 2])
    return np.einsum("n,ni,nj->ij", weights, away, away) + np.diag(FLOOR)

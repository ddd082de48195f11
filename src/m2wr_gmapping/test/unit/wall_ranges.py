# SPDX-License-Identifier: BSD-3-Clause
"""Ranges of a laser between straight walls, for tests of scan matching and loop closing."""
import numpy as np


def ranges(walls, pose, angles):
    """Distances to the nearest wall.

    Parameters
    ----------
    walls : (W, 4) float64
        Ends x0, y0, x1, y1 [m].
    pose : (3,) float64
        Pose of the laser [m, m, rad].
    angles : (B,) float64
        Angles of the beams [rad].

    Returns
    -------
    (B,) float64
        Infinite where no wall is hit.
    """
    dx, dy = np.cos(pose[2] + angles)[:, None], np.sin(pose[2] + angles)[:, None]
    x0, y0, x1, y1 = (walls - np.tile(pose[:2], 2)).T
    ex, ey = x1 - x0, y1 - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        along, part = (x0 * ey - y0 * ex) / cross, (x0 * dy - y0 * dx) / cross
    return np.where((along > 0) & (part >= 0) & (part <= 1), along, np.inf).min(axis=1)

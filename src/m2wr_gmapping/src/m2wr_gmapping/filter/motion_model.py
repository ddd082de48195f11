# SPDX-License-Identifier: BSD-3-Clause
"""Odometry motion model: how uncertain a step is, and draws from it."""
import math
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.se2 import compose

CROSS = 0.3     # share of the noise along a direction that movement across it adds


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations per metre travelled and per radian turned.

    ``trans_trans`` (srr) and ``trans_rot`` (str) make noise in metres from a distance and from a turn, ``rot_trans``
    (srt) and ``rot_rot`` (stt) noise in radians from a distance and from a turn.
    """

    trans_trans: float = 0.1
    rot_trans: float = 0.2
    trans_rot: float = 0.1
    rot_rot: float = 0.2

    def deviations(self, step):
        """Return the standard deviations (3,) of a step (3,) x, y, theta, in the frame the step starts from."""
        dx, dy, turn = abs(step[0]), abs(step[1]), abs(step[2])
        return np.array([
            self.trans_trans * dx + self.trans_rot * turn + CROSS * self.trans_trans * dy,
            self.trans_trans * dy + self.trans_rot * turn + CROSS * self.trans_trans * dx,
            self.rot_rot * turn + self.rot_trans * math.hypot(dx, dy)])


def sample_motion(poses, step, noise, normals):
    """Move every particle by an odometry increment plus noise.

    Parameters
    ----------
    poses : (N, 3) float64
        Particle poses in ``map``; left unchanged.
    step : (3,) float64
        Pose now seen from the pose before.
    noise : MotionNoise
    normals : (N, 3) float64
        Standard normal draws, made by the caller so that a run repeats from its seed.

    Returns
    -------
    (N, 3) float64
        New poses, theta in [-pi, pi).

    Raises
    ------
    ValueError
        If ``poses`` and ``normals`` differ in shape or the step is not finite.
    """
    poses, step, normals = np.asarray(poses, float), np.asarray(step, float), np.asarray(normals, float)
    if poses.shape != normals.shape:
        raise ValueError("one row of normals a particle: {} poses, {} normals".format(poses.shape, normals.shape))
    if not np.isfinite(step).all():
        raise ValueError("odometry step {} is not finite".format(step.tolist()))
    return compose(poses, step + noise.deviations(step) * normals)

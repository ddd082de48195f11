# SPDX-License-Identifier: BSD-3-Clause
"""Odometry motion model: uncertainty of a step, and samples from it."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from m2wr_gmapping import tuning
from m2wr_maps.se2 import compose

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import FloatArray, Vector


@dataclass(frozen=True)
class MotionNoise:
    """Standard deviations per metre travelled and per radian turned.

    ``trans_trans`` (srr) and ``trans_rot`` (str) are the translation noise per distance and per rotation. ``rot_trans``
    (srt) and ``rot_rot`` (stt) are the heading noise per distance and per rotation.
    """

    trans_trans: float = 0.1
    rot_trans: float = 0.2
    trans_rot: float = 0.1
    rot_rot: float = 0.2

    def deviations(self, step: Vector) -> FloatArray:
        """Return the standard deviations (3,) of a step (3,) x, y, theta, in the frame where the step starts."""
        dx, dy, turn = abs(step[0]), abs(step[1]), abs(step[2])
        return np.array([
            self.trans_trans * dx + self.trans_rot * turn + tuning.CROSS_NOISE * self.trans_trans * dy,
            self.trans_trans * dy + self.trans_rot * turn + tuning.CROSS_NOISE * self.trans_trans * dx,
            self.rot_rot * turn + self.rot_trans * math.hypot(dx, dy)])


def sample_motion(poses: ArrayLike, step: ArrayLike, noise: MotionNoise, normals: ArrayLike) -> FloatArray:
    """Move every particle by an odometry step plus noise.

    Parameters
    ----------
    poses : (N, 3) float64
        Poses in ``map``; not changed.
    step : (3,) float64
        Step of odometry [m, m, rad].
    noise : MotionNoise
        Noise of the step.
    normals : (N, 3) float64
        Standard normal numbers; the caller draws them, so a run is reproducible.

    Returns
    -------
    (N, 3) float64
        New poses, theta in [-pi, pi).

    Raises
    ------
    ValueError
        If ``poses`` and ``normals`` differ in shape or the step is not finite.
    """
    old, moved, rows = np.asarray(poses, float), np.asarray(step, float), np.asarray(normals, float)
    if old.shape != rows.shape:
        raise ValueError("one row of normals a particle: {} poses, {} normals".format(old.shape, rows.shape))
    if not np.isfinite(moved).all():
        raise ValueError("odometry step {} is not finite".format(moved.tolist()))
    return compose(old, moved + noise.deviations(moved) * rows)

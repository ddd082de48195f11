# SPDX-License-Identifier: BSD-3-Clause
"""The store of obstacle points of :mod:`motion_plan.surroundings`, with compiled rules; the same results."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_navigation.methods import surroundings_kernels as kernels
from motion_plan.surroundings import CELL, CLEAR_MARGIN, WHEEL_MARGIN, Surroundings

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from motion_plan.planar_types import FloatArray, IndexArray, Point


class CompiledSurroundings(Surroundings):
    """Obstacle points around the robot, for programs that take thousands of scans a second.

    ``motion_plan`` does without a compiler, so that its nodes start at once. Parameters and attributes are those of
    :class:`motion_plan.surroundings.Surroundings`.
    """

    def __init__(self, laser: Point, own_parts: Sequence[Sequence[float]], keep_range: float) -> None:
        super().__init__(laser, own_parts, keep_range)
        margin = np.array((-WHEEL_MARGIN, WHEEL_MARGIN, -WHEEL_MARGIN, WHEEL_MARGIN))
        self._parts = np.array(own_parts, np.float64).reshape(-1, 4) + margin
        self._limits = np.array((keep_range, self._forget_distance, CLEAR_MARGIN, CELL))

    def _points_after(self, readings: FloatArray, angle_min: float, angle_increment: float,
                      pose: Tuple[float, float, float]) -> FloatArray:
        place = np.array((*self._laser, *self._laser_at(pose)))
        return kernels.points_after(readings, self._angles, self._cos, self._sin, angle_increment, place, pose[2],
                                    self._limits, self._parts, self.points)

    def free_travel(self, x: float, y: float, directions: ArrayLike, radius: float) -> Tuple[FloatArray, IndexArray]:
        directions = np.array(directions, dtype=np.float64, ndmin=1)
        return kernels.free_travel(self.points, x, y, np.cos(directions), np.sin(directions), radius)

    def first_free(self, x: float, y: float, directions: FloatArray, radius: float, distance: float) -> Tuple[int, int]:
        return kernels.first_free(self.points, x, y, np.cos(directions), np.sin(directions), radius, distance)

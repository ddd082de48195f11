# SPDX-License-Identifier: BSD-3-Clause
"""How near a robot came to any obstacle during a drive."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence

import numpy as np

from m2wr_navigation.compare.clearance_kernels import least_distance
from m2wr_navigation.optimum.shortest_path import inflated

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline


class Clearances:
    """A robot and obstacles, as :func:`m2wr_view.outlines.least_clearance` takes them, ready for many drives.

    Parameters
    ----------
    obstacles : sequence of Outline
        In world.
    footprint : sequence of Outline
        In the robot's frame.
    """

    def __init__(self, obstacles: Sequence[Outline], footprint: Sequence[Outline]) -> None:
        self._parts, self._obstacles = inflated(footprint, 0.0), inflated(obstacles, 0.0)
        self._circles = np.array([_circle(outline) for outline in obstacles]).reshape(-1, 3)

    def least(self, poses: FloatArray) -> float:
        """Return the least distance at many poses [m]: 0 in contact, infinite without obstacles.

        Parameters
        ----------
        poses : (N, 3) float64
            In the order of the drive [m, m, rad]; nothing is assumed in between.
        """
        return float(least_distance(np.ascontiguousarray(poses), *self._parts, *self._obstacles, self._circles))


def _circle(outline: Outline) -> FloatArray:
    """Return the centre and the radius (3,) of a circle around an outline [m]."""
    centre = outline.vertices.mean(axis=0)
    return np.append(centre, np.hypot(*(outline.vertices - centre).T).max() + outline.radius)

# SPDX-License-Identifier: BSD-3-Clause
"""Gymnasium environments without a goal: follow a wall, and explore a world."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, Optional, Tuple, Union

import numpy as np

from m2wr_sim.api.gym_base import RobotEnv
from m2wr_sim.sensors.coverage_kernels import mark_crossed

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

    from m2wr_sim.api.gym_base import Bounds, Observed
    from m2wr_sim.api.records import StepResult
    from m2wr_sim.model.types import Model, World

WALL_REWARD, CELL_REWARD, CONTACT_REWARD = 1.0, 0.05, -10.0     # each metre at the wall, each cell, a contact
_AREA = (-8.0, 8.0, -8.0, 8.0)


class WallFollowingEnv(RobotEnv):
    """A robot keeps a wall on its right at a distance.

    Observation and action are those of :class:`~m2wr_sim.api.gym_base.RobotEnv`.  The reward of a step is the distance
    driven forward [m] times ``exp(-((d - distance) / width)^2)``, where d is the least range on the right; -10 for a
    contact, which terminates the episode.  After ``time_limit`` it is truncated.

    ``reset`` draws start and heading; ``options={"start": (x, y, yaw)}`` sets them.  ``info`` holds ``time`` [s],
    ``contacts`` and ``wall``, the d above [m].

    Parameters
    ----------
    world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode, **options
        As for RobotEnv.
    distance, width : float
        Distance to the wall that is wanted, and the error by which the reward falls to 1/e [m].

    Raises
    ------
    ValueError
        If an option has an unusable value.
    """

    def __init__(self, world: Union[World, str, os.PathLike[str]] = "world02",
                 robot: Union[Model, str, os.PathLike[str]] = "m2wr", duration: float = 0.1, time_limit: float = 60.0,
                 beams: int = 72, max_linear: float = 0.6, max_angular: float = 1.0,
                 area: Tuple[float, float, float, float] = _AREA, distance: float = 0.7, width: float = 0.3,
                 render_mode: Optional[str] = None, **options: Any) -> None:
        if not (distance > 0.0 and width > 0.0):
            raise ValueError("distance %r and width %r; expected numbers above 0" % (distance, width))
        super().__init__(world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode,
                         **options)
        self._wanted, self._width = distance, width
        self._right = self._sim.lasers()[0].angles <= -0.25 * math.pi
        if not self._right.any():
            self._sim.close()
            raise ValueError("the laser of this robot does not look to the right; expected beams at -45 degrees "
                             "and less")

    def _place(self, options: Dict[str, Any]) -> Tuple[float, ...]:
        return self._free_start(options.get("start"))

    def _wall(self, result: StepResult) -> float:
        assert result.scan is not None
        return min(float(result.scan.ranges[self._right].min()), float(self._range_max))

    def _judge(self, result: StepResult) -> Tuple[float, bool]:
        assert result.odometry is not None
        error = (self._wall(result) - self._wanted) / self._width
        reward = WALL_REWARD * result.odometry.linear_x * self._duration * math.exp(-error * error)
        collided = bool(result.contacts)
        return reward + (CONTACT_REWARD if collided else 0.0), collided

    def _info(self, result: StepResult) -> Dict[str, Any]:
        return dict(super()._info(result), wall=self._wall(result))


class ExplorationEnv(RobotEnv):
    """A robot sees as much of a world as it can.

    Observation: ``scan`` and ``velocity`` of :class:`~m2wr_sim.api.gym_base.RobotEnv`, ``pose`` (3,): x, y [m] and yaw
    [rad] in the world, and ``known`` (256,): the share of cells that were seen, in each of 16 x 16 parts of the area,
    row after row along y, in a row along x.  The reward of a step is 0.05 for each new cell that a beam crosses, -10
    for a contact, which terminates the episode.  After ``time_limit`` it is truncated.

    ``reset`` draws start and heading; ``options={"start": (x, y, yaw)}`` sets them.  ``info`` holds ``time`` [s],
    ``contacts`` and ``explored``, the share of all cells.

    Parameters
    ----------
    world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode, **options
        As for RobotEnv.
    cell : float
        Size of a cell [m].

    Raises
    ------
    ValueError
        If an option has an unusable value.
    """

    PARTS = 16          # of the area in x and in y, in an observation

    def __init__(self, world: Union[World, str, os.PathLike[str]] = "world02",
                 robot: Union[Model, str, os.PathLike[str]] = "m2wr", duration: float = 0.1, time_limit: float = 120.0,
                 beams: int = 72, max_linear: float = 0.6, max_angular: float = 1.0,
                 area: Tuple[float, float, float, float] = _AREA, cell: float = 0.25,
                 render_mode: Optional[str] = None, **options: Any) -> None:
        wide, high = area[1] - area[0], area[3] - area[2]
        if not (0.01 <= cell <= min(wide, high) / self.PARTS and max(wide, high) / cell <= 4096):
            raise ValueError("cell %r m in an area of %g x %g m; expected from 0.01 m to 1/%d of the area, and at most "
                             "4096 cells in a row" % (cell, wide, high, self.PARTS))
        super().__init__(world, robot, duration, time_limit, beams, max_linear, max_angular, area, render_mode,
                         **options)
        per_part = [max(1, int(round(size / (self.PARTS * cell)))) for size in (high, wide)]
        self._shape = self.PARTS * per_part[0], self.PARTS * per_part[1]
        self._known: NDArray[np.bool_] = np.zeros(self._shape, bool)
        self._scale = np.array([self._shape[1] / wide, self._shape[0] / high])
        self._in_parts: NDArray[np.int64] = np.zeros((self.PARTS, self.PARTS), np.int64)    # known cells in each
        self._spacing = cell
        groups = self._sim.lasers()[0].angles.reshape(self._beams, -1).mean(axis=1)
        self._beam_cosines, self._beam_sines = np.cos(groups), np.sin(groups)

    def _bounds(self) -> Bounds:
        far = np.array([1e4, 1e4, math.pi])
        return {"pose": (-far, far), "known": (np.zeros(self.PARTS ** 2), np.ones(self.PARTS ** 2))}

    def _place(self, options: Dict[str, Any]) -> Tuple[float, ...]:
        return self._free_start(options.get("start"))

    def _begin(self, result: StepResult) -> None:
        self._known[:] = False
        self._in_parts[:] = 0
        self._look(result)

    def _look(self, result: StepResult) -> int:
        """Mark the cells that the beams cross, and return how many of them were unknown.

        As in the observation, one beam stands for each group: the shortest.
        """
        scan, (x, y, yaw) = result.scan, result.pose
        assert scan is not None
        (left, right), (low, high) = self._area[:2], self._area[2:]
        far = math.hypot(max(abs(x - left), abs(x - right)), max(abs(y - low), abs(y - high)))      # no cell is beyond
        ranges = np.minimum(scan.ranges.reshape(self._beams, -1).min(axis=1), min(float(self._range_max), far)).astype(
            np.float64)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        along = self._scale * np.column_stack((cosine * self._beam_cosines - sine * self._beam_sines,
                                               sine * self._beam_cosines + cosine * self._beam_sines))
        start = self._scale * (x - self._area[0], y - self._area[2])
        return mark_crossed(ranges, along, self._spacing, start, self._known, self._in_parts)

    def _judge(self, result: StepResult) -> Tuple[float, bool]:
        collided = bool(result.contacts)
        return CELL_REWARD * self._look(result) + (CONTACT_REWARD if collided else 0.0), collided

    def _seen(self, result: StepResult) -> Observed:
        shares = self._in_parts.ravel() / (self._known.size / self._in_parts.size)
        pose = np.clip(np.array(result.pose, np.float32), *(
            getattr(self.observation_space["pose"], name) for name in ("low", "high")))
        return {"pose": pose, "known": shares.astype(np.float32)}

    def _info(self, result: StepResult) -> Dict[str, Any]:
        return dict(super()._info(result), explored=float(self._in_parts.sum() / self._known.size))

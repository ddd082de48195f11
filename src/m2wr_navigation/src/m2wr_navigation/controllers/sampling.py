# SPDX-License-Identifier: BSD-3-Clause
"""What controllers share that roll out samples of velocities: the goal, the way out of an obstacle, grids, display."""
from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, Optional, Tuple

import numpy as np

from m2wr_maps.pose_kernels import wrapped
from m2wr_navigation.controllers import distance_kernels, escape_kernels, rollout_kernels
from m2wr_navigation.controllers.arrival import Arrival
from m2wr_navigation.controllers.controller import Command, Controller
from m2wr_navigation.controllers.plan_progress import PlanProgress
from m2wr_navigation.controllers.turn_memory import TurnMemory
from m2wr_navigation.controllers.velocity_samples import Oscillation
from m2wr_navigation.costmap.footprint_kernels import IN_COLLISION, IN_UNKNOWN, OUTSIDE, outline_cost

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

MOST_POSES = 1000           # of one sample's roll-out
AT_ONCE = np.full(3, math.inf)          # acceleration of a robot that has the new velocity at once
_HALF_DIAGONAL = math.sqrt(0.5)         # of a cell, in cells
_WHY = {rollout_kernels.OBSTACLE: "hit an obstacle", rollout_kernels.UNKNOWN: "enter unknown space",
        rollout_kernels.OFF_MAP: "leave the local costmap", rollout_kernels.NO_WAY: "have no way to the plan",
        rollout_kernels.BARRED: "are barred because the robot oscillated"}
_OUTLINE = {IN_COLLISION: rollout_kernels.OBSTACLE, IN_UNKNOWN: rollout_kernels.UNKNOWN,
            OUTSIDE: rollout_kernels.OFF_MAP}


@dataclass(frozen=True)
class GoalLimits:
    """How the robot stops and turns at the goal.

    Attributes
    ----------
    stopped : (float, float)
        Speed [m/s] and rate of turning [rad/s] below which it has stopped.
    turn : (float, float)
        Least and greatest rate of the turn to the goal's heading [rad/s].
    """

    stopped: Tuple[float, float]
    turn: Tuple[float, float]


class SamplingController(Controller):
    """Base of controllers that roll out samples.

    A subclass has the parameters ``xy_goal_tolerance``, ``yaw_goal_tolerance``, ``latch_xy_goal_tolerance``,
    ``acc_lim_x``, ``acc_lim_y``, ``acc_lim_theta``, ``sim_time``, ``sim_granularity`` and ``angular_sim_granularity``.
    """

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self._oscillation, self._arrival, self._progress = Oscillation(), Arrival(), PlanProgress()
        self._turns = False         # whether the turn at the goal has begun
        self._turns_here = TurnMemory()
        self._grids: Float32Array = np.zeros((3, 0, 0), np.float32)
        self._queues: IndexArray = np.zeros((4, 0), np.int64)
        self._passes: Uint8Array = np.zeros((0, 0), np.uint8)

    @property
    @abstractmethod
    def goal_limits(self) -> GoalLimits:
        """Limits for the end of the drive."""

    @abstractmethod
    def drive(self, situation: Situation, used: FloatArray) -> Command:
        """Return the command on the way.

        Parameters
        ----------
        situation : Situation
        used : (L, 3) float64
            Part of the plan within the local costmap.
        """

    @abstractmethod
    def reachable(self, situation: Situation) -> FloatArray:
        """Return the velocities (N, 3) among which a way out of an obstacle is searched."""

    @property
    def acceleration(self) -> FloatArray:
        """Greatest acceleration (3,) [m/s^2, m/s^2, rad/s^2]."""
        return np.array([self.values["acc_lim_x"], self.values["acc_lim_y"], self.values["acc_lim_theta"]])

    def set_plan(self, plan: FloatArray, new_goal: bool) -> None:
        self._progress.reset()
        if new_goal:
            self._oscillation.reset()
            self._arrival.reset()
            self._turns = False
            self._turns_here.reset()

    # ---- near the goal

    def _is_near(self, situation: Situation) -> bool:
        return self._arrival.look(situation.pose, situation.plan[-1], self.values["xy_goal_tolerance"],
                                  self.values["latch_xy_goal_tolerance"])

    def is_goal_reached(self, situation: Situation) -> bool:
        turn = wrapped(situation.plan[-1, 2] - situation.pose[2])
        velocity, stopped = situation.velocity, self.goal_limits.stopped
        return bool(self._is_near(situation) and abs(turn) <= self.values["yaw_goal_tolerance"]
                    and math.hypot(velocity[0], velocity[1]) <= stopped[0] and abs(velocity[2]) <= stopped[1])

    def _stop_and_turn(self, situation: Situation) -> Command:
        """Return the command at the goal: stop first, then turn to the goal's heading."""
        velocity, period, goal = situation.velocity, situation.period, situation.plan[-1:]
        limits, acceleration = self.goal_limits, self.acceleration
        turn = wrapped(goal[0, 2] - situation.pose[2])
        # a turn about a point beside the base frame moves this frame: no reason to stop again
        self._turns = self._turns or math.hypot(velocity[0], velocity[1]) <= limits.stopped[0]
        if not self._turns or abs(turn) <= self.values["yaw_goal_tolerance"]:
            braked = np.sign(velocity) * np.maximum(np.abs(velocity) - period * acceleration, 0.0)
            return Command(braked, "", situation.pose[None], goal)
        for angle in (turn, turn - math.copysign(2.0 * math.pi, turn)):     # or the long way round
            poses, reason, place = self._turned(situation, angle)
            if reason == rollout_kernels.VALID:
                return Command(np.array([0.0, 0.0, self._rate(situation, angle)]), "", poses, goal)
        return Command(None, "the robot cannot turn to the goal's heading: it would {} at ({:.2f}, {:.2f})".format(
            _WHY[reason], *place), np.zeros((0, 3)), goal)

    def _rate(self, situation: Situation, angle: float) -> float:
        """Return the rate with which to begin or continue a turn [rad/s]."""
        (least, most), limit = self.goal_limits.turn, self.acceleration[2]
        present = math.copysign(1.0, angle) * situation.velocity[2]
        rate = min(max(abs(angle), least), most)
        rate = min(max(rate, present - situation.period * limit), present + situation.period * limit)
        return math.copysign(max(min(rate, math.sqrt(2.0 * limit * abs(angle))), min(least, most)), angle)

    def _turned(self, situation: Situation, angle: float) -> Tuple[FloatArray, int, FloatArray]:
        """Return the poses of a turn on the spot, why it is not possible, and the centre of the robot."""
        count = 1 + min(MOST_POSES, int(math.ceil(abs(angle) / self.values["angular_sim_granularity"])))
        poses = np.repeat(np.asarray(situation.pose, float)[None], count, axis=0)
        poses[:, 2] += np.linspace(0.0, angle, count)
        for pose in poses:
            cost = self._outline_at(situation, pose)
            if cost < 0:
                return poses, _OUTLINE[cost], pose[:2]
        return poses, rollout_kernels.VALID, poses[-1, :2]

    # ---- in each cycle

    def compute(self, situation: Situation) -> Command:
        if self._outline_at(situation, situation.pose) in (IN_COLLISION, IN_UNKNOWN):
            return self._escape(situation)
        if self._is_near(situation):
            self._turns_here.reset()        # it led to the goal
            return self._stop_and_turn(situation)
        self._turns = False
        used = self._local_part(situation)
        if used is None:
            return Command(None, "the plan does not cross the local costmap, the robot is at ({:.2f}, {:.2f})".format(
                *situation.pose[:2]), np.zeros((0, 3)), np.zeros((0, 3)))
        self._turns_here.look(situation.pose, float(np.hypot(*situation.footprint.T).max(initial=0.0)))
        return self.drive(situation, used)

    def _local_part(self, situation: Situation) -> Optional[FloatArray]:
        """Return the part of the plan from the robot to where it leaves the local costmap."""
        costmap, plan = situation.costmap, situation.plan
        first = self._progress.advance(plan, situation.pose, 0.5 * costmap.resolution * max(costmap.costs.shape))
        if first is None:
            return None
        cells = costmap.cells(plan[first:])
        outside = np.flatnonzero((cells < 0).any(axis=1) | (cells >= costmap.costs.shape).any(axis=1))
        last = first + int(outside[0]) if len(outside) else len(plan)
        return plan[first:last] if last > first else None

    @staticmethod
    def _outline_at(situation: Situation, pose: FloatArray) -> int:
        costmap = situation.costmap
        return int(outline_cost(costmap.costs, costmap.resolution, costmap.origin,
                                np.ascontiguousarray(situation.footprint), pose[0], pose[1], pose[2]))

    def _escape(self, situation: Situation) -> Command:
        """Return a command that makes the overlap of the robot with an obstacle smaller."""
        costmap, values, footprint = situation.costmap, self.values, np.ascontiguousarray(situation.footprint)
        place = "the outline of the robot is in an obstacle or in unknown space at ({:.2f}, {:.2f})".format(
            *situation.pose[:2])
        samples = self.reachable(situation)
        radius = float(np.hypot(*footprint.T).max()) + 2.0 * costmap.resolution
        ahead = float(np.hypot(*samples[:, :2].T).max(initial=0.0)) * values["sim_time"]
        found = np.empty((escape_kernels.MOST_CELLS, 2))
        count = escape_kernels.obstacles_around(costmap.costs, costmap.resolution, costmap.origin, situation.pose[0],
                                                situation.pose[1], (radius, radius + ahead), found)
        best = -1 if count == len(found) else escape_kernels.best_way_out(
            samples, situation.pose, np.asarray(situation.velocity, float), AT_ONCE,
            np.array([values["sim_time"], values["sim_granularity"], values["angular_sim_granularity"],
                      float(MOST_POSES)]), found[:count], _HALF_DIAGONAL * costmap.resolution, footprint)
        if best < 0:
            return Command(None, "{}, and none of {} velocities leads out".format(place, len(samples)),
                           np.zeros((0, 3)), situation.plan[-1:])
        return Command(samples[best], place + ", it drives out", self.poses(situation, samples[best], AT_ONCE),
                       situation.plan[-1:])

    def poses(self, situation: Situation, velocity: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Return the poses (S, 3) to which a velocity leads within ``sim_time``.

        Parameters
        ----------
        situation : Situation
        velocity : (3,) float64
            Command [m/s, m/s, rad/s].
        acceleration : (3,) float64
            With which the robot takes it.
        """
        values, out = self.values, np.empty((MOST_POSES, 3))
        steps = rollout_kernels.step_count(velocity, values["sim_time"], values["sim_granularity"],
                                           values["angular_sim_granularity"], MOST_POSES)
        rollout_kernels.roll_out(situation.pose, np.asarray(situation.velocity, float), velocity, acceleration,
                                 values["sim_time"], steps, out)
        return out[:steps]

    def fill_grids(self, situation: Situation, used: FloatArray, nose: float) -> Float32Array:
        """Return the distances (3, H, W) to the plan, to its end, and to its end moved ahead, in cells.

        Parameters
        ----------
        situation : Situation
        used : (L, 3) float64
            Part of the plan within the local costmap.
        nose : float
            By which the end is moved on, as seen from the robot [m].
        """
        costmap, shape = situation.costmap, situation.costmap.costs.shape
        if self._grids.shape[1:] != shape:
            self._grids, self._passes = np.zeros((3,) + shape, np.float32), np.zeros(shape, np.uint8)
            self._queues = np.zeros((4, 4 * shape[0] * shape[1]), np.int64)
        cells = _dense_cells(costmap, used)
        away = used[-1, :2] - situation.pose[:2]
        direction = math.atan2(away[1], away[0])
        front = used[-1, :2] + nose * np.array([math.cos(direction), math.sin(direction)])
        ahead = _dense_cells(costmap, np.vstack([used[-1, :2], front]))[-1:]
        moved = len(ahead) and len(cells) and (ahead != cells[-1:]).any()
        for grid, seeds in zip(self._grids, (cells, cells[-1:], ahead) if moved else (cells, cells[-1:])):
            distance_kernels.spread_distances(costmap.costs, seeds, self._queues, self._passes, grid)
        if not moved:
            self._grids[2] = self._grids[1]
        return self._grids


def cost_cloud(costmap: Costmap, grids: Float32Array, scales: Tuple[float, float, float]) -> FloatArray:
    """Return x, y, z, path, goal, obstacle and total cost (P, 7) of the cells that have a way to the plan.

    Parameters
    ----------
    costmap : Costmap
    grids : (3, H, W) float32
    scales : (float, float, float)
        Of the distances to the plan and to its end, in cells, and of the costs.
    """
    path, goal, cell = grids[0], grids[1], costmap.resolution
    rows, columns = np.nonzero((path < distance_kernels.BLOCKED) & (goal < distance_kernels.BLOCKED))
    parts = (scales[0] * path[rows, columns], scales[1] * goal[rows, columns], scales[2] * costmap.costs[rows, columns])
    return np.column_stack([costmap.origin[0] + (columns + 0.5) * cell, costmap.origin[1] + (rows + 0.5) * cell,
                            np.zeros(len(rows)), *parts, sum(parts)]).astype(np.float32)


def _dense_cells(costmap: Costmap, points: FloatArray) -> IndexArray:
    """Return the cells (K, 2) below the line through some points, within the grid and in order."""
    places = points[:, :2]
    steps = np.hypot(*np.diff(places, axis=0).T) if len(places) > 1 else np.zeros(0)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    wanted = np.append(np.arange(0.0, along[-1], 0.5 * costmap.resolution), along[-1])
    dense = np.column_stack([np.interp(wanted, along, places[:, k]) for k in (0, 1)])
    cells = costmap.cells(dense)
    return np.ascontiguousarray(cells[costmap.inside(cells)])


def explained(reasons: IndexArray, places: FloatArray) -> str:
    """Return a sentence why no sample is valid.

    Parameters
    ----------
    reasons : (N,) int64
        As of ``score_samples``.
    places : (N, 2) float64
        Where each fails [m].
    """
    parts = []
    for reason, count in sorted(zip(*np.unique(reasons, return_counts=True)), key=lambda item: -item[1]):
        first = places[int(np.flatnonzero(reasons == reason)[0])]
        parts.append("{} {}{}".format(count, _WHY[int(reason)], "" if reason == rollout_kernels.BARRED else
                                      ", such as at ({:.2f}, {:.2f})".format(*first)))
    return "no velocity is valid: of {} samples {}".format(len(reasons), "; ".join(parts))

# SPDX-License-Identifier: BSD-3-Clause
"""Regulated pure pursuit (Macenski 2023): an arc to a point ahead on the plan, slower in curves and near the goal."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Mapping, Tuple

import numpy as np

from m2wr_maps.pose_kernels import wrapped
from m2wr_navigation.controllers.controller import Command, Controller
from m2wr_navigation.controllers.plan_progress import PlanProgress
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.costmap.footprint_kernels import IN_COLLISION, outline_cost
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_node.array_types import FloatArray

STOPPED = 0.02, 0.05        # m/s, rad/s: below, the robot has stopped
SLOWER = (1.0, 0.5, 0.25)   # shares of the wanted speed that are tried before an obstacle
_BRAKES = 0.5               # share of the acceleration that is used to stop at the goal, for the delay of the robot
SIMULATED = 0.05            # s between two poses of the arc that is checked


class PurePursuit(Controller):
    """Follows a plan with arcs of curvature 2 y / L^2 to a point at the distance L; checks them with the footprint."""

    PARAMETERS = {
        "max_vel_x": Parameter(0.5, "m/s", 0.01, 20.0, "greatest speed"),
        "max_vel_theta": Parameter(1.0, "rad/s", 0.05, 20.0, "greatest rate of turning"),
        "min_vel_theta": Parameter(0.2, "rad/s", 0.0, 20.0, "least rate of turning on the spot"),
        "acc_lim_x": Parameter(1.0, "m/s^2", 0.05, 20.0, "greatest acceleration"),
        "acc_lim_theta": Parameter(3.0, "rad/s^2", 0.05, 20.0, "greatest angular acceleration"),
        "lookahead_time": Parameter(1.2, "s", 0.1, 10.0, "the point ahead is so far away, in time"),
        "min_lookahead": Parameter(0.3, "m", 0.05, 10.0, "least distance of the point ahead"),
        "max_lookahead": Parameter(1.0, "m", 0.05, 10.0, "greatest distance of the point ahead"),
        "turn_on_spot": Parameter(0.8, "rad", 0.1, 3.15, "if the point ahead is farther to the side, the robot turns"),
        "min_radius": Parameter(0.9, "m", 0.0, 100.0, "on tighter arcs the robot is slower in proportion"),
        "sim_time": Parameter(1.0, "s", 0.1, 10.0, "time for which an arc is checked"),
        "xy_goal_tolerance": Parameter(0.1, "m", 0.01, 10.0, "distance to the goal at which it is reached"),
        "yaw_goal_tolerance": Parameter(0.1, "rad", 0.01, 6.3, "angle to the goal's heading at which it is reached"),
    }

    def __init__(self, values: Mapping[str, Any]) -> None:
        super().__init__(values)
        self._progress, self._arrived = PlanProgress(), False

    def set_plan(self, plan: FloatArray, new_goal: bool) -> None:
        self._progress.reset()
        if new_goal:
            self._arrived = False

    def is_goal_reached(self, situation: Situation) -> bool:
        goal, pose = situation.plan[-1], situation.pose
        near = math.hypot(*(goal[:2] - pose[:2])) <= self.values["xy_goal_tolerance"]
        self._arrived = self._arrived or near       # then only the heading counts: turning may move the robot a little
        slow = math.hypot(*situation.velocity[:2]) <= STOPPED[0] and abs(situation.velocity[2]) <= STOPPED[1]
        return self._arrived and slow and abs(wrapped(goal[2] - pose[2])) <= self.values["yaw_goal_tolerance"]

    def compute(self, situation: Situation) -> Command:
        goal, pose = situation.plan[-1], situation.pose
        if self._arrived:
            angle = wrapped(goal[2] - pose[2])
            if abs(angle) <= 0.5 * self.values["yaw_goal_tolerance"]:
                return Command(np.array([self._braked(situation), 0.0, 0.0]), "", pose[None], situation.plan[-1:])
            return self._turn(situation, angle, situation.plan[-1:])
        target, rest, ahead = self._point_ahead(situation)
        cosine, sine = math.cos(pose[2]), math.sin(pose[2])
        x = cosine * (target[0] - pose[0]) + sine * (target[1] - pose[1])
        y = cosine * (target[1] - pose[1]) - sine * (target[0] - pose[0])
        side = math.atan2(y, x)
        if abs(side) > self.values["turn_on_spot"]:
            return self._turn(situation, side, ahead)
        square = max(x * x + y * y, 1e-6)
        return self._drive(situation, 2.0 * y / square, rest, ahead)

    def _point_ahead(self, situation: Situation) -> Tuple[FloatArray, float, FloatArray]:
        """Return the point to drive to, the length of the rest of the plan [m], and this rest."""
        plan, pose = situation.plan, situation.pose
        steps = np.hypot(*np.diff(plan[:, :2], axis=0).T)
        along = np.concatenate([[0.0], np.cumsum(steps)])
        nearest = self._progress.advance(plan, pose, math.inf) or 0
        values = self.values
        distance = min(max(abs(situation.velocity[0]) * values["lookahead_time"], values["min_lookahead"]),
                       max(values["max_lookahead"], values["min_lookahead"]))
        at = int(np.searchsorted(along, along[nearest] + distance))
        return plan[min(at, len(plan) - 1)], float(along[-1] - along[nearest]), plan[nearest:]

    def _drive(self, situation: Situation, curvature: float, rest: float, ahead: FloatArray) -> Command:
        """Return the fastest command on an arc that is free."""
        values, period = self.values, situation.period
        speed = values["max_vel_x"]
        if abs(curvature) * values["min_radius"] > 1.0:
            speed /= abs(curvature) * values["min_radius"]
        if abs(curvature) * speed > values["max_vel_theta"]:
            speed = values["max_vel_theta"] / abs(curvature)
        speed = min(speed, math.sqrt(2.0 * _BRAKES * values["acc_lim_x"] * max(rest, 0.01)))
        before, reach = situation.velocity[0], values["acc_lim_x"] * period
        reason = ""
        for share in SLOWER:
            wanted = min(max(share * speed, before - reach), max(before, 0.0) + reach)
            velocity = np.array([wanted, 0.0, curvature * wanted])
            free, poses, reason = self._checked(situation, velocity)
            if free:
                return Command(velocity, "", poses, ahead)
        turned = self._turn(situation, math.copysign(1.0, curvature), ahead) if abs(curvature) > 0.1 else None
        if turned is not None and turned.velocity is not None:
            return turned
        return Command(None, reason, np.zeros((0, 3)), ahead)

    def _turn(self, situation: Situation, angle: float, ahead: FloatArray) -> Command:
        """Return a command that turns on the spot by an angle [rad]."""
        values, period = self.values, situation.period
        rate = min(values["max_vel_theta"], math.sqrt(2.0 * _BRAKES * values["acc_lim_theta"] * abs(angle)))
        rate = max(rate, min(values["min_vel_theta"], values["max_vel_theta"]))
        wanted = math.copysign(rate, angle)
        before, reach = situation.velocity[2], values["acc_lim_theta"] * period
        wanted = min(max(wanted, before - reach), before + reach)
        velocity = np.array([self._braked(situation), 0.0, wanted])
        free, poses, reason = self._checked(situation, velocity)
        if not free:
            return Command(None, reason, np.zeros((0, 3)), ahead)
        return Command(velocity, "", poses, ahead)

    def _braked(self, situation: Situation) -> float:
        """Return the speed of a robot that stops as fast as it may [m/s]."""
        return max(0.0, float(situation.velocity[0]) - self.values["acc_lim_x"] * situation.period)

    def _checked(self, situation: Situation, velocity: FloatArray) -> Tuple[bool, FloatArray, str]:
        """Return whether the arc of a command is free, its poses (N, 3), and the place of the first contact."""
        grid, pose = situation.costmap, situation.pose
        times = np.arange(1, int(self.values["sim_time"] / SIMULATED) + 1) * SIMULATED
        poses = np.empty((len(times), 3))
        poses[:, 2] = pose[2] + velocity[2] * times
        middle = pose[2] + 0.5 * velocity[2] * times
        chord = velocity[0] * times * np.sinc(0.5 * velocity[2] * times / math.pi)
        poses[:, 0], poses[:, 1] = pose[0] + chord * np.cos(middle), pose[1] + chord * np.sin(middle)
        for k, (x, y, yaw) in enumerate(poses):
            cost = outline_cost(grid.costs, grid.resolution, grid.origin, situation.footprint, x, y, yaw)
            if cost == IN_COLLISION or grid.cost_at(x, y) == LETHAL:
                return False, poses[:k], "the robot would collide at ({:.2f}, {:.2f}) in {:.1f} s with {:.2f} m/s " \
                    "and {:.2f} rad/s".format(x, y, times[k], velocity[0], velocity[2])
        return True, poses, ""

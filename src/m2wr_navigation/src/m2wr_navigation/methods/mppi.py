# SPDX-License-Identifier: BSD-3-Clause
"""MPPI: a sampling model predictive controller (Williams 2016, 2018) over a map of what was seen on the way.

2000 sequences of 56 commands of 0.05 s are rolled out in each cycle; their mean, weighted by exp(-cost / lambda), is
the next sequence. Each pose is checked with the robot's outline, as discs on the distances of the map. The rest of the
way, from the end of a sample to the goal, is that around all obstacles on the map, so no obstacle that was seen is a
local minimum. What moves is no part of the map: a sample is checked with where it will be then. Not complete: patience
ends the drive.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.methods import mppi_kernels
from m2wr_navigation.methods.local_map import LocalMap
from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.methods.moving import MovingObstacles
from m2wr_navigation.methods.scan_points import scan_points
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_node.array_types import FloatArray

KNOTS = 8                               # of a disturbance: it changes in 0.4 s, as a robot does
SPEEDS, RATES = 6, 21                   # of the arcs: constant commands among the samples
GOAL_MARGIN = 0.5                       # m: a goal so far beyond the horizon's end is not looked for
SLICES = 3                              # of the outline, across; each has discs of about the same width


class Mppi(Method):
    """MPPI."""

    PARAMETERS = dict(COMMON, **{
        "samples": Parameter(2000, "", 10, 20000, "sequences of commands"),
        "horizon": Parameter(56, "", 2, 400, "commands of a sequence"),
        "step": Parameter(0.05, "s", 0.01, 1.0, "time of a command; the period of the loop"),
        "min_vel_x": Parameter(-0.15, "m/s", -5.0, 0.0, "greatest speed backwards, negative"),
        "acc_lim_x": Parameter(2.5, "m/s^2", 0.05, 100.0, "acceleration that the robot has"),
        "acc_lim_theta": Parameter(5.0, "rad/s^2", 0.05, 100.0, "the same of its turning"),
        "acc_lim_y": Parameter(2.5, "m/s^2", 0.05, 100.0, "acceleration to the side in a curve"),
        "deviation_x": Parameter(0.4, "", 0.001, 10.0, "standard deviation of the disturbance of the speed, as a share "
                                 "of the greatest"),
        "deviation_theta": Parameter(0.4, "", 0.001, 10.0, "the same of the rate of turning"),
        "temperature": Parameter(0.05, "s", 0.0001, 1000.0, "lambda: how far the mean is from the best sample"),
        "gamma": Parameter(0.0, "", 0.0, 1000.0, "weight of the cost of the commands themselves"),
        "margin": Parameter(0.03, "m", 0.0, 1.0, "least clearance of the robot's outline"),
        "near": Parameter(0.25, "m", 0.01, 2.0, "clearance below which a second costs more"),
        "near_weight": Parameter(2.0, "", 0.0, 1000.0, "how much more at the greatest speed, without any clearance"),
        "map_side": Parameter(20.0, "m", 2.0, 100.0, "side of the map that is kept"),
        "map_resolution": Parameter(0.05, "m", 0.01, 0.5, "side of its cells"),
        "map_sight": Parameter(6.0, "m", 0.5, 30.0, "readings of the laser beyond are not entered in the map"),
        "predict": Parameter(False, "", 0, 1, "look ahead to where obstacles that move will be"),
        "seed": Parameter(0, "", 0, 2 ** 31 - 1, "of the disturbances"),
    })

    def restart(self) -> None:
        values, body = self.values, self.body
        self._random = np.random.default_rng(values["seed"])
        self._nominal = np.zeros((values["horizon"], 2))
        self._discs = discs_of(body)
        duration = values["horizon"] * values["step"]
        self._moving = MovingObstacles(duration, values["near"] / duration)     # slower ones come no nearer than that
        self._map = LocalMap(body, values["map_side"], values["map_resolution"], values["map_sight"],
                             max(body.turning_radius, self._discs[0, 2]) + values["near"])

    def _settings(self, away: float) -> mppi_kernels.RolloutSettings:
        """Return what does not change in a cycle in which the goal is so far away [m]."""
        values, step = self.values, self.values["step"]
        reach = values["horizon"] * step * values["max_vel_x"] + values["goal_tolerance"] + GOAL_MARGIN
        return mppi_kernels.RolloutSettings(
            step, values["min_vel_x"], values["max_vel_x"], values["max_vel_theta"], step * values["acc_lim_x"],
            step * values["acc_lim_theta"], values["acc_lim_y"], values["deviation_x"] * values["max_vel_x"],
            values["deviation_theta"] * values["max_vel_theta"], values["margin"], values["near"],
            values["near_weight"], 0.02, 1.0, values["gamma"], 0.5 * values["goal_tolerance"] if away <= reach else 0.0)

    def decide(self, view: View) -> Decision:
        values, settings = self.values, self._settings(view.goal_distance)
        if len(self._nominal) != values["horizon"]:
            self._nominal = np.zeros((values["horizon"], 2))
        scan = scan_points(view.sensing, self.body, values["map_sight"])
        self._map.look(scan, self._moving.update(scan) if values["predict"] else None)
        moving = self._moving.moving
        self._map.aim(self.goal)
        state = np.array([view.x, view.y, view.yaw, *view.velocity])
        arcs = _arcs(settings)[:values["samples"] // 2]
        noise = self._random.standard_normal((values["samples"], KNOTS, 2), np.float32)
        noise[len(arcs)] = 0.0
        grids = (self._map.distance, self._map.to_goal, self._map.corner, self._discs, moving, state)
        costs = mppi_kernels.costs_of(*grids, self._nominal, arcs, noise, settings)
        mean = mppi_kernels.weighted_mean(self._nominal, arcs, noise, costs, values["temperature"], settings)
        best = int(np.argmin(costs))
        calm = np.zeros((2, 2), np.float32)
        if mppi_kernels.cost_of(*grids, mean, calm, settings) > costs[best] + values["temperature"]:
            mean = mppi_kernels.weighted_mean(self._nominal, arcs, noise, costs, 1e-9, settings)
        v, w = view.velocity        # the robot gets no command that it cannot follow: its wheels would slip
        linear, angular = mppi_kernels.reached(v, w, mean[0, 0], mean[0, 1], settings)
        self._nominal[:-1], self._nominal[-1] = mean[1:], mean[-1]
        if costs[best] >= mppi_kernels.COLLISION / 2.0 and not len(moving):
            self._nominal[:] = 0.0
            return Decision(0.0, angular if view.velocity[0] < 0.01 else 0.0, reason="all samples collide")
        return Decision(linear, angular, reason="least cost {:.1f} s".format(float(costs[best])))


def discs_of(body: RobotBody) -> FloatArray:
    """Return discs (N, 3) that cover the rim of a robot's hull, the first all of it: x, y from the axle, radius [m].

    Parameters
    ----------
    body : RobotBody
    """
    corners = body.hull - (body.axle_x, 0.0)
    middle = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
    found = [(*middle.tolist(), float(np.hypot(*(corners - middle).T).max()))]
    ends = np.linspace(corners[:, 0].min(), corners[:, 0].max(), SLICES + 1)
    for k, (low, high) in enumerate(zip(ends[:-1], ends[1:])):
        rims = np.array([_widths(corners, x) for x in np.linspace(low, high, 5)])
        bottom, top = rims[:, 0].min(), rims[:, 1].max()
        count = max(1, int(np.rint((top - bottom) / (high - low))))
        width = (top - bottom) / count
        found += [(0.5 * (low + high), bottom + (j + 0.5) * width, 0.5 * float(np.hypot(high - low, width)))
                  for j in range(count) if k in (0, SLICES - 1) or j in (0, count - 1)]
    return np.array(found)


def _widths(corners: FloatArray, x: float) -> FloatArray:
    """Return least and greatest y of a convex polygon at x."""
    following = np.roll(corners, -1, axis=0)
    low, high = np.minimum(corners[:, 0], following[:, 0]), np.maximum(corners[:, 0], following[:, 0])
    across = (low - 1e-9 <= x) & (x <= high + 1e-9)
    first, run = corners[across], following[across] - corners[across]
    share = np.clip((x - first[:, 0]) / np.where(run[:, 0] == 0.0, 1.0, run[:, 0]), 0.0, 1.0)
    y = np.concatenate([first[:, 1] + share * run[:, 1], first[run[:, 0] == 0.0, 1],
                        following[across][run[:, 0] == 0.0, 1]])
    return np.array([y.min(), y.max()])


def _arcs(settings: mppi_kernels.RolloutSettings) -> FloatArray:
    """Return constant commands (A, 2), the fast and the slow ones."""
    speeds = np.append(np.linspace(0.0, settings.most_v, SPEEDS), settings.least_v)
    rates = np.linspace(-settings.most_w, settings.most_w, RATES)
    return np.stack(np.meshgrid(speeds, rates, indexing="ij"), -1).reshape(-1, 2)

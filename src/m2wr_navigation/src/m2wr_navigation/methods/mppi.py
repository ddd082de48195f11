# SPDX-License-Identifier: BSD-3-Clause
"""MPPI: a sampling model predictive controller straight towards the goal (Williams 2016, 2018).

2000 sequences of 56 commands of 0.05 s are rolled out in each cycle; their mean, weighted by exp(-cost / lambda), is
the next sequence. Not complete: the horizon is 2.8 s, and patience ends the drive in a local minimum.
"""
from __future__ import annotations

import math

import numpy as np

from m2wr_navigation.methods.local_grid import local_grid
from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.methods.mppi_kernels import costs_of, improve
from m2wr_navigation.parameters import Parameter

SCALING = 5.0                           # 1/m: decay of the costs


class Mppi(Method):
    """MPPI."""

    PARAMETERS = dict(COMMON, **{
        "samples": Parameter(2000, "", 10, 20000, "sequences of commands"),
        "horizon": Parameter(56, "", 2, 400, "commands of a sequence"),
        "step": Parameter(0.05, "s", 0.01, 1.0, "time of a command; the period of the loop"),
        "deviation_x": Parameter(0.2, "m/s", 0.001, 10.0, "standard deviation of the disturbance of the speed"),
        "deviation_theta": Parameter(0.6, "rad/s", 0.001, 10.0, "the same of the rate of turning"),
        "temperature": Parameter(0.3, "", 0.001, 1000.0, "lambda: how far the mean is from the best sample"),
        "gamma": Parameter(0.015, "", 0.0, 1000.0, "weight of the cost of the commands themselves"),
        "seed": Parameter(0, "", 0, 2 ** 31 - 1, "of the disturbances"),
    })

    def restart(self) -> None:
        self._random = np.random.default_rng(self.values["seed"])
        self._nominal = np.zeros((self.values["horizon"], 2))

    def decide(self, view: View) -> Decision:
        values = self.values
        costmap = local_grid(view, self.body.turning_radius, SCALING)
        corner = (float(costmap.origin[0]), float(costmap.origin[1]), costmap.resolution)
        if len(self._nominal) != values["horizon"]:
            self._nominal = np.zeros((values["horizon"], 2))
        noise = self._random.standard_normal((values["samples"], values["horizon"], 2), np.float32)
        limits = (values["max_vel_x"], values["max_vel_theta"])
        deviations = (values["deviation_x"], values["deviation_theta"])
        costs = costs_of(costmap.costs, corner, (view.x, view.y, view.yaw), (float(self.goal[0]), float(self.goal[1])),
                         self._nominal, noise, (values["step"],) + deviations + limits + (values["gamma"],))
        improve(self._nominal, noise, costs, deviations + (values["temperature"],))
        np.clip(self._nominal, (0.0, -limits[1]), limits, out=self._nominal)
        linear, angular = self._nominal[0]
        self._nominal[:-1] = self._nominal[1:]
        free = self.travel(view, view.yaw)[0] + self.radius - self.body.turning_radius
        return Decision(min(float(linear), math.sqrt(max(free, 0.0))), float(angular),
                        reason="least cost {:.1f}".format(float(costs.min())))

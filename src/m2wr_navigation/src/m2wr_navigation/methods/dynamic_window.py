# SPDX-License-Identifier: BSD-3-Clause
"""The dynamic window approach straight towards the goal (Fox, Burgard, Thrun 1997).

The same controller as ``dwa_local_planner/DWAPlannerROS``, on a costmap of what the laser saw, with the straight line
to the goal as its plan. Not complete: the window is 6 x 6 m, and patience ends the drive in a local minimum.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Mapping, Optional

import numpy as np

from m2wr_navigation.controllers import dwa
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.footprint import padded
from m2wr_navigation.methods.local_grid import RESOLUTION, SIDE, local_grid
from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody

_NO_SIDEWAYS = {"vy_samples": 1, "min_vel_y": 0.0, "max_vel_y": 0.0}    # a differential drive
_AHEAD = 0.5 * SIDE - 0.2               # m: the plan ends inside of the window


class DynamicWindow(Method):
    """DWA."""

    PARAMETERS = dict(COMMON, **{
        "period": Parameter(0.05, "s", 0.01, 1.0, "time between two cycles"),
        "sim_time": Parameter(1.7, "s", 0.1, 10.0, "time that is rolled out"),
        "vx_samples": Parameter(12, "", 1, 100, "samples of the speed"),
        "vth_samples": Parameter(30, "", 1, 100, "samples of the rate of turning"),
        "path_distance_bias": Parameter(0.0, "", 0.0, 1e6, "weight of the distance from the line to the goal; there is "
                                        "none in the original method"),
        "goal_distance_bias": Parameter(0.8, "", 0.0, 1e6, "weight of the distance to its end in the window"),
        "occdist_scale": Parameter(0.02, "", 0.0, 1e6, "weight of the greatest cost below the robot"),
        "padding": Parameter(0.05, "m", 0.0, 1.0, "added around the footprint"),
        "scaling": Parameter(4.0, "1/m", 0.0, 100.0, "decay of the costs around obstacles"),
    })

    def __init__(self, values: Mapping[str, Any], body: Optional[RobotBody] = None) -> None:
        super().__init__(values, body)
        self.restart()

    def restart(self) -> None:
        shared = {name: value for name, value in self.values.items() if name in dwa.Dwa.PARAMETERS}
        limits = {"max_vel_trans": self.values["max_vel_x"], "min_vel_trans": 0.05, "min_vel_theta": 0.2}
        settings = {name: parameter.default for name, parameter in dwa.Dwa.PARAMETERS.items()}
        self._controller = dwa.Dwa(dict(settings, **dict(shared, **dict(limits, **_NO_SIDEWAYS))))
        self._footprint = padded(self.body.hull - (self.body.axle_x, 0.0), self.values["padding"])

    def decide(self, view: View) -> Decision:
        reach = min(view.goal_distance, _AHEAD)
        shares = np.linspace(0.0, 1.0, max(2, int(reach / RESOLUTION)))
        direction = np.array([np.cos(view.goal_direction), np.sin(view.goal_direction)])
        plan = np.column_stack([(view.x, view.y) + shares[:, None] * reach * direction,
                                np.full(len(shares), view.goal_direction)])
        # the plan's end moves on with the robot: it never arrives there before the goal
        plan = np.concatenate([plan, plan[-1:] + (*(0.5 * direction), 0.0)])
        self._controller.set_plan(plan, False)
        grid = local_grid(view, self.body.inscribed_radius, self.values["scaling"])
        situation = Situation(view.stamp, self.values["period"], np.array([view.x, view.y, view.yaw]),
                              np.array([view.velocity[0], 0.0, view.velocity[1]]), plan, grid, self._footprint)
        command = self._controller.compute(situation)
        if command.velocity is None:
            return Decision(0.0, 0.0, reason=command.reason)
        return Decision(float(command.velocity[0]), float(command.velocity[2]), reason=command.reason or "least cost")

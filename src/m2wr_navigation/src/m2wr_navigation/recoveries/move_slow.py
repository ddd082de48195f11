# SPDX-License-Identifier: BSD-3-Clause
"""``move_slow_and_clear/MoveSlowAndClear``: forgets obstacles near the robot, and lets it drive slowly for a while."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_navigation.parameters import Parameter, text
from m2wr_navigation.recoveries.recovery import Recovery, SpeedLimit, Step

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation

_NO_EFFECT = "accepted, without effect: the commands of any controller are limited"


class MoveSlowAndClear(Recovery):
    """Clears a square around the robot in one cycle; until it has moved on, commands are slowed down on their arcs."""

    PARAMETERS = {
        "clearing_distance": Parameter(0.5, "m", 0.0, 1e6, "half side of the square around the robot"),
        "limited_trans_speed": Parameter(0.25, "m/s", 0.01, 1e6, "greatest speed until the robot has moved on"),
        "limited_rot_speed": Parameter(0.45, "rad/s", 0.01, 1e6, "greatest rate of turning until then"),
        "limited_distance": Parameter(0.3, "m", 0.0, 1e6, "how far it has to move"),
        "planner_namespace": text("DWAPlannerROS", _NO_EFFECT),
        "max_trans_param_name": text("max_trans_vel", _NO_EFFECT),
        "max_rot_param_name": text("max_rot_vel", _NO_EFFECT),
    }

    def step(self, situation: Situation) -> Step:
        values, done = self.values, []
        for which in ("global", "local"):
            layers = self.costmaps.layer_names(which)
            count = self.costmaps.clear(which, layers, 2.0 * values["clearing_distance"], True)
            done.append("{} occupied cells in the {} costmap".format(count, which))
        limit = SpeedLimit(values["limited_trans_speed"], values["limited_rot_speed"], values["limited_distance"])
        told = "{} cleared {:g} m around the robot: {}; at most {:g} m/s and {:g} rad/s for {:g} m".format(
            self.name, values["clearing_distance"], ", ".join(done), *limit)
        return Step(None, True, told, limit)

# SPDX-License-Identifier: BSD-3-Clause
"""Work of the wheels."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.criteria.criterion import Criterion
from m2wr_navigation.parameters import Parameter

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track

GRAVITY = 9.80665           # m/s^2: standard gravity (CGPM 1901)
SEPARATION = 0.4            # m between the wheels: wheelSeparation of m2wr.gazebo


class Energy(Criterion):
    """Work against rolling resistance, along the way of each wheel, and to gain speed; brakes give nothing back.

    Each wheel carries half of the weight: W = c m g (s_left + s_right) / 2 + sum of the increases of m v^2 / 2 and
    J w^2 / 2.
    """

    UNIT = "J"
    PARAMETERS = {
        "weight": Parameter(0.02, "m/J", 0.0, 1000.0, "metres of score for a joule"),
        "mass": Parameter(5.4, "kg", 0.01, 1e4, "of the robot; m2wr: chassis 5 kg, two wheels of 0.2 kg"),
        "inertia": Parameter(0.12, "kg m^2", 1e-4, 1e5, "about the vertical axis; m2wr: 0.106 of the chassis and "
                             "0.2 kg x (0.2 m)^2 of each wheel"),
        "rolling": Parameter(0.02, "", 0.0, 1.0, "coefficient of rolling resistance; rubber on a hard floor: 0.01 to "
                             "0.035"),
    }

    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        if len(track.stamps) < 2:
            return 0.0
        values, steps, turns = self.values, track.steps, track.turns
        outer = 0.5 * SEPARATION * turns
        wheels = np.abs(steps - outer) + np.abs(steps + outer)
        rolling = values["rolling"] * values["mass"] * GRAVITY * 0.5 * wheels.sum()
        times = np.maximum(np.diff(track.stamps), 1e-6)
        kinetic = np.concatenate([[0.0], 0.5 * values["mass"] * (steps / times) ** 2
                                  + 0.5 * values["inertia"] * (turns / times) ** 2])
        return float(rolling + np.maximum(np.diff(kinetic), 0.0).sum())

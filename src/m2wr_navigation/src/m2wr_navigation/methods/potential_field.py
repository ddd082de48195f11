# SPDX-License-Identifier: BSD-3-Clause
"""Artificial potential field: drawn by the goal, pushed away by obstacles (Khatib 1986).

The potentials are k d^2 / 2 to the goal, linear beyond 1 m, and eta (1 / rho - 1 / rho0)^2 / 2 from the nearest
obstacle in each sector within rho0. Not complete: in a local minimum the robot stops, and patience ends the drive.
"""
from __future__ import annotations

import math

import numpy as np

from m2wr_navigation.methods.method import COMMON, Decision, Method, View
from m2wr_navigation.parameters import Parameter

SECTORS = 12
_LEAST = 0.03               # m: least rho; the force is finite
_INSIDE = 0.05              # m: rho counts from so far inside of the disc in which the robot can turn


class PotentialField(Method):
    """Potential field."""

    PARAMETERS = dict(COMMON, **{
        "attraction": Parameter(1.0, "1/m", 0.0, 1000.0, "k of the goal"),
        "repulsion": Parameter(0.02, "m^3", 0.0, 1000.0, "eta of obstacles"),
        "influence": Parameter(0.8, "m", 0.05, 2.0, "rho0: distance from the robot's disc at which obstacles begin "
                               "to push"),
        "body": Parameter(0.0, "m", 0.0, 5.0, "radius from which rho counts; 0: where the robot can turn, less {:g} m"
                          .format(_INSIDE)),
    })

    def decide(self, view: View) -> Decision:
        pull = self.values["attraction"] * min(view.goal_distance, 1.0)
        force = pull * np.array([math.cos(view.goal_direction), math.sin(view.goal_direction)])
        offset = view.surroundings.points - np.array([view.x, view.y])
        far = np.hypot(offset[:, 0], offset[:, 1])
        sector = ((np.arctan2(offset[:, 1], offset[:, 0]) + math.pi) / (2.0 * math.pi) * SECTORS).astype(int) % SECTORS
        reach = self.values["influence"]
        body = self.values["body"] or self.body.turning_radius - _INSIDE
        for one in range(SECTORS):
            inside = np.flatnonzero(sector == one)
            if not len(inside):
                continue
            nearest = inside[int(np.argmin(far[inside]))]
            gap = max(float(far[nearest]) - body, _LEAST)
            if gap < reach:
                push = self.values["repulsion"] * (1.0 / gap - 1.0 / reach) / gap ** 2
                force -= push * offset[nearest] / max(far[nearest], 1e-6)
        size = float(np.hypot(*force))
        speed = self.values["max_vel_x"] * min(size / max(pull, 1e-9), 1.0)
        return self.steer(view, math.atan2(force[1], force[0]), "down the potential", speed)

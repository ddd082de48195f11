# SPDX-License-Identifier: BSD-3-Clause
"""Searches of a robot that was carried away: global localization, while it drives along what it sees."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping

import numpy as np

from m2wr_navigation.accuracy.driven import M2WR_DRIVEN
from m2wr_navigation.accuracy.rounds import Rounds
from m2wr_navigation.accuracy.runs import PERIOD, Robot, random_goals
from m2wr_navigation.methods.method import Sensing
from m2wr_sim.api import Sim

if TYPE_CHECKING:
    from m2wr_navigation.accuracy.driven import Driven
    from m2wr_navigation.accuracy.scenes import Scene

FOUND = 0.3, math.radians(10.0)     # m, rad: a pose so near to the true one is found
LASTING = 10.0              # s that it has to last
CHANGE = np.array([0.1, 0.4])      # m/s, rad/s: greatest change of the command in one period


@dataclass(frozen=True)
class Search:
    """The search of a robot that may be anywhere.

    Attributes
    ----------
    found : bool
        Whether the pose was right for the last LASTING seconds.
    time : float
        Since when it was right [s]; NaN: not found.
    away : float
        Distance of the last pose from the true one [m].
    claimed : bool
        Whether amcl itself has no doubt about the last pose.
    contacts : int
        That began on the way.
    """

    found: bool
    time: float
    away: float
    claimed: bool
    contacts: int


def search(scene: Scene, seed: int, amcl: Mapping[str, Any], limit: float, driven: Driven = M2WR_DRIVEN) -> Search:
    """Put the robot somewhere, call global localization, and let it drive along what it sees.

    Parameters
    ----------
    scene : Scene
    seed : int
    amcl : mapping of str to object
        Parameters of amcl.
    limit : float
        [s]
    driven : Driven

    Returns
    -------
    Search
    """
    start = random_goals(scene, 1, seed, driven)[0]
    with Sim(scene.world, driven.model, tuple(start), seed=seed, sensing="now") as sim:
        robot = Robot(driven, scene, sim, seed, amcl)
        robot.localizer.start_anywhere()
        drive = Rounds({name: parameter.default for name, parameter in Rounds.PARAMETERS.items()}, driven.body)
        result, command = sim.step((0.0, 0.0), PERIOD), np.zeros(2)
        begun, since = result.time, math.nan
        while result.time - begun < limit:
            robot.take(result)
            right = bool(robot.errors) and robot.errors[-1][1] < FOUND[0] and robot.errors[-1][2] < FOUND[1]
            since = (result.time - begun if math.isnan(since) else since) if right else math.nan
            scan, pose = result.scan, robot.odometry.pose
            assert scan is not None
            wanted = drive.step(Sensing(result.time, (pose[0], pose[1], pose[2]), (command[0], command[1]),
                                        scan.ranges, scan.angle_min, scan.angle_increment))
            command = command + np.clip(np.array([wanted.linear, wanted.angular]) - command, -CHANGE, CHANGE)
            result = sim.step((float(command[0]), float(command[1])), PERIOD)
        lasted = not math.isnan(since) and limit - since >= LASTING
    return Search(lasted, since if lasted else math.nan, robot.errors[-1][1] if robot.errors else math.nan,
                  not robot.doubt, robot.contacts)

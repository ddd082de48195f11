# SPDX-License-Identifier: BSD-3-Clause
"""One run in the simulator, without ROS."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Tuple

import numpy as np

from m2wr_campaign.rough.drive import heading_of, tilt_of
from m2wr_delivery.carrier import Action, Carrier, Sense
from m2wr_delivery.position import take_fix
from m2wr_delivery.referee import Referee, Senses, Truth
from m2wr_delivery.scenario import WALL
from m2wr_elevation.dead_reckoning import heading
from m2wr_elevation.study.mapping import PERIOD, MappingRobot
from m2wr_sim.api import Sim
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Box, Collision, Heightmap, Link, Model, Surface, World

if TYPE_CHECKING:
    from m2wr_delivery.scenario import Scenario
    from m2wr_sim.geometry import Pose

STEP = 0.005                # s of the simulation
DROP = 0.5                  # m above the ground, from which robots are let down
SETTLE = 1.0                # s, in which they come to rest
ROBOT = "m2wr_rough"


def wall_poses(scenario: Scenario) -> List[Pose]:
    """Return the poses of the walls; half of each is in the ground.

    Parameters
    ----------
    scenario : Scenario
    """
    return [((wall.x, wall.y, scenario.height_at((wall.x, wall.y))), quaternion_from_rpy(0.0, 0.0, wall.yaw))
            for wall in scenario.walls]


def world_of(scenario: Scenario) -> World:
    """Return ground and walls as a world.

    Parameters
    ----------
    scenario : Scenario
    """
    grid, surface = scenario.grid, Surface(mu=1.0, mu2=1.0)
    field = Heightmap(np.ascontiguousarray(scenario.heights), (grid.size, grid.size))
    models = [Model("ground", (Link("link", collisions=(Collision("ground", field, surface=surface),)),), static=True)]
    for number, (wall, pose) in enumerate(zip(scenario.walls, wall_poses(scenario))):
        box = Collision("wall", Box((wall.length, WALL[0], 2.0 * WALL[1])))
        models.append(Model("wall%d" % (number + 1), (Link("link", collisions=(box,)),), pose=pose, static=True))
    return World("delivery", tuple(models))


class Runner:
    """The robots of a scenario in one simulation.

    Parameters
    ----------
    scenario : Scenario

    Attributes
    ----------
    referee : Referee
    carriers : dict of str to Carrier
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._sim = Sim(world_of(scenario), step=STEP, seed=scenario.seed)
        settings = scenario.settings
        self.referee, self.carriers = Referee(scenario), {}
        for name, (x, y, yaw) in scenario.starts.items():
            self._sim.spawn(ROBOT, (x, y, DROP, yaw), name=name)
            self.carriers[name] = Carrier(name, (x, y), settings.capacity, settings.map, 0.5 * settings.size,
                                          settings.charger)
        self._sim.step(duration=SETTLE)
        self._robots = {name: MappingRobot(self._sim, settings.map, scenario.seed + number, name, follow=False)
                        for number, name in enumerate(scenario.starts)}

    def run(self, progress: Optional[Callable[[Referee], None]] = None) -> str:
        """Run to the end; return why it ended.

        Parameters
        ----------
        progress : callable, optional
            Called after each simulated second.
        """
        outboxes: Dict[str, Tuple[str, ...]] = {}
        count = 0
        while not self.referee.finished():
            senses = self.referee.step(self._sim.time, self._truth(), outboxes)
            outboxes, commands = {}, {}
            for name, carrier in self.carriers.items():
                action = self._act(name, carrier, senses[name])
                outboxes[name] = action.outbox
                commands[name] = (action.linear, action.angular) if self.referee.powered(name) else (0.0, 0.0)
            self._sim.step(commands, PERIOD)
            count += 1
            if progress is not None and count % 10 == 0:
                progress(self.referee)
        return self.referee.finished()

    def close(self) -> None:
        """End the simulation."""
        self._sim.close()

    def _act(self, name: str, carrier: Carrier, senses: Senses) -> Action:
        robot = self._robots[name]
        robot.look(carrier.others(self._sim.time))
        if senses.fix is not None:
            take_fix(robot, senses.fix)
        x, y, _ = robot.reckoning.position.tolist()
        pose = self._sim.pose(name)
        action = carrier.step(Sense(self._sim.time, x, y, heading(robot.reckoning.rotation), tilt_of(pose),
                                    senses.battery, senses.loaded, senses.inbox, robot.map.layers, senses.fix))
        if action.request:
            getattr(self.referee, action.request)(name)
        return action

    def _truth(self) -> Dict[str, Truth]:
        found = {}
        for name in self.carriers:
            pose = self._sim.pose(name)
            found[name] = Truth(*pose[0], heading_of(pose), tilt_of(pose))
        return found

    def drift(self) -> Dict[str, float]:
        """Return how far each robot is from where it takes itself to be [m]."""
        return {name: math.dist(self._sim.pose(name)[0][:2], robot.reckoning.position[:2])
                for name, robot in self._robots.items()}

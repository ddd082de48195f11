# SPDX-License-Identifier: BSD-3-Clause
"""Runs of the BARN benchmark: a robot that knows only its laser and its odometry, judged by the truth."""
from __future__ import annotations

import math
import os
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Dict, Tuple

import numpy as np
import yaml

from m2wr_maps.se2 import between
from m2wr_navigation import registry
from m2wr_navigation.accuracy.navigator import Navigator
from m2wr_navigation.barn.score import COLLISION
from m2wr_navigation.compare.drawing import thinned
from m2wr_navigation.compare.drive import PERIOD, Robot, drive
from m2wr_navigation.compare.survey import APART
from m2wr_navigation.methods.method import REACHED, STUCK, Decision, Sensing
from m2wr_navigation.parameters import read
from m2wr_navigation.robot_body import body_of
from m2wr_sim.api import read_robot, read_world
from m2wr_sim.api.loading import package_folder

if TYPE_CHECKING:
    from m2wr_navigation.compare.survey import Job
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_sim.api import StepResult
    from m2wr_sim.model.types import World

ARRIVED = 1.0               # m from the goal, by the truth
BEGUN = 0.1                 # m from the start: the clock of a run begins
LIMIT = 100.0               # s
#: Of the robot [m/s^2, m/s^2, rad/s^2]: both at once ask 2 + 8 * 0.188 of the 4 m/s^2 that its wheels have.
ACCELERATION = {"acc_lim_x": 2.0, "acc_lim_y": 2.0, "acc_lim_theta": 8.0}
OWN_TOLERANCE = 0.3         # m: with which a method ends by itself
MOVE_BASE = "move_base"
#: Names of what is compared.
NAMES = [MOVE_BASE, *registry.METHODS]


def jackal(max_vel_x: float, max_vel_theta: float) -> Robot:
    """Return the robot of the benchmark.

    Parameters
    ----------
    max_vel_x, max_vel_theta : float
        Of methods; move_base has its own [m/s, rad/s].
    """
    model = read_robot(os.path.join(package_folder("m2wr_navigation"), "robots", "jackal_like.urdf"))
    return Robot(model, body_of(model), dict(ACCELERATION, max_vel_x=max_vel_x, max_vel_theta=max_vel_theta))


@lru_cache(maxsize=1)
def move_base_parameters() -> Dict[str, Any]:
    """Return the parameters of ``config/barn.yaml``."""
    with open(os.path.join(package_folder("m2wr_navigation"), "config", "barn.yaml"), encoding="utf-8") as stream:
        found: Dict[str, Any] = yaml.safe_load(stream)
    return found


@lru_cache(maxsize=2)
def _world(text: str) -> World:
    return read_world(text)


class MoveBaseStack:
    """The stack of move_base with the parameters of ``config/barn.yaml``.

    Parameters
    ----------
    goal : (2,) float
        In the odometry frame [m].
    laser : (3,) float
        In the base frame [m, m, rad].
    """

    def __init__(self, goal: Vector, laser: Vector) -> None:
        self._stack = Navigator(None, move_base_parameters(), np.array(laser, float))
        self._goal, self._begun = np.array([goal[0], goal[1], 0.0]), False

    def decide(self, result: StepResult) -> Decision:
        """Return the command after a step of the simulation.

        Parameters
        ----------
        result : StepResult
        """
        scan, odometry = result.scan, result.odometry
        assert scan is not None and odometry is not None
        self._stack.look(result.time, scan, np.array(odometry.pose))
        if not self._begun:
            self._stack.begin(result.time, self._goal)
            self._begun = True
        outcome = self._stack.cycle(result.time, np.array([odometry.linear_x, 0.0, odometry.angular_z]))
        if outcome.result:
            return Decision(0.0, 0.0, REACHED if outcome.result == "succeeded" else STUCK, outcome.text)
        velocity = np.zeros(3) if outcome.velocity is None else outcome.velocity
        return Decision(float(velocity[0]), float(velocity[2]))


class MethodDriver:
    """A method without a map, by odometry.

    Parameters
    ----------
    name : str
        Of the registry.
    goal : (2,) float
        In the odometry frame [m].
    robot : Robot
    seed : int
    """

    def __init__(self, name: str, goal: Vector, robot: Robot, seed: int) -> None:
        kind = registry.find(registry.METHODS, name)
        given = dict(robot.limits, goal_tolerance=OWN_TOLERANCE)
        if "seed" in kind.PARAMETERS:
            given["seed"] = seed
        self._method = kind(read(kind.PARAMETERS, given, name)[0], robot.body)
        self._method.begin(goal)

    def decide(self, result: StepResult) -> Decision:
        """Return the command after a step of the simulation.

        Parameters
        ----------
        result : StepResult
        """
        scan, odometry = result.scan, result.odometry
        assert scan is not None and odometry is not None
        decided: Decision = self._method.step(Sensing(
            result.time, odometry.pose, (odometry.linear_x, odometry.angular_z), scan.ranges, scan.angle_min,
            scan.angle_increment))
        return decided


class Referee:
    """Ends a run as the challenge does, by the true pose.

    Parameters
    ----------
    driver : MoveBaseStack or MethodDriver
    start : (3,) float
        [m, m, rad]
    goal : (2,) float
        [m]
    """

    def __init__(self, driver: Any, start: Vector, goal: Vector) -> None:
        self._driver, self._start, self._goal = driver, start, goal

    def decide(self, result: StepResult) -> Decision:
        """Return the driver's command, or the end.

        Parameters
        ----------
        result : StepResult
        """
        x, y = result.pose[:2]
        if result.contacts:
            contact = result.contacts[0]
            return Decision(0.0, 0.0, COLLISION, "{} and {} at ({:.2f}, {:.2f})".format(
                contact.first, contact.second, *contact.position[:2]))
        if math.hypot(x - self._goal[0], y - self._goal[1]) < ARRIVED:
            return Decision(0.0, 0.0, REACHED, "")
        decision: Decision = self._driver.decide(result)
        if decision.outcome == REACHED:         # by its odometry only
            return Decision(0.0, 0.0, STUCK, "it takes ({:.2f}, {:.2f}) for the goal".format(x, y))
        return decision


def driving_time(poses: FloatArray) -> float:
    """Return the time from the first pose that is BEGUN away from the start to the last [s].

    Parameters
    ----------
    poses : (N, 3) float64
        One for each cycle.
    """
    away = np.hypot(*(poses[:, :2] - poses[0, :2]).T) >= BEGUN
    return PERIOD * (len(poses) - 1 - int(np.argmax(away))) if away.any() else PERIOD * (len(poses) - 1)


def run(job: Job) -> Dict[str, Any]:
    """Return the record of a run.

    Parameters
    ----------
    job : Job
        Its seed is that of the noise, and of a method that draws samples.
    """
    scene, robot = job.scene, job.robot
    goal: Tuple[float, float, float] = tuple(between(np.array(scene.start), np.array([*scene.goal, 0.0])).tolist())
    driver = MoveBaseStack(goal[:2], robot.body.laser) if job.name == MOVE_BASE else MethodDriver(
        job.name, goal[:2], robot, job.seed)
    found = drive(_world(scene.world), scene.start, Referee(driver, scene.start, scene.goal).decide, job.limit,
                  job.seed, robot)
    return {"key": job.key, "scene": scene.name, "name": job.name, "seed": job.seed, "outcome": found.outcome,
            "reason": found.reason, "success": found.outcome == REACHED, "time": driving_time(found.poses),
            "cpu_ms": found.cpu_ms, "path": np.round(thinned(found.poses[:, :2], APART), 2).tolist()}

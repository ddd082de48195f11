# SPDX-License-Identifier: BSD-3-Clause
"""Drives of a robot in the simulator, in this process: by a method without a map, or along a planned path."""
from __future__ import annotations

import math
import time
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Callable, Dict, List, Tuple, Union

import numpy as np

from m2wr_navigation.compare.movers import Watch, movers_of
from m2wr_navigation.methods.body import M2WR, RobotBody
from m2wr_navigation.methods.method import STUCK, Decision, Method, Sensing
from m2wr_navigation.methods.standstill import Standstill
from m2wr_sim.api import Sim
from m2wr_view.outlines import FLOOR

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_sim.api import StepResult
    from m2wr_sim.model.types import Model, World

PERIOD = 0.05               # s: a command is given at 20 Hz
TIME_OUT = "time out"


@dataclass(frozen=True)
class Robot:
    """The robot that drives.

    Attributes
    ----------
    model : Model or str
        As :func:`m2wr_sim.api.read_robot` takes it.
    body : RobotBody
        Its measures.
    limits : dict of str to float
        Parameters of its speed, such as ``max_vel_x``, for methods and controllers that have them.
    """

    model: Union[Model, str]
    body: RobotBody
    limits: Dict[str, float] = field(default_factory=dict)


#: The robot of m2wr_description.
M2WR_ROBOT = Robot("m2wr", M2WR)


@dataclass(frozen=True)
class Drive:
    """The record of a drive.

    Attributes
    ----------
    outcome : str
        ``reached``, ``unreachable``, ``stuck`` or ``time out``.
    reason : str
        Of the method.
    poses : (N, 3) float64
        True poses of the robot at each cycle [m, m, rad].
    time : float
        Simulated time [s].
    contacts : int
        Contacts of the robot with obstacles that began.
    cpu_ms : float
        CPU time of the method, mean of a cycle [ms].
    moving_clearance : float
        Least distance of the robot's outline from an obstacle that moves, at the cycles [m]; infinite without one.
    met, struck : int
        Meetings with obstacles that move, and those of them in which the obstacle closed the gap at least as fast as
        the robot; see :class:`m2wr_navigation.compare.movers.Watch`.
    """

    outcome: str
    reason: str
    poses: FloatArray
    time: float
    contacts: int
    cpu_ms: float
    moving_clearance: float = math.inf
    met: int = 0
    struck: int = 0

    @property
    def length(self) -> float:
        """Length of the path [m]."""
        return float(np.sum(np.hypot(*np.diff(self.poses[:, :2], axis=0).T)))


def drive(world: World, start: Vector, decide: Callable[[StepResult], Decision], limit: float = 600.0,
          seed: int = 0, robot: Robot = M2WR_ROBOT, patience: float = math.inf) -> Drive:
    """Return the record of a drive, until the decisions end.

    Parameters
    ----------
    world : World
    start : (3,) float
        Pose of the robot [m, m, rad].
    decide : callable
        Gives a decision for the result of each step.
    limit : float
        Simulated time after which the drive ends [s].
    seed : int
        Of the noise of the sensors.
    robot : Robot, optional
    patience : float, optional
        Simulated time in which a robot that moves less than 1 m is stuck, which ends the drive [s].
    """
    poses: List[Tuple[float, float, float]] = []
    contacts, spent, cycles = 0, 0.0, 0
    decision = Decision(0.0, 0.0)
    standstill = Standstill()
    watch = Watch(movers_of(world, FLOOR, robot.body.height), robot.body.footprint)
    with Sim(world, robot.model, (float(start[0]), float(start[1]), float(start[2])), seed=seed, sensing="now") as sim:
        begun = sim.time
        while sim.time - begun < limit:
            result = sim.step((decision.linear, decision.angular), PERIOD)
            seen, = result.robots.values()
            poses.append(seen.pose)
            contacts += len(seen.contacts)
            watch.look(sim, seen.pose, seen.contacts)
            before = time.process_time()
            decision = decide(result)
            spent, cycles = spent + time.process_time() - before, cycles + 1
            if decision.outcome != "running":
                break
            stuck = standstill.look(sim.time, seen.pose[0], seen.pose[1], patience)
            if stuck:
                decision = Decision(0.0, 0.0, STUCK, "it " + stuck)
                break
        else:
            decision = Decision(0.0, 0.0, TIME_OUT, "{:.0f} s".format(limit))
        duration = sim.time - begun
    return Drive(decision.outcome, decision.reason, np.array(poses), duration, contacts, 1e3 * spent / max(cycles, 1),
                 watch.least, watch.met, watch.struck)


def sensing_of(result: StepResult) -> Sensing:
    """Return what a method sees of a step of the simulation."""
    seen, = result.robots.values()
    scan, odometry = seen.scan, seen.odometry
    assert scan is not None and odometry is not None
    return Sensing(result.time, seen.pose, (odometry.linear_x, odometry.angular_z), scan.ranges, scan.angle_min,
                   scan.angle_increment)


def method_decisions(method: Method, goal: Vector) -> Callable[[StepResult], Decision]:
    """Return the decisions of a method without a map, which begins with a goal.

    Parameters
    ----------
    method : Method
    goal : (2,) float
        [m]
    """
    method.begin(goal)
    return lambda result: method.step(sensing_of(result))


def drive_method(world: World, start: Vector, goal: Vector, method: Method, limit: float = 600.0,
                 seed: int = 0, robot: Robot = M2WR_ROBOT) -> Drive:
    """Return the record of a drive by a method without a map.

    Parameters
    ----------
    world : World
    start : (3,) float
        [m, m, rad]
    goal : (2,) float
        [m]
    method : Method
    limit : float
        [s]
    seed : int
    robot : Robot, optional
    """
    return drive(world, start, method_decisions(method, goal), limit, seed, robot)


def final_distance(poses: FloatArray, goal: Vector) -> float:
    """Return the distance of the last pose from a goal [m].

    Parameters
    ----------
    poses : (N, 3) float64
    goal : (2,) float
    """
    return math.hypot(poses[-1, 0] - goal[0], poses[-1, 1] - goal[1])

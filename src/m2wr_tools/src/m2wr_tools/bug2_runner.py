# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2 and the simulator in one process: the state machines of motion_plan in the same periods as their nodes.

The three nodes (bug2, wall_follower, go_to_point) have loops of 20 Hz.  Here their periods begin at the same time: the
sensor data are processed, then Bug 2 decides and switches the behaviours, then the active behaviour commands the robot.
Numbers that pass 32-bit message fields are rounded in the same way.
"""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, List, Optional, Tuple

import numpy as np

from m2wr_sim.api.records import Contact
from m2wr_sim.api.sim import Sim
from motion_plan.bug2 import Bug2, State
from motion_plan.go_to_point import GoToPoint
from motion_plan.pose_history import PoseHistory
from motion_plan.regions import RegionReader
from motion_plan.surroundings import Surroundings
from motion_plan.wall_follower import WallFollower
from motion_plan.wall_guard import WallGuard

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_sim.api.records import Odometry, Scan
    from motion_plan.planar_types import Point, Pose, Regions

#: Period of the nodes' loops [s].
TURN = 0.05
#: A run that takes longer [simulated s] ends as ``time_out``.
LIMIT = 900.0
_COMMAND_TIMEOUT = 1.0          # s, as in bug2.launch
TIME_OUT = "time_out"


@dataclass(frozen=True)
class Change:
    """One change of Bug 2's state: when [s], to what, why, and the pose (x, y [m], yaw [rad]) in the odometry frame."""

    time: float
    state: str
    reason: str
    pose: Tuple[float, float, float]


@dataclass(frozen=True)
class Bug2Run:
    """The record of a run.

    Attributes
    ----------
    outcome : str
        ``goal_reached``, ``goal_unreachable`` or ``time_out``.
    reason : str
        The reason that Bug 2 gives.
    time : float
        Simulated time at the end [s].
    states : tuple of Change
        Every state entered, the first one included.
    path : (N, 4) float64
        Time [s] and true pose x, y [m], yaw [rad] at each period.
    contacts : tuple of Contact
        Contacts of the robot, other than with the ground.
    start, goal : (float, float)
        Ends of the m-line [m].
    """

    outcome: str
    reason: str
    time: float
    states: Tuple[Change, ...]
    path: FloatArray = field(repr=False)
    contacts: Tuple[Contact, ...]
    start: Tuple[float, float]
    goal: Tuple[float, float]

    @property
    def reached(self) -> bool:
        """Whether the robot has reached the goal without a contact."""
        return self.outcome == State.GOAL_REACHED.value and not self.contacts

    @property
    def path_length(self) -> float:
        """Length of the path [m]."""
        return float(np.hypot(np.diff(self.path[:, 1]), np.diff(self.path[:, 2])).sum())

    def points(self, state: str) -> List[Point]:
        """Return the points (x, y) [m] at which a state was entered: the hit points for ``wall_following``."""
        return [change.pose[:2] for change in self.states if change.state == state]


class Bug2Driver:
    """The state machines of the three nodes, their switches and their sensor data.

    Parameters
    ----------
    sim : Sim
        With ``sensing="due"``.
    robot : str
        Name of the robot in it.
    start, goal : (float, float)
        Ends of the m-line [m].
    leave_rule : str
        ``complete``, or ``report`` for the printed rule and the unguarded wall follower.

    Raises
    ------
    ValueError
        If start, goal or rule are not valid, or the robot has no laser that measures by itself.
    """

    def __init__(self, sim: Sim, robot: str, start: Point, goal: Point, leave_rule: str = "complete") -> None:
        self.bug = Bug2(start, goal, leave_rule)
        self.states: List[Change] = []
        self._sim, self._drive, lasers = sim, sim.drive(robot), sim.lasers(robot)
        if not lasers or not lasers[0].enabled:
            raise ValueError("\"%s\" has no laser that measures by itself; Bug 2 needs one (sensing=\"due\")" % robot)
        self._go_to_point, self._wall_follower = GoToPoint(goal), WallFollower()
        self._guard = None if leave_rule == "report" else WallGuard()
        self._reader, self._surroundings, self._history = RegionReader(), Surroundings(), PoseHistory()
        self._pose: Optional[Pose] = None
        self._speed: Optional[Tuple[float, float]] = None
        self._regions: Optional[Regions] = None
        self._scan_time: Optional[float] = None
        self._going = self._following = False
        self._drive.callbacks.append(self._on_odometry)
        lasers[0].callbacks.append(self._on_scan)
        self._laser = lasers[0]

    def _on_odometry(self, odometry: Odometry) -> None:
        pose = odometry.pose
        self._pose, self._speed = pose, (odometry.linear_x, odometry.angular_z)
        self._history.add(odometry.time, pose)

    def _on_scan(self, scan: Optional[Scan]) -> None:
        if scan is None:
            return
        angle_min, angle_max, increment = (float(np.float32(value)) for value in (
            scan.angle_min, scan.angle_max, scan.angle_increment))
        regions = self._reader.read(scan.ranges, angle_min, angle_max, increment)
        self._regions, self._scan_time = regions, scan.time
        pose = self._history.at(scan.time)
        if pose is not None:
            self._surroundings.update(scan.ranges, angle_min, increment, pose)
        self._wall_follower.take_action(regions)

    def turn(self) -> bool:
        """Process one period of all three loops at the present time; return whether the run has ended."""
        if self._pose is None or self._speed is None or self._regions is None or self._scan_time is None:
            return False
        now, bug = self._sim.time, self.bug
        if not self.states:
            self._enter(now, self._pose)        # as the node does before its loop
        before = bug.state
        bug.update(now, self._pose, self._regions, self._surroundings, self._speed, now - self._scan_time)
        if bug.state is not before:
            self._enter(now, self._pose)
        if self._following:
            command = self._wall_follower.update()
            if self._guard is not None:
                command = self._guard.update(now, self._pose, self._surroundings, command)
            self._drive.command(*command)
        if self._going:
            self._drive.command(*self._go_to_point.update(self._pose))
        return bug.finished

    def _enter(self, now: float, pose: Pose) -> None:
        """Record the new state and switch the behaviours; one that is switched off stops the robot."""
        state = self.bug.state
        self.states.append(Change(now, state.value, self.bug.reason, pose))
        following = state is State.WALL_FOLLOWING
        going = state in (State.GO_TO_POINT, State.GOAL_REACHED)
        if going and not self._going:
            self._go_to_point.restart()
        if following != self._following and self._guard is not None:
            self._guard.release()
        if (self._going and not going) or (self._following and not following):
            self._drive.command(0.0, 0.0)
        self._going, self._following = going, following

    def close(self) -> None:
        """Stop using the sensors."""
        self._drive.callbacks.remove(self._on_odometry)
        self._laser.callbacks.remove(self._on_scan)


def run_bug2(world: Any = "world02", start: Point = (0.0, 8.0), goal: Point = (0.0, -4.0), yaw: float = 0.0,
             seed: int = 0, robot: Any = "m2wr", leave_rule: str = "complete", phase: float = 0.0, limit: float = LIMIT,
             **options: Any) -> Bug2Run:
    """Drive Bug 2 from start to goal; by default the experiment of ``bug2.launch``.

    Parameters
    ----------
    world, robot, seed
        As for :class:`~m2wr_sim.api.sim.Sim`.
    start, goal : (float, float)
        x, y [m] in the world.
    yaw : float
        Heading at the start [rad].
    leave_rule : str
        See :class:`Bug2Driver`.
    phase : float
        Begin of the periods after multiples of 50 ms [s]: nodes start at any time.
    limit : float
        Simulated time after which to give up [s].
    **options
        The other options of Sim.

    Returns
    -------
    Bug2Run

    Raises
    ------
    ValueError
        If start, goal, rule or phase are not valid.
    WorldError, ModelError
        If the world or the robot cannot be used.
    """
    if not 0.0 <= phase < TURN:
        raise ValueError("phase of %r s; expected at least 0 and less than %g s" % (phase, TURN))
    options.setdefault("command_timeout", _COMMAND_TIMEOUT)
    with Sim(world, robot, (start[0], start[1], yaw), seed, **options) as sim:
        driver = Bug2Driver(sim, sim.robots[0], start, goal, leave_rule)
        contacts: List[Contact] = []
        path: List[Tuple[float, ...]] = []
        over = False
        now = sim.step(None, phase) if phase >= sim.step_size else sim.observe()
        while not over and now.time < limit:
            contacts += now.contacts
            path.append((now.time,) + now.pose)
            now = sim.step(None, TURN)
            over = driver.turn()
        contacts += now.contacts
        path.append((now.time,) + now.pose)
        outcome = driver.bug.state.value if driver.bug.finished else TIME_OUT
        reason = driver.bug.reason if driver.bug.finished else "not over after %g s" % now.time
        return Bug2Run(outcome, reason, now.time, tuple(driver.states), np.array(path), tuple(contacts),
                       (start[0], start[1]), (goal[0], goal[1]))

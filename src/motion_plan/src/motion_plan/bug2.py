# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2: towards the goal along the m-line, around an obstacle by wall following, then along the m-line again.

Selects the active behaviour; the behaviours themselves (`go_to_point`, `wall_follower`) do not depend on it.
"""
from __future__ import annotations

import abc
import logging
import math
from enum import Enum
from typing import List, Optional, Sequence, Tuple

from motion_plan.circuit import Circuit
from motion_plan.planar_types import Point, Pose, Regions
from motion_plan.surroundings import Surroundings, axle_of
from motion_plan.wall_guard import ESCAPE_RADIUS

LOG = logging.getLogger(__name__)


class State(Enum):
    """What the robot is doing; the values are published on bug2/state."""

    GO_TO_POINT = 'go_to_point'
    WALL_FOLLOWING = 'wall_following'
    GOAL_REACHED = 'goal_reached'
    GOAL_UNREACHABLE = 'goal_unreachable'


#: Descriptions for the log line; the first two are those of the report.
STATE_DESCRIPTIONS = {State.GO_TO_POINT: 'Go to point', State.WALL_FOLLOWING: 'wall following',
                      State.GOAL_REACHED: 'goal reached', State.GOAL_UNREACHABLE: 'goal unreachable'}
LEAVE_RULES = ('complete', 'report')

#: Distance from the goal at which go_to_point stops [m], with a margin for measurement.
REACHED_DISTANCE = 0.31
#: The robot is at rest when it is slower than this [m/s, rad/s] for this time [s].
REST_SPEED = 0.02
REST_TIME = 0.5
#: Half-width of the m-line [m].
LINE_TOLERANCE = 0.1
#: Start and goal nearer than this are the same point [m].
SAME_POINT = 1e-6

# the report's rule
REPORT_LOOPS_A_SECOND = 20
REPORT_SECONDS = 5
REPORT_FRONT = (0.15, 1.0)

# the complete rule
#: Radius of the disc around the axle for which the path to the goal must be free while driving, and when leaving [m].
HIT_RADIUS = 0.52
LEAVE_RADIUS = 0.55
#: The path is obstructed when the disc can travel less than HIT_TRAVEL [m] + HIT_TIME [s] times the speed; at full
#: speed and head-on that is 1 m before the laser. A robot at rest first turns to the goal and then sees the next
#: obstacle ahead, so a free path only a little longer than the first part is a reason to leave the wall.
HIT_TRAVEL = 0.35
HIT_TIME = 0.55
LEAVE_TRAVEL = 0.45
#: Maximum speed towards the goal [m/s]; the robot travels this much farther for each second of a scan's age.
APPROACH_SPEED = 0.6
#: The path to the goal ends where go_to_point stops [m].
STOP_SHORT = 0.28
#: The leave point must be nearer to the goal than the hit point by this distance [m].
LEAVE_MARGIN = 0.2
#: The robot passes the goal while following a wall: near enough to stop within 0.3 m [m]; number of attempts.
AT_GOAL = 0.27
AT_GOAL_TRIES = 5
#: A circuit that closes without passing the hit point went through a gap that was first regarded as closed. Then the
#: m-line is defined again from there, at most this number of times.
NEW_LINES = 3
#: Without a wall within this distance [m] for this time [s] there is no wall to follow.
LOST_WALL_DISTANCE = 2.0
LOST_WALL_TIME = 1.0
#: A robot that travels less than this distance [m] in this time [s] while following a wall is stuck.
STUCK = ((0.3, 45.0), (2.0, 150.0))


def distance_to_line(point: Sequence[float], start: Point, goal: Point) -> float:
    """Return the distance [m] of ``point`` from the infinite line through ``start`` and ``goal``, each (x, y) [m].

    Formula as in the report: ``|(y2-y1) x0 - (x2-x1) y0 + x2 y1 - y2 x1| / sqrt((y2-y1)^2 + (x2-x1)^2)``.

    Parameters
    ----------
    point : sequence of float
        x, y [m]; more values are ignored.
    start, goal : (float, float)
        x, y [m].
    """
    up_eq = math.fabs(_line_value(point, start, goal))
    lo_eq = math.sqrt(pow(goal[1] - start[1], 2) + pow(goal[0] - start[0], 2))
    return up_eq / lo_eq


def _line_value(point: Sequence[float], start: Sequence[float], goal: Point) -> float:
    return (goal[1] - start[1]) * point[0] - (goal[0] - start[0]) * point[1] \
        + (goal[0] * start[1]) - (goal[1] * start[0])


class SwitchRule(abc.ABC):
    """When Bug 2 changes between driving to the goal and following a wall."""

    @abc.abstractmethod
    def begin(self, now: float, pose: Pose) -> None:
        """A state was entered.

        Parameters
        ----------
        now : float
            ROS time [s].
        pose : (float, float, float)
            x, y [m] and yaw [rad] of link_chassis, odometry frame.
        """

    def end_turn(self) -> None:
        """One period of the 20 Hz loop has ended."""

    @abc.abstractmethod
    def hit(self, pose: Pose, speed: Tuple[float, float], regions: Regions, surroundings: Surroundings,
            scan_age: float) -> Optional[str]:
        """Return why the wall must be followed, or None.

        Parameters
        ----------
        pose : (float, float, float)
            x, y [m] and yaw [rad] of link_chassis, odometry frame.
        speed : (float, float)
            Forward [m/s] and angular [rad/s].
        regions : dict
            Least range [m] of each laser sector.
        surroundings : Surroundings
            Points of recent scans.
        scan_age : float
            Age of the newest scan [s].
        """

    @abc.abstractmethod
    def leave(self, now: float, pose: Pose, surroundings: Surroundings) -> Optional[str]:
        """Return why the wall can be left, or None.

        Parameters
        ----------
        now : float
            ROS time [s].
        pose : (float, float, float)
            x, y [m] and yaw [rad] of link_chassis, odometry frame.
        surroundings : Surroundings
            Points of recent scans.
        """

    def unreachable(self, now: float, pose: Pose) -> Optional[str]:
        """Return why the goal cannot be reached, or None; must be called in every period of wall following.

        Parameters
        ----------
        now : float
            ROS time [s].
        pose : (float, float, float)
            x, y [m] and yaw [rad] of link_chassis, odometry frame.
        """
        return None

    def new_line(self) -> Optional[Point]:
        """Return the start (x, y) of a newly defined m-line, once; otherwise None."""
        return None


class ReportRule(SwitchRule):
    """The rule as printed: an obstacle ahead; after five counted seconds, the line anywhere. It never gives up."""

    def __init__(self, start: Point, goal: Point) -> None:
        self._start, self._goal = start, goal
        self._loops = 0
        self._seconds = 0

    def begin(self, now: float, pose: Pose) -> None:
        self._seconds = 0

    def end_turn(self) -> None:
        """Count one period of the 20 Hz loop; twenty are a second."""
        self._loops += 1
        if self._loops == REPORT_LOOPS_A_SECOND:
            self._seconds += 1
            self._loops = 0

    def hit(self, pose: Pose, speed: Tuple[float, float], regions: Regions, surroundings: Surroundings,
            scan_age: float) -> Optional[str]:
        if REPORT_FRONT[0] < regions['front'] < REPORT_FRONT[1]:
            return 'obstacle %.2f m ahead' % regions['front']
        return None

    def leave(self, now: float, pose: Pose, surroundings: Surroundings) -> Optional[str]:
        distance = distance_to_line(pose, self._start, self._goal)
        if self._seconds > REPORT_SECONDS and distance < LINE_TOLERANCE:
            return 'on the line'
        return None


class CompleteRule(SwitchRule):
    """The textbook's rule: leave only on the m-line, nearer to the goal than the hit point, with a free path."""

    def __init__(self, start: Point, goal: Point) -> None:
        self._start, self._goal = start, goal
        self._circuit = Circuit()
        self._hit_distance = math.inf
        self._too_close = False
        self._line_side = 0.0
        self._wall_seen = 0.0
        self._anchors: List[Tuple[float, float, float]] = []
        self._tries_at_goal = 0
        self._new_lines = 0
        self._new_start: Optional[Point] = None

    def begin(self, now: float, pose: Pose) -> None:
        self._circuit = Circuit()
        self._hit_distance = self._goal_distance(pose)
        self._line_side = _line_value(pose, self._start, self._goal)
        self._wall_seen = now
        self._anchors = [(now, pose[0], pose[1])] * len(STUCK)

    def hit(self, pose: Pose, speed: Tuple[float, float], regions: Regions, surroundings: Surroundings,
            scan_age: float) -> Optional[str]:
        self._too_close = False
        if surroundings.nearest(*axle_of(pose))[0] < ESCAPE_RADIUS:
            self._too_close = True
            return 'an obstacle is too close to turn'
        reach = HIT_TRAVEL + HIT_TIME * abs(speed[0]) + APPROACH_SPEED * max(0.0, scan_age - 0.1)
        if not self._way_free(pose, surroundings, HIT_RADIUS, reach):
            return 'the path to the goal is obstructed'
        return None

    def leave(self, now: float, pose: Pose, surroundings: Surroundings) -> Optional[str]:
        crossed = self._crossed_line(pose)
        nearest = surroundings.nearest(*axle_of(pose))[0]
        if nearest < LOST_WALL_DISTANCE:
            self._wall_seen = now
        if self._too_close:
            if nearest < HIT_RADIUS:
                return None
            if self._way_free(pose, surroundings, HIT_RADIUS, HIT_TRAVEL):
                return 'clear of the obstacle again'
            self._too_close = False
            self.begin(now, pose)
            return None
        distance = self._goal_distance(pose)
        if distance < AT_GOAL and self._tries_at_goal < AT_GOAL_TRIES:
            self._tries_at_goal += 1
            return 'at the goal'
        if not self._way_free(pose, surroundings, LEAVE_RADIUS, LEAVE_TRAVEL):
            return None
        if now - self._wall_seen > LOST_WALL_TIME:
            return 'there is no wall any more'
        if crossed and distance < self._hit_distance - LEAVE_MARGIN:
            return 'on the m-line, %.2f m nearer to the goal than the hit point' % (self._hit_distance - distance)
        return None

    def unreachable(self, now: float, pose: Pose) -> Optional[str]:
        for index, (distance, time) in enumerate(STUCK):
            since, x, y = self._anchors[index]
            if math.hypot(pose[0] - x, pose[1] - y) > distance:
                self._anchors[index] = (now, pose[0], pose[1])
            elif now - since > time:
                return 'the robot has moved less than %.1f m from (%.2f, %.2f) in %.0f s' % (distance, x, y, time)
        if self._circuit.add(pose):
            if self._new_lines < NEW_LINES and not self._circuit.passes_start(pose):
                self._new_lines += 1
                self._start = self._new_start = (pose[0], pose[1])
                self.begin(now, pose)
                self._hit_distance += LEAVE_MARGIN
                return None
            return 'went round the obstacle (%.1f m) without a point to leave it' % self._circuit.length
        return None

    def new_line(self) -> Optional[Point]:
        start, self._new_start = self._new_start, None
        return start

    def _goal_distance(self, pose: Pose) -> float:
        return math.hypot(self._goal[0] - pose[0], self._goal[1] - pose[1])

    def _crossed_line(self, pose: Pose) -> bool:
        """On the m-line, or across it since the last period."""
        side = _line_value(pose, self._start, self._goal)
        crossed = side * self._line_side < 0.0
        self._line_side = side
        return crossed or distance_to_line(pose, self._start, self._goal) < LINE_TOLERANCE

    def _way_free(self, pose: Pose, surroundings: Surroundings, radius: float, reach: float) -> bool:
        x, y = axle_of(pose)
        needed = min(reach, self._goal_distance(pose) - STOP_SHORT)
        if needed <= 0.0:
            return True
        direction = math.atan2(self._goal[1] - y, self._goal[0] - x)
        return surroundings.free_travel(x, y, [direction], radius)[0][0] >= needed


class Bug2:
    """The switch between going to the point and following the wall.

    Attributes
    ----------
    state : State
    reason : str
        Why the state was entered.
    line_start : (float, float)
        Start of the m-line: ``start``, unless the complete rule had to define it again.
    hit_point, leave_point : (float, float) or None
        The newest ones.

    Parameters
    ----------
    start, goal : (float, float)
        Ends of the m-line, odometry frame [m].
    leave_rule : str
        'complete' or 'report'.

    Raises
    ------
    ValueError
        If a coordinate is not finite, start and goal are the same point, or the rule is unknown.
    """

    def __init__(self, start: Point, goal: Point, leave_rule: str = 'complete') -> None:
        if not all(math.isfinite(value) for value in tuple(start) + tuple(goal)):
            raise ValueError('start %s, goal %s: expected finite coordinates' % (tuple(start), tuple(goal)))
        if math.hypot(goal[0] - start[0], goal[1] - start[1]) < SAME_POINT:
            raise ValueError('start and goal are the same point (%s, %s): there is no line between them to follow'
                             % tuple(goal))
        if leave_rule not in LEAVE_RULES:
            raise ValueError('leave_rule "%s": expected one of %s' % (leave_rule, ', '.join(LEAVE_RULES)))
        self.start: Point = (start[0], start[1])
        self.goal: Point = (goal[0], goal[1])
        self.leave_rule = leave_rule
        self.restart()

    def restart(self) -> None:
        """Begin again with the same start and goal."""
        self.state = State.GO_TO_POINT
        self.line_start = self.start
        self.reason = ''
        self.hit_point: Optional[Point] = None
        self.leave_point: Optional[Point] = None
        self._rule: SwitchRule = (CompleteRule if self.leave_rule == 'complete' else ReportRule)(self.start, self.goal)
        self._rest_since: Optional[float] = None

    @property
    def finished(self) -> bool:
        """True once the goal was reached or found unreachable."""
        return self.state in (State.GOAL_REACHED, State.GOAL_UNREACHABLE)

    def distance_to_line(self, point: Sequence[float]) -> float:
        """Return the distance [m] of ``point`` from the m-line."""
        return distance_to_line(point, self.line_start, self.goal)

    def distance_to_goal(self, point: Sequence[float]) -> float:
        """Return the distance [m] of ``point`` from the goal."""
        return math.hypot(self.goal[0] - point[0], self.goal[1] - point[1])

    def update(self, now: float, pose: Pose, regions: Regions, surroundings: Surroundings,
               speed: Tuple[float, float] = (0.0, 0.0), scan_age: float = 0.0) -> State:
        """Run one period of the 20 Hz loop.

        Parameters
        ----------
        now : float
            Time [s].
        pose : (float, float, float)
            x, y [m], yaw [rad] of link_chassis in the odometry frame.
        regions : dict of str to float
            Sector minima [m] (see `motion_plan.regions`).
        surroundings : motion_plan.surroundings.Surroundings
            Obstacles seen; the only sensor input of the complete rule.
        speed : (float, float)
            Measured linear_x [m/s] and angular_z [rad/s].
        scan_age : float
            Time since the newest scan was taken [s].

        Returns
        -------
        State
            The state after this period; a change is also in `hit_point`, `leave_point` and `reason`.
        """
        if self.finished:
            return self.state
        if self.state is State.GO_TO_POINT:
            if self._at_rest_at_goal(now, pose, speed):
                self._enter(State.GOAL_REACHED, now, pose, '%.2f m from the goal' % self.distance_to_goal(pose))
                return self.state
            reason = self._rule.hit(pose, speed, regions, surroundings, scan_age)
            if reason:
                self.hit_point = (pose[0], pose[1])
                self._enter(State.WALL_FOLLOWING, now, pose, reason)
        else:
            leave = self._rule.leave(now, pose, surroundings)
            unreachable = None if leave else self._rule.unreachable(now, pose)
            if leave:
                self.leave_point = (pose[0], pose[1])
                self._enter(State.GO_TO_POINT, now, pose, leave)
            elif unreachable:
                self._enter(State.GOAL_UNREACHABLE, now, pose, unreachable)
            start = self._rule.new_line()
            if start is not None:
                self.line_start = start
                LOG.warning('the circuit closed, but not at the hit point; continuing along a new m-line from '
                            '(%.2f, %.2f)', *start)
        self._rule.end_turn()
        return self.state

    def _enter(self, state: State, now: float, pose: Pose, reason: str) -> None:
        self.state, self.reason = state, reason
        self._rest_since = None
        self._rule.begin(now, pose)

    def _at_rest_at_goal(self, now: float, pose: Pose, speed: Tuple[float, float]) -> bool:
        resting = self.distance_to_goal(pose) <= REACHED_DISTANCE and max(abs(speed[0]), abs(speed[1])) < REST_SPEED
        if not resting:
            self._rest_since = None
            return False
        if self._rest_since is None:
            self._rest_since = now
        return now - self._rest_since >= REST_TIME

# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories of joints: polynomials between the points of a trajectory_msgs/JointTrajectory."""
from __future__ import annotations

import bisect
import math
from typing import Any, List, NamedTuple, Optional, Sequence, Tuple

#: Longest trajectory that is accepted: an hour at 100 Hz is 360 000 points.
MOST_POINTS = 1000000


class TrajectoryError(Exception):
    """A trajectory cannot be followed; the text says why."""


class State(NamedTuple):
    """Positions [rad or m], velocities and accelerations of all joints."""

    positions: Tuple[float, ...]
    velocities: Tuple[float, ...]
    accelerations: Tuple[float, ...]


class _Knot(NamedTuple):
    """A point: its time [s] and what it prescribes for each joint; empty: nothing."""

    time: float
    positions: Sequence[float]
    velocities: Sequence[float]
    accelerations: Sequence[float]


class Segment:
    """The polynomials of all joints between two times.

    With positions only it is linear, with velocities cubic, with accelerations quintic.

    Parameters
    ----------
    first, last : _Knot
    """

    def __init__(self, first: _Knot, last: _Knot) -> None:
        self.start, self.end = first.time, last.time
        span = max(last.time - first.time, 1e-9)
        self._rows = []
        for index, (begin, end) in enumerate(zip(first.positions, last.positions)):
            if first.accelerations and last.accelerations and first.velocities and last.velocities:
                row = _quintic(begin, first.velocities[index], first.accelerations[index], end,
                               last.velocities[index], last.accelerations[index], span)
            elif first.velocities and last.velocities:
                row = _cubic(begin, first.velocities[index], end, last.velocities[index], span)
            else:
                row = (begin, (end - begin) / span, 0.0, 0.0, 0.0, 0.0)
            self._rows.append(row)

    def sample(self, time: float) -> State:
        """Return the state at a time [s]; before and after the segment the joints rest at its ends."""
        inside = self.start <= time <= self.end
        t = min(max(time, self.start), self.end) - self.start
        positions, velocities, accelerations = [], [], []
        for a, b, c, d, e, f in self._rows:
            positions.append(a + t * (b + t * (c + t * (d + t * (e + t * f)))))
            velocities.append(b + t * (2 * c + t * (3 * d + t * (4 * e + t * 5 * f))) if inside else 0.0)
            accelerations.append(2 * c + t * (6 * d + t * (12 * e + t * 20 * f)) if inside else 0.0)
        return State(tuple(positions), tuple(velocities), tuple(accelerations))


def _cubic(p0: float, v0: float, p1: float, v1: float, t: float) -> Tuple[float, ...]:
    """Return the coefficients of the cubic with these ends, in ascending order."""
    return (p0, v0, (3 * (p1 - p0) / t - 2 * v0 - v1) / t, (2 * (p0 - p1) / t + v0 + v1) / (t * t), 0.0, 0.0)


def _quintic(p0: float, v0: float, a0: float, p1: float, v1: float, a1: float, t: float) -> Tuple[float, ...]:
    """Return the coefficients of the quintic with these ends, in ascending order."""
    step = p1 - p0
    return (p0, v0, 0.5 * a0,
            (20 * step - (8 * v1 + 12 * v0) * t - (3 * a0 - a1) * t ** 2) / (2 * t ** 3),
            (-30 * step + (14 * v1 + 16 * v0) * t + (3 * a0 - 2 * a1) * t ** 2) / (2 * t ** 4),
            (12 * step - 6 * (v1 + v0) * t + (a1 - a0) * t ** 2) / (2 * t ** 5))


class Trajectory:
    """Segments in the order of time; before the first one the previous trajectory continues.

    Parameters
    ----------
    segments : list of Segment
        At least one.
    previous : Trajectory, optional
    """

    def __init__(self, segments: List[Segment], previous: Optional[Trajectory] = None) -> None:
        self._segments, self._previous = segments, previous
        self._starts = [segment.start for segment in segments]
        self.end = segments[-1].end

    def sample(self, time: float) -> State:
        """Return the state at a time [s]."""
        if self._previous is not None and time < self._starts[0]:
            return self._previous.sample(time)
        return self._segments[max(0, bisect.bisect_right(self._starts, time) - 1)].sample(time)

    def forget(self, time: float) -> None:
        """Release the previous trajectory once its time [s] is over."""
        if self._previous is not None and time >= self._starts[0]:
            self._previous = None


def hold(positions: Sequence[float], time: float) -> Trajectory:
    """Return the trajectory that stays at these positions [rad or m] from a time [s] on.

    Parameters
    ----------
    positions : sequence of float
        [rad or m]
    time : float
        [s]
    """
    knot = _Knot(time, tuple(positions), (), ())
    return Trajectory([Segment(knot, knot)])


def stop(state: State, time: float, duration: float) -> Trajectory:
    """Return the trajectory that comes to rest within ``duration`` [s], from a state at a time [s].

    Parameters
    ----------
    state : State
    time : float
        [s]
    duration : float
        [s]
    """
    if duration <= 0.0:
        return hold(state.positions, time)
    zeros = (0.0,) * len(state.positions)
    end = tuple(position + 0.5 * duration * rate for position, rate in zip(state.positions, state.velocities))
    return Trajectory([Segment(_Knot(time, state.positions, state.velocities, ()), _Knot(time + duration, end, zeros,
                                                                                         ()))])


def follow(message: Any, names: Sequence[str], continuous: Sequence[bool], now: float, current: Trajectory,
           partial: bool = False) -> Tuple[Trajectory, str]:
    """Return the trajectory of a message, joined to the one that is being followed.

    Parameters
    ----------
    message : trajectory_msgs/JointTrajectory
    names : sequence of str
        The controller's joints.
    continuous : sequence of bool
        Which of them have no position limits; whole turns are added so that their way is short.
    now : float
        Time [s].
    current : Trajectory
    partial : bool
        Whether joints may be missing; they stay where they are.

    Returns
    -------
    trajectory : Trajectory
    remark : str
        About points that were dropped because their time is over; empty if there are none.

    Raises
    ------
    TrajectoryError
        If it cannot be followed.
    """
    order = _order(list(message.joint_names), names, partial)
    knots, begin = _knots(message, order, current, now)
    late = [knot for knot in knots if knot.time <= now]
    knots = knots[len(late):]
    if not knots:
        raise TrajectoryError("Dropping all %d trajectory point(s), as they occur before the current time. Last point "
                              "is %.6f s in the past." % (len(late), now - late[-1].time))
    at = max(begin, now)
    state = current.sample(at)
    shift = [math.tau * round((here - there) / math.tau) if endless else 0.0
             for here, there, endless in zip(state.positions, knots[0].positions, continuous)]
    if any(shift):
        knots = [knot._replace(positions=[a + b for a, b in zip(knot.positions, shift)]) for knot in knots]
    chain = [_Knot(at, state.positions, state.velocities, state.accelerations), *knots]
    segments = [Segment(first, last) for first, last in zip(chain, chain[1:])]
    remark = "" if not late else ("Dropping first %d trajectory point(s) out of %d, as they occur before the current "
                                  "time." % (len(late), len(late) + len(knots)))
    return Trajectory(segments, current), remark


def _order(given: Sequence[str], names: Sequence[str], partial: bool) -> List[Optional[int]]:
    """Return for each joint of the controller its index in the message, or None."""
    unknown = sorted(set(given) - set(names))
    missing = sorted(set(names) - set(given))
    if len(set(given)) != len(given) or not given or unknown or (missing and not partial):
        raise TrajectoryError("Joints on incoming goal don't match the controller joints. Read %s; expected %s"
                              % (", ".join(given) or "no joint", ", ".join(names)))
    return [list(given).index(name) if name in given else None for name in names]


def _knots(message: Any, order: Sequence[Optional[int]], current: Trajectory, now: float) -> Tuple[List[_Knot], float]:
    """Return the points in the order of the controller's joints, and the time at which the trajectory begins [s]."""
    if not 0 < len(message.points) <= MOST_POINTS:
        raise TrajectoryError("Trajectory has %d points; expected 1 to %d" % (len(message.points), MOST_POINTS))
    begin = _seconds(message.header.stamp) or now
    rest = current.sample(now).positions
    count, knots, last = len(message.joint_names), [], -math.inf
    for number, point in enumerate(message.points):
        time = begin + _seconds(point.time_from_start)
        if not time > last:
            raise TrajectoryError("Trajectory message contains waypoints that are not strictly increasing in time. "
                                  "Point %d is at %g s" % (number, time - begin))
        last = time
        lists = [list(values) for values in (point.positions, point.velocities, point.accelerations)]
        if len(lists[0]) != count or any(len(values) not in (0, count) for values in lists[1:]):
            raise TrajectoryError("Size mismatch in trajectory point %d: read %d positions, %d velocities and %d "
                                  "accelerations; expected %d positions, and 0 or %d of the others"
                                  % (number, *map(len, lists), count, count))
        if not all(math.isfinite(value) for values in lists for value in values):
            raise TrajectoryError("Trajectory point %d holds a number that is not finite" % number)
        knots.append(_Knot(time, [rest[here] if there is None else lists[0][there] for here, there in enumerate(order)],
                           *([0.0 if there is None else values[there] for there in order] if values else []
                             for values in lists[1:])))
    return knots, begin


def _seconds(time: Any) -> float:
    """Return a time or duration of a message [s]."""
    return float(time.secs) + 1e-9 * float(time.nsecs)

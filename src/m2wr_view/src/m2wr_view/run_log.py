# SPDX-License-Identifier: BSD-3-Clause
"""A finished run as arrays, read from the bag it was recorded into."""
from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.bag_file import check_types, messages_of, open_bag
from m2wr_view.errors import ViewError
from m2wr_view.frames import yaw_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

ODOMETRY, CLOCK, DIAGNOSTICS = "/odom", "/clock", "/diagnostics"
STATE, HIT, LEAVE, LINE = "/bug2/state", "/bug2/hit_point", "/bug2/leave_point", "/bug2/m_line"
TYPES = {ODOMETRY: "nav_msgs/Odometry", CLOCK: "rosgraph_msgs/Clock", DIAGNOSTICS: "diagnostic_msgs/DiagnosticArray",
         STATE: "std_msgs/String", HIT: "geometry_msgs/PointStamped", LEAVE: "geometry_msgs/PointStamped",
         LINE: "nav_msgs/Path"}
SIMULATION_STATUS = "m2wr_sim: simulation"
FIRST_STATE = "go_to_point"
JUMP = 0.5          # m between two samples; more means that the robot was placed there and did not drive


class _Entry(NamedTuple):
    recorded: float         # the recorder's time [s], simulated or not
    message: Any


class Drive(NamedTuple):
    """Simulated times [s], x, y [m] and yaw [rad] of link_chassis in the odometry frame, each (n,)."""

    times: FloatArray
    x: FloatArray
    y: FloatArray
    yaw: FloatArray


@dataclass(frozen=True)
class RunLog:
    """One run.  What was not recorded is None.

    Attributes
    ----------
    path : str
        The bag.
    times, x, y, yaw : (n,) float64 or None
        Simulated time [s] and pose of link_chassis in the odometry frame [m, rad] since the run began.
    states : tuple of (float, str) or None
        Simulated time [s] and name of each state that differs from the one before.
    hit_points, leave_points : (k, 2) float64 or None
        Hit and leave points of Bug 2 [m].
    contacts : int or None
        Number of contacts that the robot began, as last published on /diagnostics.
    mean_factor : float or None
        Simulated seconds per second over the whole run.
    start, goal : (float, float) or None
        Ends of the line to follow [m].
    """

    path: str
    times: Optional[FloatArray] = None
    x: Optional[FloatArray] = None
    y: Optional[FloatArray] = None
    yaw: Optional[FloatArray] = None
    states: Optional[Tuple[Tuple[float, str], ...]] = None
    hit_points: Optional[FloatArray] = None
    leave_points: Optional[FloatArray] = None
    contacts: Optional[int] = None
    mean_factor: Optional[float] = None
    start: Optional[Tuple[float, float]] = None
    goal: Optional[Tuple[float, float]] = None

    @property
    def drive(self) -> Optional[Drive]:
        """The poses of the run; None without odometry."""
        if self.times is None or self.x is None or self.y is None or self.yaw is None:
            return None
        return Drive(self.times, self.x, self.y, self.yaw)


def read_run(path: str, start: Optional[Tuple[float, float]] = None, goal: Optional[Tuple[float, float]] = None,
             robot: str = "m2wr") -> RunLog:
    """Read a recorded run.

    The run begins with the first ``go_to_point`` on /bug2/state, or after the last jump of more than 0.5 m between two
    samples of /odom, whichever is later.  So falling to the ground and moving to the start pose are not part of it.
    If the time stamps of /odom go back, the world was reset: only what follows is read.

    Parameters
    ----------
    path : str
        A finished bag.
    start, goal : (float, float), optional
        Ends of the line to follow [m]; default: the ends of /bug2/m_line.
    robot : str
        Name of the model whose contacts count.

    Returns
    -------
    RunLog

    Raises
    ------
    ViewError
        If there is no such bag, or it is unfinished, broken or empty, or a topic has an unexpected type.
    """
    path = os.fspath(path)
    topics = _read_topics(path)
    samples, recorded = _odometry(topics)
    if samples is not None and recorded is not None and len(samples) < len(topics[ODOMETRY]):
        for topic in (STATE, HIT, LEAVE):
            topics[topic] = [entry for entry in topics.get(topic, ()) if entry.recorded >= recorded[0]]
    states = _states(topics, _to_simulated(topics, samples, recorded))
    line = [(pose.pose.position.x, pose.pose.position.y) for pose in topics[LINE][-1].message.poses] \
        if topics.get(LINE) else []
    times, x, y, yaw = (None,) * 4 if samples is None else _driven(samples, states)
    contacts, factor = _diagnosis(topics, robot, path)
    return RunLog(path, times, x, y, yaw, states, _points(topics, HIT), _points(topics, LEAVE), contacts, factor,
                  _pair(start) or (line[0] if line else None), _pair(goal) or (line[-1] if line else None))


def _read_topics(path: str) -> Dict[str, List[_Entry]]:
    """Return the messages of the topics of interest, in the order of the recorder's time."""
    with open_bag(path) as bag:
        if not bag.get_message_count():
            raise ViewError("bag %s: it has no messages; expected a recorded run" % path)
        check_types(bag, path, TYPES)
        topics: Dict[str, List[_Entry]] = {}
        for topic, message, recorded in messages_of(bag, path, [name for name in TYPES if name != CLOCK]):
            topics.setdefault(topic, []).append(_Entry(recorded.to_sec(), message))
        if ODOMETRY not in topics:      # the clock has many messages: read only if needed
            topics[CLOCK] = [_Entry(recorded.to_sec(), message)
                             for _, message, recorded in messages_of(bag, path, [CLOCK])]
        return topics


def _odometry(topics: Dict[str, List[_Entry]]) -> Tuple[Optional[FloatArray], Optional[FloatArray]]:
    """Return samples (n, 4) of simulated time, x, y, yaw and the recorder's times (n,), since the last reset."""
    if not topics.get(ODOMETRY):
        return None, None
    samples = np.empty((len(topics[ODOMETRY]), 4))
    for row, entry in zip(samples, topics[ODOMETRY]):
        pose, turn = entry.message.pose.pose.position, entry.message.pose.pose.orientation
        row[:] = (entry.message.header.stamp.to_sec(), pose.x, pose.y, yaw_of((turn.x, turn.y, turn.z, turn.w)))
    recorded = np.array([entry.recorded for entry in topics[ODOMETRY]])
    back = np.flatnonzero(np.diff(samples[:, 0]) < 0.0)
    first = back[-1] + 1 if len(back) else 0
    return samples[first:], recorded[first:]


def _to_simulated(topics: Dict[str, List[_Entry]], samples: Optional[FloatArray],
                  recorded: Optional[FloatArray]) -> Callable[[float], float]:
    """Return a function from the recorder's time to simulated time, for messages without a stamp of their own."""
    if samples is not None and recorded is not None:
        before, after = recorded, samples[:, 0]
        return lambda time: float(np.interp(time, before, after))
    if topics.get(CLOCK):
        clock = np.array([(entry.recorded, entry.message.clock.to_sec()) for entry in topics[CLOCK]])
        return lambda time: float(np.interp(time, clock[:, 0], clock[:, 1]))
    return float


def _states(topics: Dict[str, List[_Entry]],
            simulated: Callable[[float], float]) -> Optional[Tuple[Tuple[float, str], ...]]:
    if not topics.get(STATE):
        return None
    states: List[Tuple[float, str]] = []
    for recorded, message in topics[STATE]:
        if not states or states[-1][1] != message.data:
            states.append((simulated(recorded), message.data))
    return tuple(states)


def _driven(samples: FloatArray, states: Optional[Tuple[Tuple[float, str], ...]]) -> Tuple[FloatArray, ...]:
    """Return times, x, y, yaw of the samples that belong to the run."""
    began = next((time for time, name in states or () if name == FIRST_STATE), -math.inf)
    first = min(int(np.searchsorted(samples[:, 0], began)), len(samples) - 1)
    jumps = np.flatnonzero(np.hypot(np.diff(samples[:, 1]), np.diff(samples[:, 2])) > JUMP)
    if len(jumps):
        first = max(first, jumps[-1] + 1)
    return tuple(np.ascontiguousarray(column) for column in samples[first:].T)


def _points(topics: Dict[str, List[_Entry]], topic: str) -> Optional[FloatArray]:
    if not topics.get(topic):
        return None
    return np.array([(entry.message.point.x, entry.message.point.y) for entry in topics[topic]])


def _diagnosis(topics: Dict[str, List[_Entry]], robot: str, path: str) -> Tuple[Optional[int], Optional[float]]:
    """Return the number of contacts and the mean real-time factor from the simulation's last status."""
    found = [status for entry in topics.get(DIAGNOSTICS, ()) for status in entry.message.status
             if status.name == SIMULATION_STATUS]
    if not found:
        return None, None
    values = {pair.key: pair.value for pair in found[-1].values}
    contacts, factor = values.get("touches of " + robot, "0"), values.get("mean real-time factor")
    try:        # a model without contacts is not listed
        return int(contacts), None if factor is None else float(factor)
    except ValueError:
        raise ViewError("bag %s: status \"%s\" on %s has \"%s\" contacts of %s and the mean real-time factor \"%s\"; "
                        "expected numbers" % (path, SIMULATION_STATUS, DIAGNOSTICS, contacts, robot, factor)) from None


def _pair(point: Optional[Sequence[float]]) -> Optional[Tuple[float, float]]:
    return None if point is None else (float(point[0]), float(point[1]))

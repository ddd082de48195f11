# SPDX-License-Identifier: BSD-3-Clause
"""Checks transforms and scans of a running robot: complete, one publisher each, with stamps of the present time."""
from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, NamedTuple, Optional, Set, Tuple

from m2wr_tools.doctor.finding import ok, problem, some, warning

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.graph import Graph

_FRAMES, _TOPICS = "frames", "topics"
_LISTEN = 2.5               # s of wall time
_AHEAD, _BEHIND = 0.5, 2.0  # s between a stamp and the clock, above which it is reported; tf drops what is ahead
_STILL = 0.001              # s; a clock that advances less is stopped


class Edge(NamedTuple):
    """One transform.

    ``senders``: names of nodes; ``newest``: stamp less clock at its arrival [s], None for a static one.
    """

    senders: Set[str]
    newest: Optional[float]
    static: bool


@dataclass(frozen=True)
class Stream:
    """Messages of a topic.

    ``frames``: {(frame, child frame or None)}; ``ages``: clock less stamp of each message [s].
    """

    count: int
    frames: Set[Tuple[str, Optional[str]]]
    ages: List[float]


class Seen(NamedTuple):
    """What a :class:`Listener` received.

    ``edges``: {(parent, child): Edge}; ``scans``, ``odometry``: {topic: Stream}; ``clock``: its first and last time
    [s], None without one; ``links``: those of robot_description.
    """

    edges: Dict[Tuple[str, str], Edge]
    scans: Dict[str, Stream]
    odometry: Dict[str, Stream]
    clock: Optional[Tuple[float, float]]
    links: List[str]


class Listener:
    """Listens to a running system for a moment; starts a node, so it can be made only once in a process."""

    def __init__(self, graph: Graph) -> None:
        import rospy
        from nav_msgs.msg import Odometry
        from rosgraph_msgs.msg import Clock
        from sensor_msgs.msg import LaserScan
        from tf2_msgs.msg import TFMessage
        self._rospy, self._lock = rospy, threading.Lock()
        self._edges: Dict[Tuple[str, str], Edge] = {}
        self._streams: Dict[str, List[Tuple[str, Optional[str], Optional[float]]]] = {}
        self._first: Optional[float] = None
        self._last: Optional[float] = None
        self._simulated = bool(graph.sim_time) and bool(graph.publishers.get("/clock"))
        rospy.init_node("doctor", anonymous=True, disable_rostime=True, disable_signals=True)
        rospy.rostime.switch_to_wallclock()
        self._scans = [name for name, kind in graph.types.items() if kind == "sensor_msgs/LaserScan"
                       and graph.publishers.get(name)]
        self._odometry = [name for name, kind in graph.types.items() if kind == "nav_msgs/Odometry"
                          and graph.publishers.get(name)]
        if self._simulated:
            rospy.Subscriber("/clock", Clock, self._tick, queue_size=100)
        for topic, static in (("/tf", False), ("/tf_static", True)):
            rospy.Subscriber(topic, TFMessage, self._transforms, static, queue_size=100)
        for topics, kind in ((self._scans, LaserScan), (self._odometry, Odometry)):
            for topic in topics:
                self._streams[topic] = []
                rospy.Subscriber(topic, kind, self._message, topic, queue_size=100)

    def _tick(self, message: Any) -> None:
        with self._lock:
            now = message.clock.to_sec()
            self._first = now if self._first is None else self._first
            self._last = now

    def _now(self) -> Optional[float]:
        return self._last if self._simulated else time.time()

    def _transforms(self, message: Any, static: bool) -> None:
        sender = (message._connection_header or {}).get("callerid", "?")
        with self._lock:
            now = self._now()
            for entry in message.transforms:
                pair = entry.header.frame_id.strip("/"), entry.child_frame_id.strip("/")
                senders = self._edges[pair].senders if pair in self._edges else set()
                lead = None if static or now is None else entry.header.stamp.to_sec() - now
                self._edges[pair] = Edge(senders | {sender}, lead, static)

    def _message(self, message: Any, topic: str) -> None:
        with self._lock:
            now = self._now()
            self._streams[topic].append((
                message.header.frame_id.strip("/"), getattr(message, "child_frame_id", "").strip("/") or None,
                None if now is None else now - message.header.stamp.to_sec()))

    def listen(self, seconds: float = _LISTEN) -> Seen:
        """Return what was received within some seconds of wall time."""
        time.sleep(seconds)
        try:
            text = self._rospy.get_param("/robot_description", "")
        except OSError:
            text = ""
        with self._lock:
            clock = None
            if self._simulated and self._first is not None and self._last is not None:
                clock = self._first, self._last
            return Seen(dict(self._edges), {name: self._stream(name) for name in self._scans},
                        {name: self._stream(name) for name in self._odometry}, clock, links_of(text))

    def _stream(self, topic: str) -> Stream:
        messages = self._streams[topic]
        return Stream(len(messages), {entry[:2] for entry in messages},
                      [entry[2] for entry in messages if entry[2] is not None])

    def close(self) -> None:
        """End the node."""
        self._rospy.signal_shutdown("done")


def links_of(text: str) -> List[str]:
    """Return the names of the links of a URDF; none if it cannot be read."""
    import xml.etree.ElementTree as ElementTree
    try:
        names = [link.get("name") for link in ElementTree.fromstring(text).findall("link")]
        return [name for name in names if name is not None]
    except (ElementTree.ParseError, TypeError):
        return []


def check(graph: Graph, seen: Seen) -> List[Finding]:
    """Return the findings on what was received.

    Parameters
    ----------
    graph : Graph
        What runs.
    seen : Seen
        What was received.
    """
    clock = _clock(graph, seen)
    standing = bool(clock) and clock[0].level != "ok"
    return clock + _scans(seen, standing) + _publishers(seen) + _tree(graph, seen) + _links(graph, seen) + _stamps(seen)


def _clock(graph: Graph, seen: Seen) -> List[Finding]:
    if not (graph.sim_time and graph.publishers.get("/clock")):
        return []
    if seen.clock is None or seen.clock[1] - seen.clock[0] < _STILL:
        return [warning(_TOPICS, "simulated time does not advance",
                        "it is paused (rosservice call /gazebo/unpause_physics), or waits in lockstep for a node that "
                        "its log names")]
    return [ok(_TOPICS, "simulated time advances: %.1f s in %.1f s", seen.clock[1] - seen.clock[0], _LISTEN)]


def _scans(seen: Seen, standing: bool) -> List[Finding]:
    if not seen.scans:
        return [warning(_TOPICS, "no node publishes a laser scan",
                        "spawn a robot that has a laser: roslaunch m2wr_description spawn.launch")]
    found = []
    for topic, stream in sorted(seen.scans.items()):
        if stream.count:
            found.append(ok(_TOPICS, "%s: %d scans in %.1f s, frame %s", topic, stream.count, _LISTEN,
                            some(frame for frame, _ in stream.frames)))
        elif not standing:
            found.append(problem(_TOPICS, "%s is advertised, but no scan is received" % topic,
                                 "read the log of its publisher, which names a plugin that failed"))
    return found


def _publishers(seen: Seen) -> List[Finding]:
    found = []
    for (parent, child), edge in sorted(seen.edges.items()):
        if len(edge.senders) > 1:
            found.append(problem(
                _FRAMES, "%s -> %s is published by %s: the robot jumps between them" % (
                    parent, child, some(edge.senders)),
                "stop one of them; a robot_state_publisher or static_transform_publisher that was started twice, or a "
                "drive plugin with publishTf beside another source of odometry"))
    parents: Dict[str, Set[str]] = {}
    for parent, child in seen.edges:
        parents.setdefault(child, set()).add(parent)
    for child, names in sorted(parents.items()):
        if len(names) > 1:
            senders = set().union(*(seen.edges[name, child].senders for name in names))
            found.append(problem(_FRAMES, "frame %s has %d parents, %s, from %s" % (
                child, len(names), some(names), some(senders)),
                "a frame has one parent: stop one of the publishers, or give each robot a tf_prefix"))
    return found


def _above(seen: Seen, frame: str) -> Set[str]:
    """Return a frame and all its ancestors, of all its parents."""
    found, waiting = {frame}, [frame]
    while waiting:
        child = waiting.pop()
        news = {parent for parent, other in seen.edges if other == child} - found
        found |= news
        waiting += news
    return found


def _tops(seen: Seen, frame: str) -> Set[str]:
    """Return the roots above a frame."""
    children = {child for _, child in seen.edges}
    return {name for name in _above(seen, frame) if name not in children}


def _frames(seen: Seen) -> Set[str]:
    return {frame for pair in seen.edges for frame in pair}


def _tree(graph: Graph, seen: Seen) -> List[Finding]:
    """Check that odometry and laser are in one tree."""
    found, frames = [], _frames(seen)
    wanted = {frame for stream in seen.scans.values() for frame, _ in stream.frames}
    odometry = {frame for stream in seen.odometry.values() for frame, _ in stream.frames}
    if wanted and _frames_unused(graph):
        return [ok(_FRAMES, "robot_state_publisher does not run, and nothing reads /tf; rviz and mapping need it: "
                            "roslaunch m2wr_description rvis.launch starts it with rviz")]
    if not frames:
        return [problem(_FRAMES, "there are no transforms", _start_publisher(graph))] if wanted else []
    for frame in sorted(wanted):
        if frame not in frames:
            found.append(problem(_FRAMES, "the laser's frame \"%s\" is not in any transform; frames: %s" % (
                frame, some(frames)), _start_publisher(graph)))
        elif odometry and not any(_above(seen, frame) & _above(seen, other) for other in odometry):
            found.append(problem(
                _FRAMES, "no transform from %s to the laser's frame %s: its tree ends at %s" % (
                    some(odometry), frame, some(_tops(seen, frame))), _start_publisher(graph)))
    if wanted and not found:
        found.append(ok(_FRAMES, "%s: transforms up to %s", some(wanted),
                        some(set().union(*(_tops(seen, frame) for frame in wanted)))))
    return found


def _publisher_runs(graph: Graph) -> bool:
    return any(name.endswith("robot_state_publisher") for names in graph.publishers.values() for name in names)


def _frames_unused(graph: Graph) -> bool:
    """Return whether no node needs frames of links: the robot was just spawned, and no node reads tf."""
    readers = {name for topic in ("/tf", "/tf_static") for name in graph.subscribers.get(topic, ())} - set(graph.silent)
    return not _publisher_runs(graph) and all(name.startswith("/doctor") for name in readers)


def _start_publisher(graph: Graph) -> str:
    if _publisher_runs(graph):
        return "robot_state_publisher runs: check that joint_states are published (rostopic hz /joint_states) " \
               "and that its robot_description is that of this robot"
    return "rosrun robot_state_publisher robot_state_publisher (it reads the parameter robot_description); roslaunch " \
           "m2wr_description rvis.launch starts it with rviz"


def _links(graph: Graph, seen: Seen) -> List[Finding]:
    """Check that every link of the description has a transform."""
    frames = _frames(seen)
    if len(seen.links) < 2 or not frames or _frames_unused(graph):
        return []
    missing = [link for link in seen.links if link not in frames
               and not any(frame.endswith("/" + link) for frame in frames)]
    if missing:
        return [warning(_FRAMES, "no transform for %s of robot_description; \"No transform\" in rviz" % some(missing),
                        "for wheels, joint_states must be published (rostopic hz /joint_states); for fixed links, "
                        "robot_state_publisher must run")]
    return [ok(_FRAMES, "all %d links of robot_description have transforms", len(seen.links))]


def _stamps(seen: Seen) -> List[Finding]:
    """Check the stamps. If simulated time runs faster than real time, messages may be older by that factor."""
    speed = max(1.0, (seen.clock[1] - seen.clock[0]) / _LISTEN) if seen.clock else 1.0
    ahead, behind, found = _AHEAD * speed, _BEHIND * speed, []
    for (parent, child), edge in sorted(seen.edges.items()):
        if edge.newest is not None and edge.newest > ahead:
            found.append(problem(_FRAMES, "%s -> %s of %s is stamped %.1f s in the future" % (
                parent, child, some(edge.senders), edge.newest), _CLOCKS))
        elif edge.newest is not None and edge.newest < -behind:
            found.append(warning(_FRAMES, "%s -> %s of %s is %.1f s old" % (
                parent, child, some(edge.senders), -edge.newest), _CLOCKS))
    for topic, stream in sorted(list(seen.scans.items()) + list(seen.odometry.items())):
        if stream.ages and not -ahead <= stream.ages[-1] <= behind:
            found.append(problem(_TOPICS, "%s is stamped %.1f s in the %s" % (
                topic, abs(stream.ages[-1]), "past" if stream.ages[-1] > 0 else "future"), _CLOCKS))
    return found


_CLOCKS = "that node has another clock: start it again after rosparam set /use_sim_time true (a simulation or a bag " \
          "with --clock) or false (a real robot)"

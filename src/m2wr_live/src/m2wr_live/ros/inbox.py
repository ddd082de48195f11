# SPDX-License-Identifier: BSD-3-Clause
"""Newest messages of the topics that pages show, kept as bytes until they are drawn."""
from __future__ import annotations

import functools
import logging
import struct
import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, List, Optional, Tuple

import numpy as np
import roslib.message
import rospy

from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.scene.robot_model import FindMesh, read_looks, read_robot_model
from m2wr_node.internals.paced_subscription import subscribe_paced
from m2wr_view.errors import ViewError

if TYPE_CHECKING:
    from m2wr_live.scene.robot_model import RobotModel
    from m2wr_view.solids import Solids

log = logging.getLogger("m2wr_live")

MOST_TOPICS = 200           # that are subscribed to
LARGEST = 1 << 26           # bytes of a message; larger ones are not read
MOST_PROBLEMS = 20          # visuals left out that are told
_EVERY = 500                # kept transforms, points and the like until the next picture
_NAMED = {"/clock": "rosgraph_msgs/Clock", "/tf": "tf2_msgs/TFMessage", "/tf_static": "tf2_msgs/TFMessage",
          "/gazebo/world_markers": "visualization_msgs/MarkerArray",
          "/gazebo/ground_markers": "visualization_msgs/MarkerArray",
          "/gazebo/visual_markers": "visualization_msgs/MarkerArray", "/robot_description": "std_msgs/String",
          "/gazebo/link_states": "gazebo_msgs/LinkStates", "/gazebo/robot_states": "gazebo_msgs/ModelStates",
          "/bug2/state": "std_msgs/String", "/bug2/hit_point": "geometry_msgs/PointStamped",
          "/bug2/leave_point": "geometry_msgs/PointStamped", "/diagnostics": "diagnostic_msgs/DiagnosticArray",
          "/best_path/scores": "diagnostic_msgs/DiagnosticArray", "/best_path/state": "std_msgs/String"}
#: Topics of which every message counts.
_ALL = ("/tf", "/tf_static", "/bug2/hit_point", "/bug2/leave_point", "/diagnostics", "map_msgs/OccupancyGridUpdate",
        "visualization_msgs/MarkerArray")
MODEL = "model"             # text of a visual marker that is no robot's
_MARKERS = "visualization_msgs/MarkerArray"
#: Types whose topics are all shown: greatest rate [Hz] at which they are read.
SHOWN = {"sensor_msgs/LaserScan": 10.0, "nav_msgs/Path": 2.0, "nav_msgs/OccupancyGrid": 1.0,
         "geometry_msgs/PoseArray": 2.0, "map_msgs/OccupancyGridUpdate": 2.0, _MARKERS: 5.0}
#: Topics whose content the scene has from elsewhere.
_LEFT_OUT = ("/bug2/markers",)
_PARTS_LEFT_OUT = ("/best_path/plans/",)        # the candidates, which are markers too
_RATES = {"/gazebo/world_markers": 10.0, "/gazebo/ground_markers": 1.0}
#: Types and topics with a message for each period of simulated time: publishers are asked for few of them. More states
#: than pictures are asked for, so that each picture has a new one however the two are timed.
_PACED = {"/clock": 45.0, "/gazebo/link_states": 45.0, "sensor_msgs/LaserScan": 10.0}


def kind_of(topic: str, kind: str) -> bool:
    """Return whether messages of this type on this topic are shown.

    Parameters
    ----------
    topic, kind : str
        Name of the topic and type of its messages.
    """
    return _NAMED.get(topic) == kind or (
        kind in SHOWN and topic not in _LEFT_OUT and not topic.startswith(_PARTS_LEFT_OUT))


def read_states(data: bytes) -> Tuple[List[str], Any]:
    """Return names and poses (n, 7) of a LinkStates or ModelStates, several times as fast as genpy.

    Raises
    ------
    ViewError
        If the message is shorter than it says.
    """
    try:
        count, = struct.unpack_from("<I", data)
        place, names = 4, []
        for _ in range(count):
            size, = struct.unpack_from("<I", data, place)
            names.append(data[place + 4:place + 4 + size].decode("utf-8", "replace"))
            place += 4 + size
        poses = np.frombuffer(data, dtype="<f8", count=7 * struct.unpack_from("<I", data, place)[0], offset=place + 4)
        if poses.size != 7 * count:
            raise ViewError("states of %d names have %d poses" % (count, poses.size // 7))
    except (struct.error, ValueError) as error:
        raise ViewError("a message of states is cut off: %s" % error) from error
    return names, poses.reshape(-1, 7)


class Inbox:
    """Messages of topics, read into a scene when a picture is due.

    Parameters
    ----------
    scene : LiveScene
    solids : Solids
        Gets the markers too, for the clearance.
    find_mesh : callable
        URI of a mesh -> path of its file, or None.
    """

    def __init__(self, scene: LiveScene, solids: Solids, find_mesh: FindMesh) -> None:
        self._scene, self._solids, self._find_mesh = scene, solids, find_mesh
        self.footprint: List[Any] = []
        self.problems: List[str] = []       # visuals that are left out, with the reason
        self._kinds: Dict[str, str] = {}
        self._waiting: Dict[str, Deque[bytes]] = {}
        self._read_at: Dict[str, float] = {}
        self._complained: Dict[str, str] = {}
        self._states: Tuple[bytes, List[str]] = (b"", [])
        self._robots: Dict[str, str] = {}
        self._looks: Dict[str, Tuple[List[Any], Callable[[], RobotModel]]] = {}
        self._lock = threading.Lock()
        self._readers: Dict[str, Callable[[str, Any], None]] = {
            "/clock": lambda _, message: scene.take_time(message.clock.to_sec()),
            "/tf": lambda _, message: scene.take_transforms(message),
            "/tf_static": lambda _, message: scene.take_transforms(message),
            "/gazebo/world_markers": self._take_markers, "/robot_description": self._take_description,
            "/gazebo/ground_markers": lambda _, message: scene.take_ground(message),
            "/gazebo/visual_markers": self._take_looks,
            "/gazebo/robot_states": self._take_states, "/gazebo/link_states": self._take_states,
            "/bug2/state": lambda _, message: setattr(scene, "state", message.data[:100]),
            "/bug2/hit_point": lambda _, message: scene.take_mark(False, message.point),
            "/bug2/leave_point": lambda _, message: scene.take_mark(True, message.point),
            "/diagnostics": self._take_diagnostics, "/best_path/scores": scene.take_table,
            "/best_path/state": lambda _, message: setattr(scene, "state", message.data[:100]),
            "sensor_msgs/LaserScan": scene.take_scan, "nav_msgs/OccupancyGrid": scene.take_map,
            "nav_msgs/Path": functools.partial(self._take_points, False),
            "geometry_msgs/PoseArray": functools.partial(self._take_points, True),
            "map_msgs/OccupancyGridUpdate": scene.take_map_update, _MARKERS: scene.take_annotations}

    # ---- coming in ---------------------------------------------------------------------------------------------

    def subscribe(self, published: List[Tuple[str, str]]) -> None:
        """Subscribe to what is shown and not subscribed to yet.

        Parameters
        ----------
        published : list of (str, str)
            Topics and their types.
        """
        for topic, kind in sorted(published):
            if topic not in self._kinds and kind_of(topic, kind) and len(self._kinds) < MOST_TOPICS and (
                    topic != "/gazebo/robot_states"):       # link_states has more
                self.add(topic, kind)
                rate = _PACED.get(topic) or _PACED.get(kind)
                options = {"queue_size": 100, "tcp_nodelay": True, "buff_size": 1 << 20}
                if rate:
                    subscribe_paced(topic, 1.0 / rate, rospy.AnyMsg, self._take_bytes, topic, **options)
                else:
                    rospy.Subscriber(topic, rospy.AnyMsg, self._take_bytes, topic, **options)

    def add(self, topic: str, kind: str) -> None:
        """Expect messages of a type on a topic.

        Parameters
        ----------
        topic, kind : str
        """
        with self._lock:
            every = topic in _ALL or kind in _ALL
            self._waiting[topic] = deque(maxlen=_EVERY if every else 1)
            self._kinds[topic] = kind

    def _take_bytes(self, message: Any, topic: str) -> None:
        data = message._buff
        if len(data) > LARGEST:
            self._complain(topic, "a message of %d bytes on %s is not shown; expected at most %d"
                           % (len(data), topic, LARGEST))
            return
        with self._lock:
            self._waiting[topic].append(data)

    def _complain(self, topic: str, text: str) -> None:
        if self._complained.get(topic) != text:
            self._complained[topic] = text
            log.warning("%s", text)

    # ---- reading -----------------------------------------------------------------------------------------------

    def read(self, wall: float) -> None:
        """Read what is waiting and due into the scene.

        Parameters
        ----------
        wall : float
            Wall time [s].
        """
        ready: List[Tuple[str, bytes]] = []
        with self._lock:
            for topic, waiting in self._waiting.items():
                rate = _RATES.get(topic) or SHOWN.get(self._kinds[topic])
                if waiting and (rate is None or wall - self._read_at.get(topic, -1e9) >= 1.0 / rate):
                    self._read_at[topic] = wall
                    ready += [(topic, data) for data in waiting]
                    waiting.clear()
        first = ("/clock", "/tf_static", "/tf", "/robot_description", "/gazebo/link_states")
        ready.sort(key=lambda entry: first.index(entry[0]) if entry[0] in first else len(first))
        for index, (topic, data) in enumerate(ready):
            if topic not in first and (index == 0 or ready[index - 1][0] in first):
                self._scene.update()            # scans and maps need the robots' poses
            self._read(topic, data)
        self._scene.update()

    def _read(self, topic: str, data: bytes) -> None:
        try:
            if topic == "/gazebo/link_states":
                self._take_link_states(data)
                return
            message = roslib.message.get_message_class(self._kinds[topic])()
            message.deserialize(data)
            self.take(topic, message)
        except ViewError as error:
            self._complain(topic, str(error))
        except Exception as error:      # bytes of another definition cause errors of any kind
            self._complain(topic, "a message on %s cannot be read as %s (%s: %s)" % (
                topic, self._kinds[topic], type(error).__name__, error))

    def take(self, topic: str, message: Any) -> None:
        """Take one message into the scene.

        Parameters
        ----------
        topic : str
        message : genpy.Message

        Raises
        ------
        ViewError
            If it cannot be shown.
        """
        named = _NAMED.get(topic) == self._kinds[topic]
        self._readers[topic if named else self._kinds[topic]](topic, message)

    def _take_points(self, particles: bool, topic: str, message: Any) -> None:
        self._scene.take_points(topic, message, particles)

    def _take_markers(self, _: str, message: Any) -> None:
        self._scene.markers.update(message.markers)
        self._solids.update(message.markers)

    def _take_description(self, topic: str, message: Any) -> None:
        self.take_description(topic, message.data)

    def take_description(self, source: str, text: str) -> None:
        """Take the URDF of robots, if it differs from the one known.

        Parameters
        ----------
        source : str
            Name of its topic or parameter.
        text : str

        Raises
        ------
        ViewError
            If it is no URDF.
        """
        if text in self._robots.values():
            return
        self._robots[source] = text
        model: RobotModel = read_robot_model(text, self._find_mesh)
        self._note_problems(model)
        self._scene.take_description(source, model)

    def _take_looks(self, _: str, message: Any) -> None:
        """Take the looks of models; meshes of robots are read only if no description fits."""
        grouped: Dict[str, List[Any]] = {}
        for marker in message.markers:
            if marker.ns:
                grouped.setdefault(marker.ns, []).append(marker)
        before, self._looks = self._looks, {}
        for name, markers in grouped.items():
            old = before.get(name)
            self._looks[name] = old if old is not None and old[0] == markers else (
                markers, functools.lru_cache(maxsize=None)(functools.partial(self._read_looks, name, markers)))
        robots = {name for name, (own, _) in self._looks.items() if own[0].text != MODEL}
        self._scene.take_looks({name: read for name, (_, read) in self._looks.items()}, robots)

    def _read_looks(self, name: str, markers: List[Any]) -> RobotModel:
        model = read_looks(name, markers, self._find_mesh)
        self._note_problems(model)
        return model

    def _note_problems(self, model: RobotModel) -> None:
        for problem in model.problems:
            if problem not in self.problems and len(self.problems) < MOST_PROBLEMS:
                self.problems.append(problem)
                log.warning("robot %s: %s; the page shows it without", model.name, problem)

    def _take_link_states(self, data: bytes) -> None:
        """Take the true poses of all links; the names are read only if they have changed."""
        header, names = self._states
        if not header or not data.startswith(header):
            names, poses = read_states(data)
            size = len(data) - 4 * 2 - len(names) * 8 * 13         # poses and twists follow the names
            header = bytes(data[:max(0, size)])
            self._states = (header, names)
        else:
            poses = np.frombuffer(data, dtype="<f8", count=7 * len(names), offset=len(header) + 4).reshape(-1, 7)
        self._scene.take_links(names, poses)

    def _take_states(self, _: str, message: Any) -> None:
        """Take the true poses of robots or links of a recording."""
        poses = [(pose.position.x, pose.position.y, pose.position.z, pose.orientation.x, pose.orientation.y,
                  pose.orientation.z, pose.orientation.w) for pose in message.pose]
        self._scene.take_links(list(message.name), np.array(poses).reshape(-1, 7))

    def _take_diagnostics(self, _: str, message: Any) -> None:
        for status in message.status:
            if status.name == "m2wr_sim: simulation":
                self._scene.values = {entry.key: entry.value for entry in status.values[:1000]}

    def rewind(self) -> None:
        """Forget the states of links, for a jump in a recording."""
        self._states = (b"", [])

    @property
    def description(self) -> Optional[str]:
        """The first URDF, or None."""
        return next(iter(self._robots.values()), None)

# SPDX-License-Identifier: BSD-3-Clause
"""A costmap as a part of a node: parameters, sensors, map, updates, messages."""
from __future__ import annotations

import math
import threading
import time
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Point32, Polygon, PolygonStamped
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid

from m2wr_maps.ros.message_conversion import ArrayGrid
from m2wr_navigation import registry
from m2wr_navigation.costmap import footprint
from m2wr_navigation.costmap.costmap_parameters import (
    COSTMAP_PARAMETERS,
    LayerSetting,
    footprint_of,
    layer_settings,
    size_fault,
    source_settings,
    unknown_names,
)
from m2wr_navigation.costmap.layer import Window
from m2wr_navigation.costmap.layered_costmap import LayeredCostmap
from m2wr_navigation.costmap.observation import Source
from m2wr_navigation.costmap.obstacle_layer import ObstacleLayer
from m2wr_navigation.costmap.static_layer import MapError, StaticLayer
from m2wr_navigation.costmap.voxel_layer import VoxelLayer
from m2wr_navigation.overruns import OverrunMonitor
from m2wr_navigation.parameters import read
from m2wr_navigation.ros.grid_messages import grid_message, update_message
from m2wr_navigation.ros.reconfigure import serve
from m2wr_navigation.ros.sensor_input import SensorInput
from m2wr_navigation.ros.transforms import TransformError, Transforms, yaw_of
from m2wr_navigation.ros.voxel_outputs import VoxelOutputs
from m2wr_node.ros.shutdown import until_shutdown
from m2wr_node.ros.transform_buffer import frame

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

LOOK = 0.05                 # s of wall time between two looks at the clock while it stands
PATIENCE = 5.0              # s of wall time between two messages about what the start waits for


class CostmapError(ValueError):
    """A costmap cannot be made; the message says why."""


class CostmapServer:
    """One costmap of a node.

    Parameters
    ----------
    name : str
        Its namespace below that of the node: ``global_costmap`` or ``local_costmap`` of move_base.
    transforms : Transforms
    """

    def __init__(self, name: str, transforms: Transforms) -> None:
        self.name, self._transforms, self._place = name, transforms, "~" + name
        given = rospy.get_param(self._place, {})
        given = dict(given) if isinstance(given, dict) else {}
        found = _searched_footprint(name)
        if found is not None:
            given["footprint"] = found
        self._given = given
        scalars = {key: value for key, value in given.items() if key != "footprint"}
        self.values, warnings = read(COSTMAP_PARAMETERS, scalars, self._place)
        layers, more = layer_settings(given, self._place)
        fault = size_fault(self.values)
        if fault:
            raise CostmapError("{}: {}".format(self._place, fault))
        for sentence in warnings + more + unknown_names(given, layers, self._place):
            rospy.logwarn("%s", sentence)
        self.frame, self.base = frame(self.values["global_frame"]), frame(self.values["robot_base_frame"])
        values = self.values
        self.costmap = LayeredCostmap(
            self.frame, (values["width"], values["height"]), values["resolution"],
            (values["origin_x"], values["origin_y"]), values["rolling_window"], values["track_unknown_space"],
            time.thread_time)
        self.costmap.least_clearance = values["least_clearance"]
        self._take_footprint()
        self._inputs: List[SensorInput] = []
        self._voxels: List[VoxelOutputs] = []
        self._keep: List[Any] = []              # subscribers and servers
        self.fault = "no update yet"            # why the last update failed; empty: it did not
        self._lock = threading.Lock()
        self._changed, self._sent = Window.empty(), -math.inf
        self._last_grid: Any = None
        self.greet = False                      # whether a new subscriber waits for the whole grid
        self.busy_ms = 0.0                      # CPU of the last update
        for setting in layers:
            self._add_layer(setting)
        place = self._place + "/"
        if "plugins" not in given:      # as costmap_2d does with a file without layers; clients look there
            rospy.set_param(place + "plugins", [{"name": layer.name, "type": layer.kind} for layer in layers])
        self._grid = rospy.Publisher(place + "costmap", OccupancyGrid, self._Greeting(self), queue_size=1)
        self._updates = rospy.Publisher(place + "costmap_updates", OccupancyGridUpdate, queue_size=1)
        self._outline = rospy.Publisher(place + "footprint", PolygonStamped, queue_size=1)
        self._keep.append(rospy.Subscriber(place + str(given.get("footprint_topic", "footprint_topic")), Polygon,
                                           self._on_footprint, queue_size=1))
        self._keep.append(serve(self._place, COSTMAP_PARAMETERS, self.values, self._reconfigure))
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    class _Greeting(rospy.SubscribeListener):
        """Lets the next update send the whole grid; rospy's buffer is not safe for two threads that publish."""

        def __init__(self, server: CostmapServer) -> None:
            super().__init__()
            self._server = server

        def peer_subscribe(self, topic_name: str, topic_publish: Any, peer_publish: Any) -> None:
            self._server.greet = True

    # ---- layers

    def _add_layer(self, setting: LayerSetting) -> None:
        place = "{}/{}".format(self._place, setting.name)
        try:
            kind = registry.find(registry.LAYERS, setting.kind)
        except registry.UnknownPluginError as error:
            raise CostmapError("{}: {}".format(place, error)) from error
        if "track_unknown_space" not in setting.given and issubclass(kind, ObstacleLayer):
            setting.given["track_unknown_space"] = self.values["track_unknown_space"]
        values, warnings = read(kind.PARAMETERS, setting.given, place)
        layer = kind(setting.name, values)
        if isinstance(layer, ObstacleLayer):
            sources, more = source_settings(setting, self._place)
            warnings += more
            for name, settings in sources.items():
                layer.sources[name] = Source(name, settings)
                rospy.set_param("{}/{}".format(place, name), settings)
                self._inputs.append(SensorInput(layer.sources[name], self._transforms, self.frame))
            if isinstance(layer, VoxelLayer):
                self._voxels.append(VoxelOutputs(layer, place, self.frame))
        elif isinstance(layer, StaticLayer):
            self._subscribe_to_map(layer)
        for sentence in warnings:
            rospy.logwarn("%s", sentence)
        self.costmap.add(layer)

        def take(changed: Dict[str, Any]) -> None:
            with self.costmap.lock:
                layer.configure(changed)
                self.costmap.refresh()

        self._keep.append(serve(place, kind.PARAMETERS, values, take))

    def _subscribe_to_map(self, layer: StaticLayer) -> None:
        topic = layer.values["map_topic"]

        def on_map(message: ArrayGrid) -> None:
            if layer.map is not None and layer.values["first_map_only"]:
                return
            info, last = message.info, layer.map
            try:
                if len(message.data) != info.width * info.height:
                    raise MapError("it has {} cells and {} x {} of them are announced".format(
                        len(message.data), info.width, info.height))
                origin = np.array([info.origin.position.x, info.origin.position.y, yaw_of(info.origin.orientation)])
                with self.costmap.lock:
                    layer.set_map(np.asarray(message.data, np.int8).reshape(info.height, info.width),
                                  float(info.resolution), origin, frame(message.header.frame_id))
                    self.costmap.refresh()          # an update before the map does not count
            except MapError as error:
                rospy.logwarn("the map on %s is not used: %s", topic, error)
                return
            made = layer.map
            if last is None or made is None or (made.shape, made.resolution, made.frame) != (
                    last.shape, last.resolution, last.frame):       # a mapper sends its map every few seconds
                rospy.loginfo("%s: map of %d x %d cells of %.3g m in frame %s", self.name, info.width, info.height,
                              info.resolution, message.header.frame_id)

        def on_update(message: OccupancyGridUpdate) -> None:
            try:
                if len(message.data) != message.width * message.height:
                    raise MapError("it has {} cells and {} x {} of them are announced".format(
                        len(message.data), message.width, message.height))
                cells = np.array(message.data, np.int8).reshape(message.height, message.width)
                with self.costmap.lock:
                    layer.update_map(cells, message.y, message.x)
            except MapError as error:
                rospy.logwarn_throttle(10.0, "a change of the map on {}_updates is not used: {}".format(topic, error))

        self._keep.append(rospy.Subscriber(topic, ArrayGrid, on_map, queue_size=1, buff_size=2**24))
        if layer.values["subscribe_to_updates"]:
            self._keep.append(rospy.Subscriber(topic + "_updates", OccupancyGridUpdate, on_update, queue_size=10))

    @property
    def waits_for_map(self) -> str:
        """Topic of a map that has not arrived yet; empty: none."""
        layer = self.costmap.static_layer()
        return str(layer.values["map_topic"]) if layer is not None and layer.map is None else ""

    # ---- parameters that change

    def _take_footprint(self) -> None:
        corners, fault = footprint_of(self._given, self.values)
        if fault:
            rospy.logerr("%s: %s", self._place, fault)
        self.costmap.set_footprint(corners)

    def _on_footprint(self, message: Polygon) -> None:
        try:
            corners = footprint.checked(np.array([[point.x, point.y] for point in message.points]).reshape(-1, 2))
        except footprint.FootprintError as error:
            rospy.logwarn("a footprint on %s/footprint_topic is not used: %s", self._place, error)
            return
        self.costmap.set_footprint(footprint.padded(corners, self.values["footprint_padding"]))

    def _reconfigure(self, values: Dict[str, Any]) -> None:
        before, self.values = self.values, values
        if any(values[name] != before[name] for name in ("footprint", "robot_radius", "footprint_padding")):
            if values["footprint"] != before["footprint"]:
                self._given["footprint"] = values["footprint"]
            self._take_footprint()
        self.costmap.least_clearance = values["least_clearance"]
        if any(values[name] != before[name] for name in ("width", "height", "resolution", "origin_x", "origin_y")):
            fault = size_fault(values)
            if fault:
                rospy.logwarn("%s: %s", self._place, fault)
                return
            shape = tuple(max(1, int(round(values[name] / values["resolution"]))) for name in ("height", "width"))
            self.costmap.resize((shape[0], shape[1]), values["resolution"],
                                np.array([values["origin_x"], values["origin_y"]]))

    # ---- updates

    def start(self) -> None:
        """Begin to update."""
        self._thread.start()

    def pose(self) -> FloatArray:
        """Return the pose (3,) of the robot in the costmap's frame; raises TransformError."""
        return self._transforms.fresh_pose(self.frame, self.base, max(self.values["transform_tolerance"], 0.0))

    def stamped_pose(self) -> Tuple[FloatArray, float]:
        """Return the newest pose (3,) of the robot in the costmap's frame and its stamp [s]; raises TransformError."""
        return self._transforms.stamped_pose(self.frame, self.base)

    def late(self) -> List[str]:
        """Return sentences about sensors that are silent."""
        now = rospy.get_time()
        return [sentence for layer in self.costmap.obstacle_layers() if layer.enabled for sentence in layer.late(now)]

    def snapshot(self) -> Costmap:
        """Return the costmap after the last update."""
        return self.costmap.snapshot()

    def _run(self) -> None:
        last, monitor = -math.inf, OverrunMonitor()
        while not rospy.is_shutdown():
            rate, now = self.values["update_frequency"], rospy.get_time()
            if rate <= 0.0 or 0.0 <= now - last < 1.0 / rate:
                time.sleep(min(LOOK, max(0.001, 1.0 / rate - (now - last))) if rate > 0.0 else LOOK)
                continue
            last, began = now, time.thread_time()
            with until_shutdown():
                self.update(now)
            self.busy_ms = 1e3 * (time.thread_time() - began)
            spent = rospy.get_time() - now
            if monitor.is_due(now, spent, 1.0 / rate):
                rospy.logwarn("%s: an update took %.3f s (%.0f ms of CPU, most of it in %s); expected at most %.3f s "
                              "(update_frequency %.3g Hz)", self.name, spent, self.busy_ms, self._slowest(),
                              1.0 / rate, rate)

    def _slowest(self) -> str:
        """Return the layer that took most of the last update, with its CPU time."""
        spent = self.costmap.spent
        name = max(spent, key=lambda layer: spent[layer]) if spent else ""
        rest = 1e-3 * self.busy_ms - sum(spent.values())        # of sensors and messages
        if not name or rest > spent[name]:
            return "sensor data and messages: {:.0f} ms".format(1e3 * rest)
        return "{}: {:.0f} ms".format(name, 1e3 * spent[name])

    def update(self, now: float) -> None:
        """Update once and publish what is due.

        Parameters
        ----------
        now : float
            [s]
        """
        try:
            pose = self.pose()
            layer = self.costmap.static_layer()
            if layer is not None and layer.map is not None and layer.map.frame != self.frame:
                layer.map_from_costmap = self._transforms.pose(layer.map.frame, self.frame)
        except TransformError as error:
            self.fault = str(error)
            rospy.logwarn_throttle(5.0, "{} is not updated: {}".format(self.name, error))
            return
        for each in self._inputs:
            each.deliver(now)
        window = self.costmap.update(pose, now)
        self.fault = ""
        with self.costmap.lock:         # a change of parameters would give the columns another size
            for outputs in self._voxels:
                outputs.publish(rospy.Time.from_sec(now))
            remarks = self.costmap.take_remarks()
        for sentence in remarks:
            rospy.logwarn("%s/%s", self._place, sentence)
        self._publish(window, pose, now)

    def _publish(self, window: Window, pose: FloatArray, now: float) -> None:
        stamp = rospy.Time.from_sec(now)
        if self._outline.get_num_connections():
            message = PolygonStamped()
            message.header.frame_id, message.header.stamp = self.frame, stamp
            message.polygon.points = [Point32(x, y, 0.0) for x, y in footprint.placed(self.costmap.footprint, pose)]
            self._outline.publish(message)
        self._changed = self._changed.union(window)
        rate = self.values["publish_frequency"]
        if self.greet:
            self.greet, self._last_grid, self._sent = False, None, -math.inf
            rate = max(rate, self.values["update_frequency"])
        if rate <= 0.0 or 0.0 <= now - self._sent < 1.0 / rate:
            return
        self._sent, changed, self._changed = now, self._changed, Window.empty()
        if not self._grid.get_num_connections() and not self._updates.get_num_connections():
            self._last_grid = None
            return
        shown = self.costmap.snapshot()
        key = (shown.shape, shown.resolution, *shown.origin)
        if self.values["always_send_full_costmap"] or key != self._last_grid:
            self._last_grid = key
            self._grid.publish(grid_message(shown, stamp))
        elif not changed.is_empty:
            self._updates.publish(update_message(shown, changed, stamp))


def _searched_footprint(name: str) -> Optional[Any]:
    """Return the parameter ``footprint`` of a costmap, its node, or a namespace above; None: there is none."""
    for place in ("~%s/footprint" % name, "~footprint"):
        if rospy.has_param(place):
            return rospy.get_param(place)
    found = rospy.search_param("footprint")
    return rospy.get_param(found) if found else None


def wait_until_ready(servers: List[CostmapServer], what: str) -> bool:
    """Return when all costmaps have been updated, and say meanwhile what is missing; False at shutdown.

    Parameters
    ----------
    servers : list of CostmapServer
        Started ones.
    what : str
        Who waits, for messages.

    Returns
    -------
    bool
    """
    told = time.monotonic()
    while not rospy.is_shutdown():
        waits = ["{}: {}".format(server.name, "no map on {}".format(server.waits_for_map)
                                 if server.waits_for_map else server.fault)
                 for server in servers if server.waits_for_map or not server.costmap.is_updated]
        if not waits:
            return True
        if time.monotonic() - told > PATIENCE:
            told = time.monotonic()
            rospy.logwarn("%s waits: %s", what, "; ".join(waits))
        time.sleep(LOOK)
    return False

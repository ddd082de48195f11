# SPDX-License-Identifier: BSD-3-Clause
"""``elevation_mapping``: heights of the ground and traversability from a cloud of points, odometry and an IMU."""
from __future__ import annotations

import threading
import time
from collections import deque
from typing import TYPE_CHECKING, Any, Deque, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import Point, TransformStamped
from grid_map_msgs.msg import GridMap
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import Imu, PointCloud2
from std_msgs.msg import ColorRGBA, Float32MultiArray, MultiArrayDimension
from visualization_msgs.msg import Marker

from m2wr_elevation.dead_reckoning import DeadReckoning, heading, rotation_of
from m2wr_elevation.elevation_map import ElevationMap, MapSettings
from m2wr_elevation.message_arrays import layer_data, occupancy, points_of, surface, without
from m2wr_elevation.slip import SlipMap
from m2wr_node.ros.shutdown import until_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import TransformBuffer, frame

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

PATIENCE = 0.1          # s of wall time that a cloud waits for the IMU
_COSTS_EVERY, _SURFACE_EVERY = 5, 10        # clouds; lists of many numbers take longer to send than to compute
_KEPT = 200             # messages of IMU and odometry
_BACK = rospy.Duration(0.5)     # further back than messages overtake one another
_TELL = 5.0             # s between two messages about one cause


def quaternion_of(rotation: Values) -> Tuple[float, float, float, float]:
    """Return the quaternion x, y, z, w of a rotation matrix (3, 3), by the method of Shepperd (1978)."""
    trace = float(np.trace(rotation))
    values = np.array((rotation[0, 0], rotation[1, 1], rotation[2, 2], trace))
    first = int(np.argmax(values))
    if first == 3:
        found = np.array((rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0],
                          rotation[1, 0] - rotation[0, 1], 1.0 + trace))
    else:
        i, j, k = first, (first + 1) % 3, (first + 2) % 3
        found = np.zeros(4)
        found[i] = 1.0 - trace + 2.0 * rotation[i, i]
        found[j], found[k] = rotation[j, i] + rotation[i, j], rotation[k, i] + rotation[i, k]
        found[3] = rotation[k, j] - rotation[j, k]
    x, y, z, w = (found / np.linalg.norm(found)).tolist()
    return x, y, z, w


class ElevationNode:
    """Maps each cloud when the IMU's orientation at its stamp is known.

    Parameters
    ----------
    settings : MapSettings, optional
        None: from the parameters of the node.
    follow : bool
        Whether the map moves with the robot.
    start : (float, float)
        Where the robot begins in the frame of the map [m].

    Attributes
    ----------
    map : ElevationMap
    reckoning : DeadReckoning
    slip : SlipMap
    """

    def __init__(self, settings: Optional[MapSettings] = None, follow: bool = True,
                 start: Tuple[float, float] = (0.0, 0.0)) -> None:
        self._follow, self._start = follow, start
        if settings is None:
            settings = MapSettings(**{name: float(rospy.get_param("~" + name))
                                      for name in MapSettings.__dataclass_fields__ if rospy.has_param("~" + name)})
        self._settings, self._axle = settings, float(rospy.get_param("~axle", 0.0))
        self._begin()
        self._base = frame(str(rospy.get_param("~base_frame", "link_chassis")))
        self._frame = frame(str(rospy.get_param("~map_frame", "elevation_map")))
        self._buffer = TransformBuffer(rospy.Duration(10.0), debug=False)
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._broadcaster = tf2_ros.TransformBroadcaster()
        self._grid = rospy.Publisher("~grid_map", GridMap, queue_size=1)
        self._costs = rospy.Publisher("~costmap", OccupancyGrid, queue_size=1, latch=True)
        self._surface = rospy.Publisher("~surface", Marker, queue_size=1, latch=True)
        self._clouds = 0
        self._mounts: Dict[str, Tuple[Values, Values]] = {}
        self._changed = threading.Condition()
        self._cloud: Optional[PointCloud2] = None
        self._imu: Deque[Imu] = deque(maxlen=_KEPT)
        self._odometry: Deque[Odometry] = deque(maxlen=_KEPT)
        self._newest: Any = None        # stamp of the last message of odometry
        self._used = 0.0                # s of processor time when the first cloud had been mapped
        self._subscribers = [
            rospy.Subscriber("points", PointCloud2, self._on_cloud, queue_size=1, buff_size=1 << 24),
            rospy.Subscriber("imu/data", Imu, self._on_imu, queue_size=50),
            rospy.Subscriber("odom", Odometry, self._on_odometry, queue_size=50)]

    def _begin(self) -> None:
        """Begin with an empty map where the robot is."""
        self.map, self.reckoning = ElevationMap(self._settings, self._follow), DeadReckoning(self._axle)
        self.slip = SlipMap()
        self._restarted, self._begun = False, False

    def wanted(self) -> bool:
        """Return whether a cloud is to be mapped now; other nodes replace this."""
        return True

    def others(self, stamp: Any) -> Sequence[Tuple[float, float]]:
        """Return places of other robots in the map, which are no ground [m]; other nodes replace this."""
        return ()

    def mapped(self, stamp: Any) -> None:
        """Do something after a cloud is in the map; other nodes replace this."""

    def _on_cloud(self, message: PointCloud2) -> None:
        with self._changed:
            self._cloud = message
            self._changed.notify()

    def _on_imu(self, message: Imu) -> None:
        with self._changed:
            self._imu.append(message)
            self._changed.notify()

    def _on_odometry(self, message: Odometry) -> None:
        with self._changed:
            if self._newest is not None and self._newest - message.header.stamp > _BACK:
                self._restarted, self._cloud = True, None       # the simulation was reset
                self._odometry.clear()
                self._imu.clear()
            self._newest = message.header.stamp
            self._odometry.append(message)

    def run(self) -> None:
        """Work until the node is shut down."""
        while not rospy.is_shutdown():
            with self._changed:
                self._changed.wait_for(lambda: self._cloud is not None or rospy.is_shutdown(), 0.5)
                cloud, self._cloud = self._cloud, None
                if cloud is None or not self.wanted():
                    continue
                stamp = cloud.header.stamp
                imu = self._imu_at(stamp)
                odometry: List[Odometry] = []
                while self._odometry and self._odometry[0].header.stamp <= stamp:
                    odometry.append(self._odometry.popleft())
                if self._restarted:
                    self._begin()
                    rospy.logwarn("time has gone back: the map begins again")
            if imu is None:
                rospy.logwarn_throttle(_TELL, "no orientation from %s yet; clouds are left out",
                                       rospy.resolve_name("imu/data"))
                continue
            try:
                with until_shutdown():
                    self._take(cloud, imu, odometry)
            except (ValueError, np.linalg.LinAlgError) as error:
                rospy.logwarn_throttle(_TELL, "cloud on %s is refused: %s", rospy.resolve_name("points"), error)

    def used(self) -> str:
        """Return how much processor time all threads of the node took for a cloud, without its start."""
        if self._clouds < 2:
            return "{} clouds were mapped".format(self._clouds)
        spent = (time.process_time() - self._used) / (self._clouds - 1)
        return "{} clouds were mapped, {:.1f} ms of processor time each: {:.2f} of a core at 10 Hz".format(
            self._clouds, 1e3 * spent, 10.0 * spent)

    def _imu_at(self, stamp: Any) -> Optional[Imu]:
        """Return the IMU's message nearest to a stamp; wait for a later one first. The lock is held."""
        def is_there() -> bool:
            return bool(self._imu) and self._imu[-1].header.stamp >= stamp

        def away(message: Imu) -> float:
            return abs(float((message.header.stamp - stamp).to_sec()))

        self._changed.wait_for(is_there, PATIENCE)
        return min(self._imu, key=away, default=None)

    def _mount(self, name: str) -> Tuple[Values, Values]:
        """Return rotation and place of the sensor on the robot; they do not change."""
        if name not in self._mounts:
            try:
                found = self._buffer.lookup_transform(self._base, frame(name), rospy.Time(0), rospy.Duration(1.0))
            except tf2_ros.TransformException as error:
                raise ValueError("there is no transform from {} to {}: {}".format(name, self._base, error)) from None
            turn, place = found.transform.rotation, found.transform.translation
            if len(self._mounts) > 20:
                self._mounts.clear()
            self._mounts[name] = rotation_of((turn.x, turn.y, turn.z, turn.w)), np.array((place.x, place.y, place.z))
        return self._mounts[name]

    def _take(self, cloud: PointCloud2, imu: Imu, odometry: List[Odometry]) -> None:
        points = points_of(cloud)
        turned, place = self._mount(cloud.header.frame_id)
        turn = imu.orientation
        self.reckoning.orient((turn.x, turn.y, turn.z, turn.w))
        if not self._begun:
            self._begun = True
            self.reckoning.shift(np.array((*self._start, 0.0)) - self.reckoning.position)
        newest, wheels = odometry[-1] if odometry else None, 0.0
        if newest is not None:
            pose, turned_by = newest.pose.pose.position, rotation_of(_values(newest.pose.pose.orientation))
            wheels = self.reckoning.travel(pose.x, pose.y, heading(turned_by))
        rotation = self.reckoning.rotation
        others = self.others(cloud.header.stamp)
        if others:
            points = without(points, rotation @ turned, self.reckoning.position + rotation @ place, others)
        self.map.move(*self.reckoning.position[:2].tolist())
        self.reckoning.shift(self.map.offset(points, rotation @ turned, self.reckoning.position + rotation @ place))
        position = self.reckoning.position
        self.slip.travel(wheels, self.reckoning.axle, rotation[:, 0])
        self.map.add(points, rotation @ turned, position + rotation @ place, position)
        if newest is not None:
            self._tell_frame(newest)
        self.mapped(cloud.header.stamp)
        self._publish(cloud.header.stamp)

    def _tell_frame(self, odometry: Odometry) -> None:
        """Send where the frame of the odometry is in that of the map."""
        pose = odometry.pose.pose
        turned = rotation_of(_values(pose.orientation))
        rotation = self.reckoning.rotation @ turned.T
        place = self.reckoning.position - rotation @ np.array((pose.position.x, pose.position.y, pose.position.z))
        message = TransformStamped()
        message.header.stamp, message.header.frame_id = odometry.header.stamp, self._frame
        message.child_frame_id = frame(odometry.header.frame_id)
        shift, turn = message.transform.translation, message.transform.rotation
        shift.x, shift.y, shift.z = place.tolist()
        turn.x, turn.y, turn.z, turn.w = quaternion_of(rotation)
        if message.child_frame_id:
            self._broadcaster.sendTransform(message)

    def _publish(self, stamp: Any) -> None:
        rates = ((self._grid, 1), (self._costs, _COSTS_EVERY), (self._surface, _SURFACE_EVERY))
        wanted = [publisher.get_num_connections() > 0 and self._clouds % every == 0 for publisher, every in rates]
        self._clouds += 1
        if self._clouds == 1:
            self._used = time.process_time()
        if not any(wanted):
            return
        layers = self.map.layers()
        layers["slip"] = self.slip.layer(self.map, layers["slope"])
        if wanted[0]:
            self._grid.publish(self._grid_message(layers, stamp))
        if wanted[1]:
            self._costs.publish(self._cost_message(np.minimum(layers["traversability"], 1.0 - layers["slip"]), stamp))
        if wanted[2]:
            self._surface.publish(self._surface_message(layers, stamp))

    def _grid_message(self, layers: Dict[str, Values], stamp: Any) -> GridMap:
        message = GridMap(layers=list(layers), basic_layers=["elevation"])
        info, settings = message.info, self.map.settings
        info.header.stamp, info.header.frame_id, info.resolution = stamp, self._frame, settings.cell
        rows, columns = self.map.height.shape
        info.length_x, info.length_y = columns * settings.cell, rows * settings.cell
        info.pose.position.x, info.pose.position.y = self.map.centre
        info.pose.orientation.w = 1.0
        for layer in layers.values():
            array = Float32MultiArray(data=layer_data(layer).tolist())      # packed faster than an array
            array.layout.dim = [MultiArrayDimension("column_index", rows, rows * columns),
                                MultiArrayDimension("row_index", columns, columns)]
            message.data.append(array)
        return message

    def _cost_message(self, traversability: Values, stamp: Any) -> OccupancyGrid:
        message = OccupancyGrid()
        message.header.stamp, message.header.frame_id = stamp, self._frame
        message.info.map_load_time, message.info.resolution = stamp, self.map.settings.cell
        message.info.height, message.info.width = traversability.shape
        message.info.origin.position.x, message.info.origin.position.y = self.map.corner
        message.info.origin.orientation.w = 1.0
        message.data = occupancy(traversability).ravel().tolist()
        return message

    def _surface_message(self, layers: Dict[str, Values], stamp: Any) -> Marker:
        marker = Marker(ns="elevation", type=Marker.TRIANGLE_LIST, action=Marker.ADD)
        marker.header.stamp, marker.header.frame_id = stamp, self._frame
        marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = marker.color.a = 1.0
        corners, colours = surface(layers["elevation"], layers["traversability"], self.map.corner,
                                   self.map.settings.cell)
        marker.points = [Point(*point) for point in corners.tolist()]
        marker.colors = [ColorRGBA(*colour, 1.0) for colour in colours.tolist()]
        return marker


def _values(turn: Any) -> Tuple[float, float, float, float]:
    return turn.x, turn.y, turn.z, turn.w


def main() -> int:
    """Run the node; return the exit code."""
    start_node("elevation_mapping")
    try:
        node = ElevationNode()
    except (TypeError, ValueError) as error:
        rospy.logfatal("parameters: %s", error)
        return 1
    node.run()
    rospy.loginfo(node.used())
    return 0

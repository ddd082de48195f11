# SPDX-License-Identifier: BSD-3-Clause
"""The last seconds of a run, as a ROS 1 bag: what the robot saw, what it was told, and where it truly was."""
from __future__ import annotations

import math
import os
import tempfile
from collections import deque
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Deque, Iterator, Optional, Tuple

import numpy as np
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

if TYPE_CHECKING:
    from m2wr_navigation.methods.body import RobotBody
    from m2wr_sim.api import Odometry, Scan, StepResult

    Pose = Tuple[float, float, float]

KEPT = 10.0                 # s
ODOM, BASE, LASER, WORLD = "odom", "base_link", "laser", "world"
#: Topic -> message type, of all topics of such a bag.
TOPICS = {"/m2wr/laser/scan": "sensor_msgs/msg/LaserScan", "/odom": "nav_msgs/msg/Odometry",
          "/base_pose_ground_truth": "nav_msgs/msg/Odometry", "/cmd_vel": "geometry_msgs/msg/Twist",
          "/tf": "tf2_msgs/msg/TFMessage"}


@dataclass
class _Cycle:
    result: StepResult
    seen: StepResult
    command: Optional[Tuple[float, float]] = None


class LastSeconds:
    """Keeps the last cycles of a run.

    Parameters
    ----------
    period : float
        Of a cycle [s].
    """

    def __init__(self, period: float) -> None:
        self._cycles: Deque[_Cycle] = deque(maxlen=max(1, int(round(KEPT / period))))

    def look(self, result: StepResult, seen: StepResult) -> None:
        """Keep what is known before a decision.

        Parameters
        ----------
        result : StepResult
            Without any fault.
        seen : StepResult
            What the method gets.
        """
        self._cycles.append(_Cycle(result, seen))

    def decided(self, linear: float, angular: float) -> None:
        """Keep the decision, also one that is not finite.

        Parameters
        ----------
        linear, angular : float
            [m/s, rad/s]
        """
        if self._cycles:
            self._cycles[-1].command = (linear, angular)

    def bag(self, body: RobotBody) -> bytes:
        """Return the bag, empty without any cycle.

        Parameters
        ----------
        body : RobotBody
            Of which the laser's place is used.
        """
        if not self._cycles:
            return b""
        types = message_types()
        with tempfile.TemporaryDirectory(prefix="m2wr_bag_") as folder:
            path = os.path.join(folder, "run.bag")
            writer = Writer(path)
            writer.set_compression(Writer.CompressionFormat.BZ2)
            with writer:
                connections = {topic: writer.add_connection(topic, kind, typestore=types)
                               for topic, kind in TOPICS.items()}
                for cycle in self._cycles:
                    stamp = int(round(1e9 * cycle.result.time))
                    for topic, message in _Messages(types).of(cycle, body):
                        writer.write(connections[topic], stamp, types.serialize_ros1(message, TOPICS[topic]))
            with open(path, "rb") as file:
                return file.read()


def message_types() -> Any:
    """Return the type store of rosbags with all types of such a bag; tf2_msgs is not among its own."""
    types = get_typestore(Stores.ROS1_NOETIC)
    types.register(get_types_from_msg("geometry_msgs/TransformStamped[] transforms\n", TOPICS["/tf"]))
    return types


class _Messages:
    """Makes the messages of a cycle.

    Parameters
    ----------
    types : Typestore
        Of rosbags.
    """

    def __init__(self, types: Any) -> None:
        self._types = types.types

    def of(self, cycle: _Cycle, body: RobotBody) -> Iterator[Tuple[str, Any]]:
        result, kinds = cycle.result, self._types
        true = next(iter(result.robots.values()))
        here = next(iter(cycle.seen.robots.values()))
        if here.odometry is not None:
            yield "/odom", self._odometry(here.odometry, ODOM)
            yield "/tf", kinds["tf2_msgs/msg/TFMessage"](transforms=[
                self._transform(here.odometry.time, ODOM, BASE, here.odometry.pose),
                self._transform(here.odometry.time, BASE, LASER, body.laser)])
        yield "/base_pose_ground_truth", self._message(result.time, WORLD, true.position, true.orientation,
                                                       (0.0, 0.0, 0.0))
        if here.scan is not None:
            yield "/m2wr/laser/scan", self._scan(here.scan)
        if cycle.command is not None:
            yield "/cmd_vel", self._twist(cycle.command[0], 0.0, cycle.command[1])

    def _header(self, time: float, frame: str) -> Any:
        sec, nanosec = divmod(int(round(1e9 * time)), 10 ** 9)
        stamp = self._types["builtin_interfaces/msg/Time"](sec=sec, nanosec=nanosec)
        return self._types["std_msgs/msg/Header"](seq=0, stamp=stamp, frame_id=frame)

    def _vector(self, x: float, y: float, z: float) -> Any:
        return self._types["geometry_msgs/msg/Vector3"](x=float(x), y=float(y), z=float(z))

    def _twist(self, ahead: float, left: float, turn: float) -> Any:
        return self._types["geometry_msgs/msg/Twist"](linear=self._vector(ahead, left, 0.0),
                                                      angular=self._vector(0.0, 0.0, turn))

    def _odometry(self, odometry: Odometry, frame: str) -> Any:
        return self._message(odometry.time, frame, odometry.position, odometry.orientation,
                             (odometry.linear_x, odometry.linear_y, odometry.angular_z))

    def _message(self, time: float, frame: str, position: Any, orientation: Any, velocity: Pose) -> Any:
        kinds, zeros = self._types, np.zeros(36)
        pose = kinds["geometry_msgs/msg/Pose"](
            position=kinds["geometry_msgs/msg/Point"](*map(float, position)),
            orientation=kinds["geometry_msgs/msg/Quaternion"](*map(float, orientation)))
        return kinds["nav_msgs/msg/Odometry"](
            header=self._header(time, frame), child_frame_id=BASE,
            pose=kinds["geometry_msgs/msg/PoseWithCovariance"](pose=pose, covariance=zeros),
            twist=kinds["geometry_msgs/msg/TwistWithCovariance"](twist=self._twist(*velocity), covariance=zeros))

    def _transform(self, time: float, parent: str, child: str, place: Pose) -> Any:
        kinds = self._types
        turn = kinds["geometry_msgs/msg/Quaternion"](0.0, 0.0, math.sin(0.5 * place[2]), math.cos(0.5 * place[2]))
        return kinds["geometry_msgs/msg/TransformStamped"](
            header=self._header(time, parent), child_frame_id=child, transform=kinds["geometry_msgs/msg/Transform"](
                translation=self._vector(place[0], place[1], 0.0), rotation=turn))

    def _scan(self, scan: Scan) -> Any:
        return self._types["sensor_msgs/msg/LaserScan"](
            header=self._header(scan.time, LASER), angle_min=scan.angle_min, angle_max=scan.angle_max,
            angle_increment=scan.angle_increment, time_increment=0.0, scan_time=0.0, range_min=scan.range_min,
            range_max=scan.range_max, ranges=np.asarray(scan.ranges, np.float32),
            intensities=np.asarray(scan.intensities, np.float32))

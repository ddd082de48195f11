# SPDX-License-Identifier: BSD-3-Clause
"""The node ``ekf_localization_node``: topics, transforms and services around the filter."""
from __future__ import annotations

import functools
import heapq
import itertools
import math
import threading
import time
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import PoseWithCovarianceStamped, TransformStamped, TwistWithCovarianceStamped
from nav_msgs.msg import Odometry
from robot_localization.srv import SetPose, SetPoseResponse, ToggleFilterProcessing, ToggleFilterProcessingResponse
from sensor_msgs.msg import Imu
from std_srvs.srv import Empty, EmptyResponse
from tf2_msgs.msg import TFMessage

from m2wr_navigation.fusion.ekf import Ekf, Measurement
from m2wr_navigation.fusion.sources import Source, angles_of, matrix_of, rotation_of_state
from m2wr_node.ros.starting import start_node
from m2wr_node.ros.transform_buffer import TransformBuffer, fault_of, frame
from sensor_fusion.settings import Settings, SettingsError, Topic, read

_POLL = 0.002               # s of wall time between two looks at the clock
_MOST_WAITING = 2000        # measurements that may wait for the next turn of the filter
_SILENCE = 5.0              # s of wall time without a measurement after which a warning is due
_TYPES = {"odom": Odometry, "imu": Imu, "pose": PoseWithCovarianceStamped, "twist": TwistWithCovarianceStamped}


def _vector(value: Any) -> Any:
    return np.array([value.x, value.y, value.z])


def _matrix(value: Any) -> Any:
    return matrix_of((value.x, value.y, value.z, value.w))


class EkfNode:
    """Fuses what its topics say, and publishes ``odometry/filtered`` and a transform.

    Parameters
    ----------
    settings : Settings
    """

    def __init__(self, settings: Settings) -> None:
        self._settings, self._lock, self._count = settings, threading.Lock(), itertools.count()
        self._ekf = Ekf(settings.process_noise, settings.initial, settings.two_d_mode)
        self._waiting: List[Tuple[float, int, Measurement]] = []
        self._newest: Dict[str, float] = {}
        self._enabled, self._heard, self._next, self._now = True, time.monotonic(), -math.inf, -math.inf
        self._buffer = TransformBuffer(rospy.Duration(10.0))
        self._listener = tf2_ros.TransformListener(self._buffer)
        self._tf = rospy.Publisher("/tf", TFMessage, queue_size=10)
        self._output = rospy.Publisher("odometry/filtered", Odometry, queue_size=20)
        self._sources = {topic.name: Source(topic.settings) for topic in settings.topics}
        rospy.Service("set_pose", SetPose, self._on_set_pose_service)
        rospy.Service("~enable", Empty, self._on_enable)
        rospy.Service("~toggle", ToggleFilterProcessing, self._on_toggle)
        self._subscribers = [rospy.Subscriber("set_pose", PoseWithCovarianceStamped, self._on_set_pose, queue_size=1)]
        self._subscribers += [rospy.Subscriber(
            topic.topic, _TYPES[topic.kind], functools.partial(self._on_message, topic), queue_size=topic.queue,
            tcp_nodelay=True) for topic in settings.topics]

    # ---- messages ------------------------------------------------------------------------------------------------

    def _on_message(self, topic: Topic, message: Any) -> None:
        fault = fault_of(message.header)
        if fault:
            rospy.logwarn_throttle(10.0, "a message on %s is ignored: %s" % (topic.topic, fault))
            return
        stamp = message.header.stamp.to_sec()
        with self._lock:
            if not self._enabled or stamp < self._newest.get(topic.name, -math.inf):
                return
            try:
                found = self._measurements(topic, message, stamp)
            except tf2_ros.TransformException as error:
                rospy.logwarn_throttle(5.0, "a message on %s waits for a transform and is not used: %s" % (
                    topic.topic, error))
                return
            except ValueError as error:
                rospy.logwarn_throttle(10.0, "a message on %s is ignored: %s" % (topic.topic, error))
                return
            self._newest[topic.name] = stamp
            self._heard = time.monotonic()
            for measurement in found[:max(0, _MOST_WAITING - len(self._waiting))]:
                heapq.heappush(self._waiting, (stamp, next(self._count), measurement))

    def _measurements(self, topic: Topic, message: Any, stamp: float) -> List[Measurement]:
        source = self._sources[topic.name]
        if topic.kind == "imu":
            return self._from_imu(source, message, stamp)
        found: List[Measurement] = []
        if topic.kind in ("odom", "pose") and source.wants(0, 6):
            pose = message.pose.pose
            turned, shift = self._transform(self._settings.world_frame, message.header.frame_id, message.header.stamp)
            found += source.pose(stamp, turned @ _vector(pose.position) + shift, turned @ _matrix(pose.orientation),
                                 self._turned(turned, message.pose.covariance))
        if topic.kind in ("odom", "twist"):
            child = message.child_frame_id if topic.kind == "odom" else message.header.frame_id
            turned, _ = self._transform(self._settings.base_link_frame, child, message.header.stamp)
            twist = message.twist.twist
            found += source.twist(stamp, _vector(twist.linear), _vector(twist.angular), turned,
                                  np.reshape(message.twist.covariance, (6, 6)))
        return found

    @staticmethod
    def _turned(matrix: Any, covariance: Any) -> Any:
        both = np.zeros((6, 6))
        both[:3, :3] = both[3:, 3:] = matrix
        return both @ np.reshape(covariance, (6, 6)) @ both.T

    def _from_imu(self, source: Source, message: Imu, stamp: float) -> List[Measurement]:
        mounted, _ = self._transform(self._settings.base_link_frame, message.header.frame_id, message.header.stamp)
        found: List[Measurement] = []
        known = message.orientation_covariance[0] != -1.0
        sensor: Optional[Any] = _matrix(message.orientation) if known else None
        if sensor is not None and source.wants(0, 6):
            covariance = np.zeros((6, 6))
            covariance[3:, 3:] = np.reshape(message.orientation_covariance, (3, 3))
            found += source.pose(stamp, np.zeros(3), sensor @ mounted.T, covariance)
        if message.angular_velocity_covariance[0] != -1.0:
            found += source.turn(stamp, _vector(message.angular_velocity), mounted,
                                 np.reshape(message.angular_velocity_covariance, (3, 3)))
        if message.linear_acceleration_covariance[0] != -1.0:
            level = rotation_of_state(self._ekf.state) @ mounted if sensor is None else sensor
            found += source.acceleration(stamp, _vector(message.linear_acceleration), mounted,
                                         np.reshape(message.linear_acceleration_covariance, (3, 3)), level)
        return found

    def _transform(self, target: str, source: str, stamp: Any) -> Tuple[Any, Any]:
        """Return rotation and translation from one frame to another at a time, or the newest known."""
        source = frame(source) or target
        if source == target:
            return np.eye(3), np.zeros(3)
        try:
            found = self._buffer.lookup_transform_core(target, source, stamp).transform
        except tf2_ros.ExtrapolationException:
            found = self._buffer.lookup_transform_core(target, source, rospy.Time(0)).transform
        return _matrix(found.rotation), _vector(found.translation)

    # ---- services ------------------------------------------------------------------------------------------------

    def _on_set_pose(self, message: PoseWithCovarianceStamped) -> None:
        try:
            fault = fault_of(message.header)
            if fault:
                raise ValueError(fault)
            turned, shift = self._transform(self._settings.world_frame, message.header.frame_id, rospy.Time(0))
            pose = message.pose.pose
            values = np.concatenate([turned @ _vector(pose.position) + shift,
                                     angles_of(turned @ _matrix(pose.orientation))])
            if not np.isfinite(values).all() or not np.isfinite(message.pose.covariance).all():
                raise ValueError("it is not finite")
        except (ValueError, tf2_ros.TransformException) as error:
            rospy.logwarn("the pose on set_pose is ignored: %s", error)
            return
        with self._lock:
            self._forget()
            stamp = message.header.stamp.to_sec() or rospy.get_time()
            self._ekf.set_pose(stamp, values, np.reshape(message.pose.covariance, (6, 6)))

    def _on_set_pose_service(self, request: Any) -> Any:
        self._on_set_pose(request.pose)
        return SetPoseResponse()

    def _on_enable(self, _: Any) -> Any:
        with self._lock:
            self._enabled = True
        return EmptyResponse()

    def _on_toggle(self, request: Any) -> Any:
        with self._lock:
            self._enabled = request.on
        return ToggleFilterProcessingResponse(status=True)

    def _forget(self) -> None:
        """Forget measurements that wait and what sources remember; the caller holds the lock."""
        self._waiting.clear()
        self._newest.clear()
        for source in self._sources.values():
            source.reset()

    # ---- output --------------------------------------------------------------------------------------------------

    def turn(self) -> None:
        """Run the filter and publish, if the clock says so."""
        now = rospy.get_time()
        with self._lock:
            if now < self._now:
                rospy.logwarn("time jumped back by %.3f s: the filter begins again", self._now - now)
                self._forget()
                self._ekf.reset()
                self._next = -math.inf
            self._now = now
            if now < self._next:
                return
            self._next = max(self._next, now - 1.0 / self._settings.frequency) + 1.0 / self._settings.frequency
            while self._waiting and self._waiting[0][0] <= now:
                self._ekf.add(heapq.heappop(self._waiting)[2])
            self._warn_of_silence()
            if self._ekf.stamp is None or not self._enabled:
                return
            late = now - self._ekf.stamp > self._settings.sensor_timeout
            stamp = now if self._settings.predict_to_current_time or late else self._ekf.stamp
            state, covariance = self._ekf.predicted(stamp)
        self._publish(stamp, state, covariance)

    def _warn_of_silence(self) -> None:
        if time.monotonic() - self._heard > _SILENCE:
            self._heard = time.monotonic()
            rospy.logwarn_throttle(30.0, "no usable message on %s for %.0f s" % (
                ", ".join(rospy.resolve_name(topic.topic) for topic in self._settings.topics), _SILENCE))

    def _publish(self, stamp: float, state: Any, covariance: Any) -> None:
        if not np.isfinite(state).all():
            rospy.logerr_throttle(10.0, "the state is not finite: the filter begins again")
            with self._lock:
                self._forget()
                self._ekf.reset()
            return
        settings, when = self._settings, rospy.Time.from_sec(stamp)
        message = Odometry(child_frame_id=settings.base_link_frame)
        message.header.frame_id, message.header.stamp = settings.world_frame, when
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y, pose.position.z = state[:3]
        turned = pose.orientation
        turned.x, turned.y, turned.z, turned.w = _quaternion(rotation_of_state(state))
        twist.linear.x, twist.linear.y, twist.linear.z = state[6:9]
        twist.angular.x, twist.angular.y, twist.angular.z = state[9:12]
        message.pose.covariance = covariance[:6, :6].ravel().tolist()
        message.twist.covariance = covariance[6:12, 6:12].ravel().tolist()
        self._output.publish(message)
        if settings.publish_tf:
            self._publish_transform(message)

    def _publish_transform(self, message: Odometry) -> None:
        settings, pose = self._settings, message.pose.pose
        turned, place, child = _matrix(pose.orientation), _vector(pose.position), settings.base_link_frame
        transform = TransformStamped(header=message.header, child_frame_id=child)
        if settings.world_frame == settings.map_frame:
            try:
                base = self._buffer.lookup_transform_core(settings.base_link_frame, settings.odom_frame,
                                                          rospy.Time(0)).transform
            except tf2_ros.TransformException as error:
                rospy.logwarn_throttle(5.0, "no transform %s -> %s, as there is none from %s: %s" % (
                    settings.map_frame, settings.odom_frame, settings.odom_frame, error))
                return
            place = turned @ _vector(base.translation) + place
            turned, transform.child_frame_id = turned @ _matrix(base.rotation), settings.odom_frame
        quaternion = _quaternion(turned)
        rotation, shift = transform.transform.rotation, transform.transform.translation
        rotation.x, rotation.y, rotation.z, rotation.w = quaternion
        shift.x, shift.y, shift.z = place
        self._tf.publish(TFMessage([transform]))


def _quaternion(matrix: Any) -> Tuple[float, float, float, float]:
    """Return the quaternion (x, y, z, w) of a (3, 3) rotation."""
    roll, pitch, yaw = angles_of(matrix)
    (cr, sr), (cp, sp), (cy, sy) = [(math.cos(angle / 2), math.sin(angle / 2)) for angle in (roll, pitch, yaw)]
    return (sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy,
            cr * cp * cy + sr * sp * sy)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("ekf_localization_node")
    try:
        settings = read(dict(rospy.get_param("~", {}) or {}))
    except SettingsError as error:
        rospy.logfatal("%s: %s", rospy.get_name(), error)
        return 1
    for warning in settings.warnings:
        rospy.logwarn("%s: %s", rospy.get_name(), warning)
    node = EkfNode(settings)
    while not rospy.is_shutdown():
        try:
            node.turn()
        except rospy.ROSException:          # at the shutdown
            break
        rospy.rostime.wallsleep(_POLL)
    return 0

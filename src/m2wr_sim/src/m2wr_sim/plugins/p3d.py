# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_p3d.so: the true pose and velocity of a link as nav_msgs/Odometry."""
from __future__ import annotations

from typing import Optional, Tuple

from m2wr_sim.geometry import (
    Quaternion,
    Vector,
    conjugate,
    multiply,
    normalise_quaternion,
    quaternion_from_rpy,
    rotate_inverse,
)
from m2wr_sim.messages import Odometry
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import GapSchedule

_WORLD = ("world", "/world", "map", "/map")


class GroundTruth(Plugin):
    """Publishes the state before a step with the time of the step, while there are subscribers.

    As in Gazebo, ``xyzOffset`` is added along the axes of the reference frame. Only velocities have noise; they are in
    the axes of the reference frame, not of the link.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        body = spec.text("bodyName")
        self._link = ctx.link(body)
        topic = spec.text("topicName")
        frame = spec.text("frameName", "world")
        self._reference = None if frame in _WORLD else ctx.link(frame)
        self._offset = spec.vector("xyzOffset")
        self._rotation = quaternion_from_rpy(*spec.vector("rpyOffset"))
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        self._schedule = GapSchedule(spec.number("updateRate", 0.0), ctx.now_ns)
        self._rng = ctx.rng("noise")
        namespace = spec.spec.find("robotNamespace") or ""
        self._frame, self._child_frame = ctx.frame(frame, namespace), body
        covariance = [0.0] * 36
        covariance[::7] = [self._sigma * self._sigma] * 6
        self._covariance = covariance
        self._port = ctx.advertise(topic, Odometry, namespace=namespace)

    def next_before(self, now_ns: int) -> Optional[int]:
        return self._schedule.next_due(now_ns, self._ctx.step_ns) if self._port.wanted() else NEVER

    def before_step(self, now_ns: int) -> None:
        if not self._port.wanted() or not self._schedule.due(now_ns):
            return
        position, orientation, linear, angular = self._measure()
        noise = self._sigma * self._rng.standard_normal(6) if self._sigma else (0.0,) * 6
        message = Odometry()
        message.header.stamp, message.header.frame_id = self._ctx.moment(now_ns), self._frame
        message.child_frame_id = self._child_frame
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y, pose.position.z = position
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        twist.linear.x, twist.linear.y, twist.linear.z = (a + float(b) for a, b in zip(linear, noise[:3]))
        twist.angular.x, twist.angular.y, twist.angular.z = (a + float(b) for a, b in zip(angular, noise[3:]))
        message.pose.covariance = message.twist.covariance = self._covariance
        self._port.publish(message)

    def _measure(self) -> Tuple[Vector, Quaternion, Vector, Vector]:
        """Return position, orientation, linear and angular velocity in the reference frame, with offsets."""
        position, orientation, linear, angular = self._physics.link_state(self._link)
        if self._reference is not None:
            frame = self._physics.link_state(self._reference)
            back = frame.orientation
            position = rotate_inverse(back, _difference(position, frame.position))
            orientation = multiply(conjugate(back), orientation)
            linear = rotate_inverse(back, _difference(linear, frame.linear_velocity))
            angular = rotate_inverse(back, _difference(angular, frame.angular_velocity))
        position = (position[0] + self._offset[0], position[1] + self._offset[1], position[2] + self._offset[2])
        return position, normalise_quaternion(multiply(self._rotation, orientation)), linear, angular

    def reset(self, now_ns: int, rewound: bool) -> None:
        if rewound:
            self._schedule.restart(now_ns)
            self._rng = self._ctx.rng("noise")


def _difference(one: Vector, two: Vector) -> Vector:
    return one[0] - two[0], one[1] - two[1], one[2] - two[2]

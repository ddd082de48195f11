# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_diff_drive.so: two driven wheels, odometry, tf."""
from __future__ import annotations

import logging
import math
from typing import Any, Tuple

from m2wr_sim.control.diff_drive import CONVENTIONS, EncoderOdometry, is_swapped, ramp, wheel_speeds
from m2wr_sim.geometry import Quaternion, Vector, quaternion_from_rpy, yaw_of
from m2wr_sim.messages import JointState, Odometry
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.plugins.velocity_command import VelocityCommand
from m2wr_sim.runtime.schedule import StrictSchedule

_POSE_COVARIANCE = [0.0] * 36
for _index, _value in zip((0, 7, 14, 21, 28, 35), (1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3)):
    _POSE_COVARIANCE[_index] = _value


class DiffDrive(Plugin):
    """Emulates Gazebo's differential drive, tags, defaults and timing included."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        left_name, right_name = spec.text("leftJoint", "left_joint"), spec.text("rightJoint", "right_joint")
        self._left, self._right = driven_joint(ctx, spec, left_name), driven_joint(ctx, spec, right_name)
        self._joint_names = (right_name, left_name)
        self._separation = spec.length("wheelSeparation", 0.34)
        self._radius = 0.5 * spec.length("wheelDiameter", 0.15)
        self._acceleration = spec.number("wheelAcceleration", 0.0, minimum=0.0)
        self._torque = spec.number("wheelTorque", 5.0, minimum=0.0)
        self._schedule = StrictSchedule(spec.number("updateRate", 100.0), ctx.now_ns)
        encoder = spec.choice("odometrySource", ("encoder", "world"), "world") == "encoder"
        self._publish_odometry = spec.flag("publishTf", True)
        self._publish_tf = spec.flag("publishOdomTF", True) and self._publish_odometry
        self._publish_wheel_tf = spec.flag("publishWheelTF", False)
        publish_wheel_states = spec.flag("publishWheelJointState", False)
        self._namespace = namespace = spec.spec.find("robotNamespace") or ctx.model_name
        self._frame = ctx.frame(spec.text("odometryFrame", "odom"), namespace)
        self._child_frame = ctx.frame(spec.text("robotBaseFrame", "base_footprint"), namespace)
        self._choose_sides(spec, left_name, right_name)
        self._encoder = EncoderOdometry(self._separation, self._swapped) if encoder else None
        self._instructed = 0.0, 0.0
        self._command = VelocityCommand(ctx, spec.text("commandTopic", "cmd_vel"), namespace, ctx.command_timeout_ns)
        odometry_topic = spec.text("odometryTopic", "odom")
        self._odometry: Any = None
        self._states: Any = None
        if self._publish_odometry:
            self._odometry = ctx.advertise(odometry_topic, Odometry, namespace=namespace)
            self._message = Odometry(child_frame_id=self._child_frame)
            self._message.header.frame_id, self._message.pose.covariance = self._frame, _POSE_COVARIANCE
        if publish_wheel_states:
            self._states = ctx.advertise("joint_states", JointState, namespace=namespace)
        self.turn_wheels(0.0, 0.0)

    def _choose_sides(self, spec: PluginReader, left_name: str, right_name: str) -> None:
        """Choose the joint that is driven as the left wheel; log it if it is not the one on the left."""
        ctx = self._ctx
        if spec.spec.find("wheelConvention") is not None:       # the context has read it; this reports an invalid value
            spec.choice("wheelConvention", CONVENTIONS, ctx.wheel_convention)
        left_y, right_y = ctx.joint_position(left_name)[1], ctx.joint_position(right_name)[1]
        legacy = spec.flag("legacyMode", True) if spec.spec.find("legacyMode") is not None else None
        self._swapped = is_swapped(ctx.wheel_convention, legacy, left_y, right_y)
        if (left_y < right_y) != self._swapped:
            level, turns = logging.WARNING, "clockwise, against REP 103"
        else:
            level, turns = logging.INFO, "counter-clockwise, as REP 103 asks"
        if left_y < right_y:
            ctx.log_once(
                level, "%s: the joint tagged left (%s) is on the robot's RIGHT side (y = %+.3f m) and the one tagged "
                "right (%s) on its left (y = %+.3f m); with wheel_convention \"%s\" positive angular.z turns it %s. "
                "Set the parameter ~wheel_conventions/%s to noetic, kinetic or rep103 to choose.",
                ctx.model_name, left_name, left_y, right_name, right_y, ctx.wheel_convention, turns, ctx.model_name)
        elif self._swapped:
            ctx.log_once(level, "%s: wheel_convention \"%s\" exchanges left and right although %s is on the left; "
                         "positive angular.z turns it %s. Set ~wheel_conventions/%s to noetic or rep103.",
                         ctx.model_name, ctx.wheel_convention, left_name, turns, ctx.model_name)
        distance = abs(left_y - right_y)
        if distance > 0.0 and abs(distance / self._separation - 1.0) > 0.01:
            ctx.log_once(logging.WARNING, "%s: wheelSeparation is %g m but the wheel joints are %g m apart: the robot "
                         "turns %.2f times as fast as commanded.",
                         ctx.model_name, self._separation, distance, self._separation / distance)

    def command(self, linear: float, angular: float) -> None:
        """Set the velocity command from the next update on; an invalid one is rejected with a warning.

        Parameters
        ----------
        linear : float
            Forward speed [m/s] in the robot's frame.
        angular : float
            Rotation rate [rad/s], positive to the left.
        """
        self._command.set(linear, 0.0, angular)

    def next_before(self, now_ns: int) -> int:
        self._command.look(now_ns)
        if self._encoder is not None:
            return now_ns + self._ctx.step_ns
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def before_step(self, now_ns: int) -> None:
        if self._encoder is not None:
            rates = self._physics.joint_rate(self._left), self._physics.joint_rate(self._right)
            self._encoder.update(rates[0] * self._radius, rates[1] * self._radius, self._ctx.step_ns * 1e-9)
        elapsed_ns = self._schedule.elapsed(now_ns)
        if not self._schedule.due(now_ns):
            return
        stamp = self._ctx.moment(now_ns)
        if self._publish_odometry:
            self._send_odometry(stamp)
        if self._publish_wheel_tf:
            self._send_wheel_transforms(stamp)
        if self._states is not None:
            message = JointState(name=list(self._joint_names))
            message.header.stamp = stamp
            message.position = [self._physics.joint_angle(self._right), self._physics.joint_angle(self._left)]
            self._states.publish(message)
        self._drive(now_ns, elapsed_ns)

    def _drive(self, now_ns: int, elapsed_ns: int) -> None:
        """Convert the newest command to motor targets."""
        linear, _, angular = self._command.at(now_ns)
        target = wheel_speeds(linear, angular, self._separation, self._swapped)
        if self._acceleration > 0.0:
            current = (self._physics.joint_rate(self._left) * self._radius,
                       self._physics.joint_rate(self._right) * self._radius)
            limit = self._acceleration * elapsed_ns * 1e-9
            target, self._instructed = ramp(target, current, self._instructed, limit)
        self.turn_wheels(target[0] / self._radius, target[1] / self._radius)

    def turn_wheels(self, left: float, right: float) -> None:
        """Set the rates that the motors of both wheels try to reach.

        Parameters
        ----------
        left, right : float
            [rad/s]
        """
        self._physics.set_joint_motor(self._left, left, self._torque)
        self._physics.set_joint_motor(self._right, right, self._torque)

    @property
    def measures_truth(self) -> bool:
        """Whether the odometry is the true pose; otherwise it is integrated from the wheels."""
        return self._encoder is None

    def measure(self) -> Tuple[Vector, Quaternion, Vector]:
        """Return the odometry now.

        Returns
        -------
        position : (3,) float
            x, y, z [m] in the odometry frame.
        orientation : (4,) float
            Quaternion x y z w in the odometry frame.
        twist : (3,) float
            Linear x, y [m/s] and angular z [rad/s] in the robot's frame.
        """
        if self._encoder is not None:
            return ((self._encoder.x, self._encoder.y, 0.0), quaternion_from_rpy(0.0, 0.0, self._encoder.theta),
                    (self._encoder.linear_x, 0.0, self._encoder.angular_z))
        position, orientation, linear, angular = self._ctx.model_state()
        yaw = yaw_of(orientation)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        return position, orientation, (cosine * linear[0] + sine * linear[1], cosine * linear[1] - sine * linear[0],
                                       angular[2])

    def _send_odometry(self, stamp: Any) -> None:
        message = self._message
        message.header.stamp = stamp
        pose, twist = message.pose.pose, message.twist.twist
        position, orientation, (twist.linear.x, twist.linear.y, twist.angular.z) = self.measure()
        pose.position.x, pose.position.y, pose.position.z = position
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        if self._publish_tf:
            self._ctx.send_transform(stamp, self._frame, self._child_frame, position, orientation)
        self._odometry.publish(message)

    def _send_wheel_transforms(self, stamp: Any) -> None:
        """Publish the wheel frames as Gazebo does: the parent is the joint's parent link, the pose is in the model."""
        for name in self._joint_names:
            joint = self._ctx.joint_record(name)
            position, orientation = self._ctx.pose_in_model(self._ctx.link(joint.child))
            parent, child = (self._ctx.frame(name, self._namespace) for name in (joint.parent, joint.child))
            self._ctx.send_transform(stamp, parent, child, position, orientation)

    def reset(self, now_ns: int, rewound: bool) -> None:
        """Discard the command; as in Gazebo the motors keep their speed until the next update.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        rewound : bool
            Whether simulated time was set back to zero.
        """
        self._schedule.restart(now_ns)
        self._command.reset(now_ns)
        if self._encoder is not None:
            self._encoder.reset()
        for joint in (self._left, self._right):
            self._physics.set_joint_motor_force(joint, self._torque)

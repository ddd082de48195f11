# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_tricycle_drive.so: a driven and steered front wheel, two rear wheels with encoders, odometry, tf."""
from __future__ import annotations

import math
from typing import Any, Optional

from m2wr_sim.control.diff_drive import EncoderOdometry
from m2wr_sim.geometry import quaternion_from_rpy, yaw_of
from m2wr_sim.messages import JointState, Odometry
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.plugins.velocity_command import VelocityCommand
from m2wr_sim.ros_control.hardware import FASTEST_SERVO, UNBOUNDED_EFFORT
from m2wr_sim.runtime.schedule import StrictSchedule

_JOINTS = (("steeringJoint", "front_steering_joint"), ("actuatedWheelJoint", "front_wheel_joint"),
           ("encoderWheelLeftJoint", "left_rear_wheel_joint"), ("encoderWheelRightJoint", "right_rear_wheel_joint"))
_STEEPEST = 0.5 * math.pi       # rad, of the steering
_COVARIANCE = [0.0] * 36
_COVARIANCE[::7] = [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]


class Tricycle(Plugin):
    """Emulates Gazebo's tricycle drive: ``linear.x`` is the speed of the front wheel, ``angular.z`` its angle [rad].

    Without ``steeringSpeed`` a strong servo steers; Gazebo places the joint.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        self._names = [spec.text(tag, default) for tag, default in _JOINTS]
        self._joints = [driven_joint(ctx, spec, name) for name in self._names]
        self._steering, self._wheel, self._left, self._right = self._joints
        self._radius = 0.5 * spec.length("diameterActuatedWheel", 0.15)
        self._encoder_radius = 0.5 * spec.length("diameterEncoderWheel", 0.15)
        self._torque = spec.number("wheelTorque", 5.0, minimum=0.0)
        self._acceleration = spec.number("wheelAcceleration", 0.0, minimum=0.0)
        self._deceleration = spec.number("wheelDeceleration", self._acceleration, minimum=0.0)
        self._speed_tolerance = spec.number("wheelSpeedTolerance", 0.01, minimum=0.0)
        self._steering_speed = spec.number("steeringSpeed", 0.0, minimum=0.0)
        self._angle_tolerance = spec.number("steeringAngleTolerance", 0.01, minimum=0.0)
        separation = spec.length("separationEncoderWheel", 0.5)
        encoder = spec.choice("odometrySource", ("encoder", "world"), "world") == "encoder"
        self._encoder = EncoderOdometry(separation, False) if encoder else None
        self._publish_wheel_tf = spec.flag("publishWheelTF", False)
        wheel_states = spec.flag("publishWheelJointState", True)
        self._schedule = StrictSchedule(spec.number("updateRate", 100.0), ctx.now_ns)
        namespace = spec.spec.find("robotNamespace") or ctx.model_name
        self._frame = ctx.frame(spec.text("odometryFrame", "odom"), namespace)
        self._child_frame = ctx.frame(spec.text("robotBaseFrame", "base_link"), namespace)
        self._namespace = namespace
        self._command = VelocityCommand(ctx, spec.text("commandTopic", "cmd_vel"), namespace, ctx.command_timeout_ns)
        self._odometry = ctx.advertise(spec.text("odometryTopic", "odom"), Odometry, namespace=namespace)
        self._states: Any = ctx.advertise("joint_states", JointState, namespace=namespace) if wheel_states else None
        self._stop()

    def _stop(self) -> None:
        self._speed, self._angle, self._turned = 0.0, 0.0, 0.0
        self._physics.set_joint_motor(self._wheel, 0.0, self._torque)
        self._physics.set_joint_motor(self._steering, 0.0, UNBOUNDED_EFFORT)

    def next_before(self, now_ns: int) -> Optional[int]:
        self._command.look(now_ns)
        return now_ns + self._ctx.step_ns       # the servo of the steering, and the encoders

    def before_step(self, now_ns: int) -> None:
        dt = self._ctx.step_ns * 1e-9
        if self._encoder is not None:
            left, right = self._physics.joint_rate(self._left), self._physics.joint_rate(self._right)
            self._encoder.update(left * self._encoder_radius, right * self._encoder_radius, dt)
        elapsed = self._schedule.elapsed(now_ns) * 1e-9
        if self._schedule.due(now_ns):
            stamp = self._ctx.moment(now_ns)
            self._send_odometry(stamp)
            if self._publish_wheel_tf:
                self._send_wheel_transforms(stamp)
            self._send_states(stamp)
            speed, _, angle = self._command.at(now_ns)
            self._angle = min(_STEEPEST, max(-_STEEPEST, angle))
            self._drive(speed / self._radius, elapsed)
        self._steer(dt)

    def _drive(self, target: float, elapsed: float) -> None:
        """Set the speed of the front wheel [rad/s], within its acceleration."""
        present = self._physics.joint_rate(self._wheel)
        speed = target
        if self._acceleration > 0.0 and abs(target - present) >= max(self._speed_tolerance,
                                                                     self._acceleration * elapsed):
            rising = present < target
            speed = present + (self._acceleration if rising else -self._deceleration) * elapsed
        if speed != self._speed:
            self._speed = speed
            self._physics.set_joint_motor(self._wheel, speed, self._torque)

    def _steer(self, dt: float) -> None:
        """Turn the steering towards its angle: at ``steeringSpeed``, else as fast as a servo."""
        error = self._angle - self._physics.joint_angle(self._steering)
        fastest = self._steering_speed or FASTEST_SERVO
        rate = min(fastest, max(-fastest, error / dt))
        if self._steering_speed and abs(error) < self._angle_tolerance:
            rate = 0.0
        if rate != self._turned:
            self._turned = rate
            self._physics.set_joint_motor(self._steering, rate, UNBOUNDED_EFFORT)

    # ---- messages ---------------------------------------------------------------------------------------------------

    def _send_odometry(self, stamp: Any) -> None:
        message = Odometry(child_frame_id=self._child_frame)
        message.header.stamp, message.header.frame_id, message.pose.covariance = stamp, self._frame, _COVARIANCE
        pose, twist = message.pose.pose, message.twist.twist
        encoder = self._encoder
        if encoder is not None:
            position, orientation = (encoder.x, encoder.y, 0.0), quaternion_from_rpy(0.0, 0.0, encoder.theta)
            twist.linear.x, twist.angular.z = encoder.linear_x, encoder.angular_z
        else:
            position, orientation, linear, angular = self._ctx.model_state()
            yaw = yaw_of(orientation)
            cosine, sine = math.cos(yaw), math.sin(yaw)
            twist.linear.x = cosine * linear[0] + sine * linear[1]
            twist.linear.y = cosine * linear[1] - sine * linear[0]
            twist.angular.z = angular[2]
        pose.position.x, pose.position.y, pose.position.z = position
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        self._ctx.send_transform(stamp, self._frame, self._child_frame, position, orientation)
        self._odometry.publish(message)

    def _send_wheel_transforms(self, stamp: Any) -> None:
        for name in self._names:
            joint = self._ctx.joint_record(name)
            position, orientation = self._ctx.pose_in_model(self._ctx.link(joint.child))
            self._ctx.send_transform(stamp, self._ctx.frame(joint.parent, self._namespace),
                                     self._ctx.frame(joint.child, self._namespace), position, orientation)

    def _send_states(self, stamp: Any) -> None:
        if self._states is None or not self._states.wanted():
            return
        message = JointState(name=list(self._names),
                             position=[self._physics.joint_angle(joint) for joint in self._joints])
        message.header.stamp = stamp
        self._states.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        self._command.reset(now_ns)
        if self._encoder is not None:
            self._encoder.reset()
        self._stop()

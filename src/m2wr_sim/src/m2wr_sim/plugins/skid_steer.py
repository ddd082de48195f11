# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_skid_steer_drive.so: two driven wheels on each side, odometry, tf."""
from __future__ import annotations

import logging
import math
from typing import Any, List, Optional

from m2wr_sim.control.diff_drive import CONVENTIONS, is_swapped, wheel_speeds
from m2wr_sim.geometry import yaw_of
from m2wr_sim.messages import Odometry
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.plugins.velocity_command import VelocityCommand
from m2wr_sim.runtime.schedule import StrictSchedule

_WHEELS = (("leftFrontJoint", "left_front_joint"), ("rightFrontJoint", "right_front_joint"),
           ("leftRearJoint", "left_rear_joint"), ("rightRearJoint", "right_rear_joint"))


class SkidSteer(Plugin):
    """Emulates Gazebo's skid-steering drive; its rotation rate depends on the lateral slip of the wheels."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        names = [spec.text(tag, default) for tag, default in _WHEELS]
        self._joints = [driven_joint(ctx, spec, name) for name in names]
        self._separation = spec.length("wheelSeparation", 0.4)
        self._radius = 0.5 * spec.length("wheelDiameter", 0.15)
        self._torque = spec.number("torque", 5.0, minimum=0.0)
        self._schedule = StrictSchedule(spec.number("updateRate", 100.0), ctx.now_ns)
        self._publish_tf = spec.flag("broadcastTF", False)
        namespace = spec.spec.find("robotNamespace") or ""
        self._frame = ctx.frame(spec.text("odometryFrame", "odom"), namespace)
        self._child_frame = ctx.frame(spec.text("robotBaseFrame", "base_footprint"), namespace)
        x, y, yaw = (spec.number("covariance_" + name, default, minimum=0.0)
                     for name, default in (("x", 0.0001), ("y", 0.0001), ("yaw", 0.01)))
        self._covariance = [0.0] * 36
        self._covariance[::7] = [x, y, 1e12, 1e12, 1e12, yaw]
        self._choose_sides(spec, names)
        self._command = VelocityCommand(ctx, spec.text("commandTopic", "cmd_vel"), namespace, ctx.command_timeout_ns)
        self._port = ctx.advertise(spec.text("odometryTopic", "odom"), Odometry, namespace=namespace)
        for joint in self._joints:
            self._physics.set_joint_motor(joint, 0.0, self._torque)

    def _choose_sides(self, spec: PluginReader, names: List[str]) -> None:
        """Choose the wheels that are driven as left wheels; Gazebo's skid steering has no legacy mode."""
        ctx = self._ctx
        if spec.spec.find("wheelConvention") is not None:
            spec.choice("wheelConvention", CONVENTIONS, ctx.wheel_convention)
        y = [ctx.joint_position(name)[1] for name in names]
        left, right = 0.5 * (y[0] + y[2]), 0.5 * (y[1] + y[3])
        convention = "rep103" if ctx.wheel_convention == "rep103" else "noetic"
        self._swapped = is_swapped(convention, None, left, right)
        if left < right:
            level, turns = ((logging.INFO, "counter-clockwise") if self._swapped
                            else (logging.WARNING, "clockwise, against REP 103"))
            ctx.log_once(level, "%s: the joints tagged left (%s, %s) are on the robot's RIGHT side; with "
                         "wheel_convention \"%s\" positive angular.z turns it %s. Set the parameter "
                         "~wheel_conventions/%s to noetic or rep103 to choose.",
                         ctx.model_name, names[0], names[2], convention, turns, ctx.model_name)

    def next_before(self, now_ns: int) -> Optional[int]:
        self._command.look(now_ns)
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def before_step(self, now_ns: int) -> None:
        if not self._schedule.due(now_ns):
            return
        self._send_odometry(self._ctx.moment(now_ns))
        linear, _, angular = self._command.at(now_ns)
        left, right = wheel_speeds(linear, angular, self._separation, self._swapped)
        for joint, speed in zip(self._joints, (left, right, left, right)):
            self._physics.set_joint_motor(joint, speed / self._radius, self._torque)

    def _send_odometry(self, stamp: Any) -> None:
        position, orientation, linear, angular = self._ctx.model_state()
        yaw = yaw_of(orientation)
        cosine, sine = math.cos(yaw), math.sin(yaw)
        message = Odometry()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, self._frame, self._child_frame
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = position[:2]         # z stays 0, as in Gazebo
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        twist.linear.x = cosine * linear[0] + sine * linear[1]
        twist.linear.y = cosine * linear[1] - sine * linear[0]
        twist.angular.z = angular[2]
        message.pose.covariance = message.twist.covariance = self._covariance
        if self._publish_tf:
            self._ctx.send_transform(stamp, self._frame, self._child_frame, position, orientation)
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        self._command.reset(now_ns)
        if rewound:
            for joint in self._joints:
                self._physics.set_joint_motor(joint, 0.0, self._torque)

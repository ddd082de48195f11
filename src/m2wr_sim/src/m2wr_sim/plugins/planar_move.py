# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_planar_move.so: moves a model in the plane by velocity commands, without wheels; odometry, tf."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Optional, Tuple

from m2wr_sim.control.planar import twist_between, world_velocity
from m2wr_sim.geometry import yaw_of
from m2wr_sim.messages import Odometry
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.velocity_command import VelocityCommand
from m2wr_sim.runtime.schedule import GapSchedule

if TYPE_CHECKING:
    from m2wr_sim.physics.engine import LinkState

_COVARIANCE = [0.0] * 36
_COVARIANCE[::7] = [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]


class PlanarMove(Plugin):
    """Sets the velocity of the model before every step; contacts and joints can change it during the step."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx = ctx
        namespace = spec.spec.find("robotNamespace") or ""
        self._frame = ctx.frame(spec.text("odometryFrame", "odom"), namespace)
        self._child_frame = ctx.frame(spec.text("robotBaseFrame", "base_footprint"), namespace)
        rate = spec.number("odometryRate", 20.0)
        self._schedule = GapSchedule(rate, ctx.now_ns, strict=True) if rate > 0.0 else None
        timeout_ns = int(max(-1.0, min(1e9 * spec.number("cmdTimeout", -1.0), 1e18)))
        self._command = VelocityCommand(ctx, spec.text("commandTopic", "cmd_vel"), namespace,
                                        max(timeout_ns, 1) if timeout_ns >= 0 else ctx.command_timeout_ns,
                                        sideways=True)
        self._port = ctx.advertise(spec.text("odometryTopic", "odom"), Odometry, namespace=namespace)
        self._last = self._planar(ctx.model_state())

    @staticmethod
    def _planar(state: LinkState) -> Tuple[float, float, float]:
        return state.position[0], state.position[1], yaw_of(state.orientation)

    def next_before(self, now_ns: int) -> Optional[int]:
        self._command.look(now_ns)
        return now_ns + self._ctx.step_ns

    def before_step(self, now_ns: int) -> None:
        state = self._ctx.model_state()
        forward, left, rate = self._command.at(now_ns)
        x, y = world_velocity(yaw_of(state.orientation), forward, left)
        self._ctx.set_motion((x, y, 0.0), (0.0, 0.0, rate))
        if self._schedule is not None:
            elapsed = self._schedule.elapsed(now_ns) * 1e-9
            if self._schedule.due(now_ns):
                self._send_odometry(self._ctx.moment(now_ns), state, elapsed, rate)

    def _send_odometry(self, stamp: Any, state: LinkState, elapsed: float, rate: float) -> None:
        now = self._planar(state)
        twist = twist_between(self._last, now, elapsed)
        if rate > math.pi / elapsed:                            # more than pi between two messages
            twist = (twist[0], twist[1], rate)
        self._last = now
        message = Odometry()
        message.header.stamp, message.header.frame_id, message.child_frame_id = stamp, self._frame, self._child_frame
        pose = message.pose.pose
        pose.position.x, pose.position.y = state.position[:2]   # z stays 0, as in Gazebo
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = state.orientation
        message.twist.twist.linear.x, message.twist.twist.linear.y, message.twist.twist.angular.z = twist
        message.pose.covariance = _COVARIANCE
        self._ctx.send_transform(stamp, self._frame, self._child_frame, state.position, state.orientation)
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._command.reset(now_ns)
        self._last = self._planar(self._ctx.model_state())
        if self._schedule is not None:
            self._schedule.restart(now_ns)

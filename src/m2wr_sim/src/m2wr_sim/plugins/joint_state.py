# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_joint_state_publisher.so, also used for robots without such a plugin."""
from __future__ import annotations

from typing import Optional

from m2wr_sim.messages import JointState
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import StrictSchedule


class JointStatePublisher(Plugin):
    """Publishes positions and velocities of the named joints while there are subscribers."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx = ctx
        self._names = [name for name in spec.text("jointName").replace(" ", "").split(",") if name]
        self._joints = [ctx.joint(name) for name in self._names]
        self._schedule = StrictSchedule(spec.number("updateRate", 100.0), ctx.now_ns)
        namespace = spec.spec.find("robotNamespace") or ctx.model_name
        self._port = ctx.advertise("joint_states", JointState, queue_size=1000, namespace=namespace)
        self._message, self._awake = JointState(name=self._names), False

    def next_before(self, now_ns: int) -> Optional[int]:
        if not self._port.wanted():
            self._awake = False
            return NEVER
        if not self._awake:
            self._awake = True
            self._schedule.skip(now_ns)         # keeps the phase of the robot's drive
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def before_step(self, now_ns: int) -> None:
        if not self._awake or not self._schedule.due(now_ns):
            return
        physics = self._ctx.physics
        message = self._message
        message.header.stamp = self._ctx.moment(now_ns)
        message.position = [physics.joint_angle(joint) for joint in self._joints]
        message.velocity = [physics.joint_rate(joint) for joint in self._joints]
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)

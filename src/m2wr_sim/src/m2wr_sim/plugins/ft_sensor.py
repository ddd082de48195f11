# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_ft_sensor.so: force and torque in a joint as geometry_msgs/WrenchStamped."""
from __future__ import annotations

from typing import Optional

from m2wr_sim.geometry import cross, rotate_inverse
from m2wr_sim.messages import WrenchStamped
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import GapSchedule


class JointWrench(Plugin):
    """Publishes the wrench of the child link on the parent link, in the child's axes, about the joint.

    It measures only while there are subscribers.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        name = spec.text("jointName")
        self._joint = ctx.joint(name)
        record = ctx.joint_record(name)
        self._child = ctx.link(record.child)
        centre = ctx.link_record(record.child).inertial.pose[0]
        self._lever = tuple(a - b for a, b in zip(centre, record.pose[0]))      # from the joint, in the child's axes
        topic = spec.text("topicName")
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        self._rng = ctx.rng("noise")
        self._schedule = GapSchedule(spec.number("updateRate", 0.0), ctx.now_ns)
        namespace = spec.spec.find("robotNamespace") or ""
        self._frame = ctx.frame(record.child, namespace)
        self._port = ctx.advertise(topic, WrenchStamped, namespace=namespace)
        self._physics.feel_joint(self._joint)

    def next_before(self, now_ns: int) -> Optional[int]:
        return self._schedule.next_due(now_ns, self._ctx.step_ns) if self._port.wanted() else NEVER

    def before_step(self, now_ns: int) -> None:
        if not self._port.wanted() or not self._schedule.due(now_ns):
            return
        force, torque = self._physics.joint_wrench(self._joint)
        orientation = self._physics.link_pose(self._child)[1]
        force, torque = rotate_inverse(orientation, force), rotate_inverse(orientation, torque)
        total = tuple(a + b for a, b in zip(torque, cross(self._lever, force)))
        values = [-value for value in force + total]
        if self._sigma:
            values = [a + float(b) for a, b in zip(values, self._sigma * self._rng.standard_normal(6))]
        message = WrenchStamped()
        message.header.stamp, message.header.frame_id = self._ctx.moment(now_ns), self._frame
        wrench = message.wrench
        wrench.force.x, wrench.force.y, wrench.force.z = values[:3]
        wrench.torque.x, wrench.torque.y, wrench.torque.z = values[3:]
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        if rewound:
            self._rng = self._ctx.rng("noise")

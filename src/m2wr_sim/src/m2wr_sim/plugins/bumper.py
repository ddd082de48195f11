# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_bumper.so: contacts of the collisions of a contact sensor, as gazebo_msgs/ContactsState."""
from __future__ import annotations

from typing import Any, Sequence

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Quaternion, rotate_inverse
from m2wr_sim.messages import ContactsState, ContactState, Vector3, Wrench
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import SensorSchedule

#: Text of a state, as in Gazebo: index, number of states, own and other collision, seconds, nanoseconds.
_INFO = "Debug:  i:(%d/%d)     my geom:%s   other geom:%s         time:%d.%09d\n"


class Bumper(LazySensor):
    """Publishes one state for each pair of collisions that was in contact since the last message.

    The first name of a state is always the sensor's own collision. Positions and normals are in the world frame;
    normals point into the own collision. Wrenches act on the own link, in its axes, about its centre of mass.
    ``frameName`` does not change that; it is only a label, as in Gazebo.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.kind != "contact":
            raise PluginError("%s: a bumper plugin must be in a <sensor type=\"contact\">" % spec.spec.where)
        self._ctx, self._physics = ctx, ctx.physics
        namespace = spec.spec.find("robotNamespace") or ""
        topic = spec.text("bumperTopicName", "bumper_states")
        self._frame = ctx.frame(spec.text("frameName", "world"), namespace)
        self._schedule = SensorSchedule(ctx.sensor.update_rate)
        wanted = ctx.sensor.contact_collisions
        missing = [name for name in wanted if name not in ctx.sensor_collisions]
        if missing or not wanted:
            ctx.log.warning("%s: sensor %s: <contact> names %s; the link has the collisions %s. Other collisions "
                            "never report a contact.", spec.spec.where, ctx.sensor.name,
                            ", ".join(missing) or "no <collision>", ", ".join(ctx.sensor_collisions) or "none")
        self._port = ctx.advertise(topic, ContactsState, namespace=namespace)
        self._watch = self._physics.watch_contacts([ctx.collision_name(name) for name in wanted])

    def wanted(self) -> bool:
        return self._port.wanted()

    def wake(self, now_ns: int) -> None:
        self._schedule.restart()
        self._watch.drain()

    def next_reading(self, now_ns: int) -> int:
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def after_step(self, now_ns: int) -> None:
        if not self.awake or not self._schedule.due(now_ns):
            return
        message = ContactsState()
        message.header.stamp, message.header.frame_id = self._ctx.moment(now_ns), self._frame
        orientation = self._physics.link_pose(self._ctx.sensor_link)[1]
        pairs = self._watch.drain()
        for index, pair in enumerate(pairs):
            message.states.append(self._state(pair, orientation, _INFO % (
                (index, len(pairs), pair[0].first, pair[0].second) + divmod(now_ns, 1000000000))))
        self._port.publish(message)

    @staticmethod
    def _state(pair: Sequence[Any], orientation: Quaternion, info: str) -> ContactState:
        state = ContactState(info=info, collision1_name=pair[0].first, collision2_name=pair[0].second)
        total = [0.0] * 6
        for report in pair:
            values = rotate_inverse(orientation, report.force) + rotate_inverse(orientation, report.torque)
            total = [a + b for a, b in zip(total, values)]
            state.wrenches.append(Wrench(Vector3(*values[:3]), Vector3(*values[3:])))
            state.contact_positions.append(Vector3(*report.position))
            state.contact_normals.append(Vector3(*report.normal))
            state.depths.append(report.depth)
        state.total_wrench = Wrench(Vector3(*total[:3]), Vector3(*total[3:]))
        return state

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._watch.drain()
        if rewound:
            self._schedule.restart()

    def close(self) -> None:
        self._physics.end_watch(self._watch)

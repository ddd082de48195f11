# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_force.so: applies a wrench from a topic to a link in every step."""
from __future__ import annotations

from typing import Optional

from m2wr_sim.messages import Wrench
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.plugins.rejections import Rejections
from m2wr_sim.runtime.limits import strongest

_ZERO = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Force(Plugin):
    """Applies the newest geometry_msgs/Wrench, in world axes at the centre of mass.

    A wrench that would make the simulation diverge in a few steps is rejected. A wrench ends when its link has become
    too fast.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._name = ctx, spec.text("bodyName")
        self._link = ctx.link(self._name)
        self._wrench, self._now_ns = _ZERO, ctx.now_ns
        self._rejections = Rejections(ctx)
        ctx.subscribe(spec.text("topicName"), Wrench, self._store, spec.spec.find("robotNamespace") or "")

    def _store(self, message: Wrench) -> None:
        force, torque = message.force, message.torque
        wrench = ((force.x, force.y, force.z), (torque.x, torque.y, torque.z))
        limits = strongest(self._ctx.link_record(self._name).inertial, self._ctx.step_ns * 1e-9)
        if all(abs(value) <= limit for vector, limit in zip(wrench, limits) for value in vector):
            self._wrench = wrench
            return
        self._rejections.warn(
            self._now_ns, "%s: wrench %s on %s rejected; expected at most %g N and %g N m; %s stays active",
            self._ctx.model_name, wrench, self._name, *(limits + (self._wrench,)))

    def next_before(self, now_ns: int) -> Optional[int]:
        self._now_ns = now_ns
        return NEVER if self._wrench == _ZERO else now_ns + self._ctx.step_ns

    def before_step(self, now_ns: int) -> None:
        state = self._ctx.physics.link_state(self._link)
        if all(abs(value) <= FASTEST for value in state.linear_velocity + state.angular_velocity):
            self._ctx.physics.add_link_force(self._link, *self._wrench)
            return
        self._ctx.log.warning("%s: wrench %s ended: %s moves at %s m/s and rotates at %s rad/s, more than %g",
                              self._ctx.model_name, self._wrench, self._name, state.linear_velocity,
                              state.angular_velocity, FASTEST)
        self._wrench = _ZERO

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._wrench, self._now_ns = _ZERO, now_ns
        self._rejections.reset()

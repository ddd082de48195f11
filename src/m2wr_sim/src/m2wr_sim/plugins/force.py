# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_force.so: a wrench from a topic, applied to a link in every step."""
from geometry_msgs.msg import Wrench

from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import NEVER, Plugin
from m2wr_sim.runtime.limits import strongest

_REFUSAL_PAUSE_NS = 5000000000
_NONE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Force(Plugin):
    """The newest geometry_msgs/Wrench, in world axes at the centre of mass, until another comes.

    No message may end the world: what would tear it apart in a few steps is refused, and a wrench ends when the link
    has become too fast under it.
    """

    def configure(self, spec, ctx):
        self._ctx, self._name = ctx, spec.text("bodyName")
        self._link = ctx.link(self._name)
        self._wrench, self._now_ns, self._refused_ns = _NONE, ctx.now_ns, None
        ctx.subscribe(spec.text("topicName"), Wrench, self._store, spec.spec.find("robotNamespace") or "")

    def _store(self, message):
        force, torque = message.force, message.torque
        wrench = ((force.x, force.y, force.z), (torque.x, torque.y, torque.z))
        limits = strongest(self._ctx.link_record(self._name).inertial, self._ctx.step_ns * 1e-9)
        if all(abs(value) <= limit for vector, limit in zip(wrench, limits) for value in vector):
            self._wrench = wrench
        elif self._refused_ns is None or self._now_ns - self._refused_ns >= _REFUSAL_PAUSE_NS:
            self._refused_ns = self._now_ns
            self._ctx.log.warning("%s: wrench %s on %s is refused; expected at most %g N and %g N m; %s holds",
                                  self._ctx.model_name, wrench, self._name, *(limits + (self._wrench,)))

    def next_before(self, now_ns):
        self._now_ns = now_ns
        return NEVER if self._wrench == _NONE else now_ns + self._ctx.step_ns

    def before_step(self, now_ns):
        state = self._ctx.physics.link_state(self._link)
        if all(abs(value) <= FASTEST for value in state.linear_velocity + state.angular_velocity):
            self._ctx.physics.add_link_force(self._link, *self._wrench)
            return
        self._ctx.log.warning("%s: wrench %s ends: %s moves at %s m/s and turns at %s rad/s, more than %g",
                              self._ctx.model_name, self._wrench, self._name, state.linear_velocity,
                              state.angular_velocity, FASTEST)
        self._wrench = _NONE

    def reset(self, now_ns, rewound):
        self._wrench, self._now_ns, self._refused_ns = _NONE, now_ns, None

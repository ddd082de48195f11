"""libgazebo_ros_force.so: a wrench from a topic, applied to a link in every step."""
import math

from geometry_msgs.msg import Wrench

from m2wr_sim.plugins.base import NEVER, Plugin

_NONE = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))


class Force(Plugin):
    """The newest geometry_msgs/Wrench, in world axes at the centre of mass, until another comes."""

    def configure(self, spec, ctx):
        self._ctx = ctx
        self._link = ctx.link(spec.text("bodyName"))
        self._wrench = _NONE
        ctx.subscribe(spec.text("topicName"), Wrench, self._store, spec.spec.find("robotNamespace") or "")

    def _store(self, message):
        force, torque = message.force, message.torque
        wrench = ((force.x, force.y, force.z), (torque.x, torque.y, torque.z))
        if all(math.isfinite(value) for vector in wrench for value in vector):
            self._wrench = wrench
        else:
            self._ctx.log.warning("%s: wrench %s is not finite and is refused; %s holds", self._ctx.model_name, wrench,
                                  self._wrench)

    def next_before(self, now_ns):
        return NEVER if self._wrench == _NONE else now_ns + self._ctx.step_ns

    def before_step(self, now_ns):
        self._ctx.physics.add_link_force(self._link, *self._wrench)

    def reset(self, now_ns, rewound):
        self._wrench = _NONE

# SPDX-License-Identifier: BSD-3-Clause
"""The velocity command of a drive plugin: the newest one that makes sense, for as long as it holds."""
from geometry_msgs.msg import Twist

from m2wr_sim.physics.engine import FASTEST

_REFUSAL_PAUSE_NS = 5000000000
_REST = (0.0, 0.0, 0.0)


class VelocityCommand:
    """Listens to a geometry_msgs/Twist topic.

    Parameters
    ----------
    ctx : PluginContext
    topic, namespace : str
    timeout_ns : int
        How long a command holds [ns]; 0: for ever.
    """

    def __init__(self, ctx, topic, namespace, timeout_ns=0):
        self._ctx, self._timeout_ns = ctx, timeout_ns
        self._values, self._since_ns, self._now_ns, self._refused_ns = _REST, ctx.now_ns, ctx.now_ns, None
        ctx.subscribe(topic, Twist, self._store, namespace)

    def _store(self, message):
        values = message.linear.x, message.linear.y, message.angular.z
        if all(abs(value) <= FASTEST for value in values):      # false for what is no number, too
            self._values, self._since_ns = values, None     # `look`, which follows, tells the time
        elif self._refused_ns is None or self._now_ns - self._refused_ns >= _REFUSAL_PAUSE_NS:
            self._refused_ns = self._now_ns
            self._ctx.log.warning("%s: velocity command linear %g, %g, angular %g is refused; expected at most %g m/s "
                                  "and rad/s; %g, %g, %g holds",
                                  self._ctx.model_name, *(values + (FASTEST,) + self._values))

    def look(self, now_ns):
        """Note the time; to be called in ``next_before``, which follows the arrival of commands."""
        self._now_ns = now_ns
        if self._since_ns is None:
            self._since_ns = now_ns

    def at(self, now_ns):
        """Return what holds at ``now_ns``: linear x, linear y [m/s], angular z [rad/s]."""
        since_ns = now_ns if self._since_ns is None else self._since_ns
        return _REST if self._timeout_ns and now_ns - since_ns > self._timeout_ns else self._values

    def reset(self, now_ns):
        """Forget the command."""
        self._values, self._since_ns, self._now_ns, self._refused_ns = _REST, now_ns, now_ns, None

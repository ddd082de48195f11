# SPDX-License-Identifier: BSD-3-Clause
"""The velocity command of a drive plugin: the newest valid one, until it times out."""
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
    sideways : bool
        Whether the drive uses ``linear.y``; otherwise it is taken as 0, whatever a message says.
    """

    def __init__(self, ctx, topic, namespace, timeout_ns=0, sideways=False):
        self._ctx, self._timeout_ns, self._sideways = ctx, timeout_ns, sideways
        self._values, self._since_ns, self._now_ns, self._refused_ns = _REST, ctx.now_ns, ctx.now_ns, None
        ctx.subscribe(topic, Twist, self._store, namespace)

    def _store(self, message):
        self.set(message.linear.x, message.linear.y if self._sideways else 0.0, message.angular.z)

    def set(self, forward, left, turn):
        """Take a command [m/s, m/s, rad/s] that holds from now on; refuse numbers that are not finite or too large."""
        values = forward, left, turn
        if all(abs(value) <= FASTEST for value in values):      # false for what is no number, too
            self._values, self._since_ns = values, None     # `look`, which follows, tells the time
        elif self._refused_ns is None or self._now_ns - self._refused_ns >= _REFUSAL_PAUSE_NS:
            self._refused_ns = self._now_ns
            self._ctx.log.warning("%s: refused a velocity command with %s; expected finite numbers of at most %g m/s "
                                  "and rad/s. The last valid command (%s) stays.", self._ctx.model_name,
                                  self._text(values), FASTEST, self._text(self._values))

    def _text(self, values):
        """Return a command by the names of its fields, without ``linear.y`` where the drive does not use it."""
        forward, left, turn = values
        sideways = "linear.y = %s, " % left if self._sideways else ""
        return "linear.x = %s, %sangular.z = %s" % (forward, sideways, turn)

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

# SPDX-License-Identifier: BSD-3-Clause
"""The velocity command of a drive plugin: the newest valid one, until it times out."""
from __future__ import annotations

from typing import Optional

from m2wr_sim.geometry import Vector
from m2wr_sim.messages import Twist
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.plugins.base import PluginContext
from m2wr_sim.plugins.rejections import Rejections

_REST = (0.0, 0.0, 0.0)


class VelocityCommand:
    """Subscribes to a geometry_msgs/Twist topic.

    Parameters
    ----------
    ctx : PluginContext
    topic, namespace : str
    timeout_ns : int
        Time [ns] after which a command ends; 0: never.
    sideways : bool
        Whether the drive uses ``linear.y``; otherwise it is ignored.
    """

    def __init__(self, ctx: PluginContext, topic: str, namespace: str, timeout_ns: int = 0,
                 sideways: bool = False) -> None:
        self._ctx, self._timeout_ns, self._sideways = ctx, timeout_ns, sideways
        self._values, self._now_ns = _REST, ctx.now_ns
        self._since_ns: Optional[int] = ctx.now_ns
        self._rejections = Rejections(ctx)
        ctx.subscribe(topic, Twist, self._store, namespace)

    def _store(self, message: Twist) -> None:
        self.set(message.linear.x, message.linear.y if self._sideways else 0.0, message.angular.z)

    def set(self, forward: float, left: float, rate: float) -> None:
        """Set the command; numbers that are not finite or too large are rejected with a warning.

        Parameters
        ----------
        forward, left : float
            Speeds [m/s] in the robot's frame.
        rate : float
            Rotation rate [rad/s], positive to the left.
        """
        values = forward, left, rate
        if abs(forward) <= FASTEST and abs(left) <= FASTEST and abs(rate) <= FASTEST:   # false for nan too
            self._values, self._since_ns = values, None     # `look` sets the time
            return
        self._rejections.warn(
            self._now_ns, "%s: refused a velocity command with %s; expected finite numbers of at most %g m/s and "
            "rad/s. The last valid command (%s) stays.", self._ctx.model_name, self._text(values), FASTEST,
            self._text(self._values))

    def _text(self, values: Vector) -> str:
        """Return a command with the names of its fields, without ``linear.y`` if the drive does not use it."""
        forward, left, rate = values
        sideways = "linear.y = %s, " % left if self._sideways else ""
        return "linear.x = %s, %sangular.z = %s" % (forward, sideways, rate)

    @property
    def expires(self) -> bool:
        """Whether a command ends some time after it was set."""
        return self._timeout_ns > 0

    def look(self, now_ns: int) -> None:
        """Store the time; call it in ``next_before``, which runs after commands have arrived."""
        self._now_ns = now_ns
        if self._since_ns is None:
            self._since_ns = now_ns

    def at(self, now_ns: int) -> Vector:
        """Return the command in effect at ``now_ns``: linear x, linear y [m/s], angular z [rad/s]."""
        since_ns = now_ns if self._since_ns is None else self._since_ns
        return _REST if self._timeout_ns and now_ns - since_ns > self._timeout_ns else self._values

    def reset(self, now_ns: int) -> None:
        """Discard the command."""
        self._values, self._since_ns, self._now_ns = _REST, now_ns, now_ns
        self._rejections.reset()

# SPDX-License-Identifier: BSD-3-Clause
"""Limits of a joint's commands: saturation and soft limits as ros_control's joint_limits_interface applies them."""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, Mapping, Optional, Tuple

from m2wr_sim.errors import PluginError


@dataclass(frozen=True)
class JointLimits:
    """Limits of a joint [rad or m, s, N m or N]; None where there is none.

    ``soft`` is (lower position, upper position) of ``<safety_controller>``, with the gains ``k_position`` [1/s] and
    ``k_velocity`` [N m s/rad or N s/m].
    """

    position: Optional[Tuple[float, float]] = None
    velocity: Optional[float] = None
    acceleration: Optional[float] = None
    effort: Optional[float] = None
    soft: Optional[Tuple[float, float]] = None
    k_position: float = 0.0
    k_velocity: float = 0.0

    @property
    def any(self) -> bool:
        """Whether there is a limit at all."""
        return self != JointLimits()

    def position_command(self, command: float, last: float, dt: float) -> float:
        """Return a position command within the limits; ``last`` is the previous one, ``dt`` [s] the time since.

        Parameters
        ----------
        command : float
        last : float
            The previous command.
        dt : float
            Time since the last call [s].
        """
        low, high = self.position or (-math.inf, math.inf)
        if self.soft is not None and self.velocity is not None:
            slow, fast = self._soft_velocities(last)
            low, high = max(low, last + slow * dt), min(high, last + fast * dt)
        elif self.velocity is not None:
            low, high = max(low, last - self.velocity * dt), min(high, last + self.velocity * dt)
        return max(low, min(high, command))

    def velocity_command(self, command: float, last: float, position: float, dt: float) -> float:
        """Return a velocity command within the limits; ``last`` is the previous one.

        Parameters
        ----------
        command : float
        last : float
            The previous command.
        position : float
            Of the joint [rad or m].
        dt : float
            Time since the last call [s].
        """
        low, high = (-math.inf, math.inf) if self.velocity is None else (-self.velocity, self.velocity)
        if self.soft is not None:
            low, high = self._soft_velocities(position)
        if self.acceleration is not None:
            low, high = max(low, last - self.acceleration * dt), min(high, last + self.acceleration * dt)
        return max(low, min(high, command))

    def effort_command(self, command: float, position: float, velocity: float) -> float:
        """Return an effort within the limits: none outwards beyond a position limit or above the greatest velocity.

        Parameters
        ----------
        command : float
        position : float
            Of the joint [rad or m].
        velocity : float
            Of the joint [rad/s or m/s].
        """
        low, high = (-math.inf, math.inf) if self.effort is None else (-self.effort, self.effort)
        if self.soft is not None:
            slow, fast = self._soft_velocities(position)
            most = math.inf if self.effort is None else self.effort
            low = max(-most, min(most, -self.k_velocity * (velocity - slow)))
            high = max(-most, min(most, -self.k_velocity * (velocity - fast)))
        else:
            lower, upper = self.position or (-math.inf, math.inf)
            fastest = math.inf if self.velocity is None else self.velocity
            if position < lower or velocity < -fastest:
                low = 0.0
            if position > upper or velocity > fastest:
                high = 0.0
        return max(low, min(high, command))

    def _soft_velocities(self, position: float) -> Tuple[float, float]:
        """Return the least and greatest velocity at a position, from the soft limits."""
        assert self.soft is not None
        most = math.inf if self.velocity is None else self.velocity
        return (max(-most, min(most, -self.k_position * (position - self.soft[0]))),
                max(-most, min(most, -self.k_position * (position - self.soft[1]))))


def with_parameters(limits: JointLimits, values: Any, where: str) -> JointLimits:
    """Return limits changed by the parameters ``joint_limits/JOINT``.

    Parameters
    ----------
    limits : JointLimits
        Of the description.
    values : object
        Value of the parameter: a mapping, or None.
    where : str
        Name of the parameter, for messages.

    Raises
    ------
    PluginError
        If a value is not a number, or a limit that is switched on has no value.
    """
    if values is None:
        return limits
    if not isinstance(values, Mapping):
        raise PluginError("%s: read %r; expected a mapping of limits" % (where, values))

    def number(name: str) -> float:
        value = values.get(name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
            raise PluginError("%s/%s: read %r; expected a finite number" % (where, name, value))
        return float(value)

    for switch, field, names in (("has_position_limits", "position", ("min_position", "max_position")),
                                 ("has_velocity_limits", "velocity", ("max_velocity",)),
                                 ("has_acceleration_limits", "acceleration", ("max_acceleration",)),
                                 ("has_effort_limits", "effort", ("max_effort",))):
        if switch in values:
            wanted = bool(values[switch]) and not (field == "position" and values.get("angle_wraparound", False))
            found = tuple(number(name) for name in names) if wanted else (None,)
            changed: Any = {field: found if len(found) == 2 else found[0]}
            limits = replace(limits, **changed)
    if limits.position is not None and limits.position[0] > limits.position[1]:
        raise PluginError("%s: read min_position %g above max_position %g; expected the opposite"
                          % ((where,) + limits.position))
    if values.get("has_soft_limits", False):
        limits = replace(limits, soft=(number("soft_lower_limit"), number("soft_upper_limit")),
                         k_position=number("k_position"), k_velocity=number("k_velocity"))
    return limits

# SPDX-License-Identifier: BSD-3-Clause
"""Velocity from the displacement of a marker."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Tuple

AXES = ("x", "y", "z")


class ConfigurationError(ValueError):
    """A parameter cannot be used; the message says which, and what is expected."""


@dataclass(frozen=True)
class Settings:
    """Scales and limits.

    Attributes
    ----------
    scales : dict
        Axis -> velocity for each metre of displacement [1/s]; axes that are not in it do not move.
    fastest, slowest : dict
        Axis -> greatest and least velocity [m/s].
    turn_scale, fastest_turn : float
        Rate for each radian [1/s], and its limit [rad/s].
    """

    scales: Dict[str, float]
    fastest: Dict[str, float]
    slowest: Dict[str, float]
    turn_scale: float
    fastest_turn: float

    def velocity(self, position: Tuple[float, float, float], yaw: float) -> Tuple[float, float, float, float]:
        """Return the linear velocity in x, y, z [m/s], and the rate about z [rad/s].

        Parameters
        ----------
        position : (3,) of float
            Of the marker in the frame of the robot [m].
        yaw : float
            Its heading there [rad].
        """
        x, y, z = (min(self.fastest[axis], max(self.slowest[axis], self.scales.get(axis, 0.0) * value))
                   for axis, value in zip(AXES, position))
        return x, y, z, min(self.fastest_turn, max(-self.fastest_turn, self.turn_scale * yaw))


def read_settings(parameters: Mapping[str, Any]) -> Settings:
    """Read the node's private parameters.

    Parameters
    ----------
    parameters : dict
        By name without ``~``; unknown names have no meaning here.

    Raises
    ------
    ConfigurationError
        If a value is not a finite number, or a dictionary of such numbers for x, y, z.
    """
    scales = _by_axis(parameters, "linear_scale", 1.0)
    fastest = _by_axis(parameters, "max_positive_linear_velocity", 1.0)
    slowest = _by_axis(parameters, "max_negative_linear_velocity", -1.0)
    return Settings(scales, {axis: max(0.0, fastest.get(axis, 1.0)) for axis in AXES},
                    {axis: min(0.0, slowest.get(axis, -1.0)) for axis in AXES},
                    _number("angular_scale", parameters.get("angular_scale", 2.2)),
                    abs(_number("max_angular_velocity", parameters.get("max_angular_velocity", 2.2))))


def _by_axis(parameters: Mapping[str, Any], name: str, default: float) -> Dict[str, float]:
    given = parameters.get(name, default)
    if not isinstance(given, dict):
        return {"x": _number(name, given)}
    for axis in given:
        if axis not in AXES:
            raise ConfigurationError("~%s has the entry %.60r; expected some of x, y, z" % (name, axis))
    return {axis: _number("%s/%s" % (name, axis), value) for axis, value in given.items()}


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigurationError("~%s is %.60r; expected a finite number" % (name, value))
    return float(value)

# SPDX-License-Identifier: BSD-3-Clause
"""Which axis and button of a joystick means which velocity."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Dict, Mapping, Optional, Sequence, Tuple

LINEAR, ANGULAR = ("x", "y", "z"), ("roll", "pitch", "yaw")
_LARGEST = 1000                 # of an axis' or button's number


class ConfigurationError(ValueError):
    """A parameter cannot be used; the message says which, and what is expected."""


@dataclass(frozen=True)
class JoyMapping:
    """Axes and scales of the six components (x, y, z, roll, pitch, yaw).

    Attributes
    ----------
    axes : tuple of (int or None)
        Number of the axis, None: always 0.
    normal, turbo : tuple of float
        Velocity at an axis' value of 1 [m/s, rad/s].
    enable, enable_turbo : int
        Numbers of the buttons; negative: there is none.
    """

    axes: Tuple[Optional[int], ...]
    normal: Tuple[float, ...]
    turbo: Tuple[float, ...]
    enable: int
    enable_turbo: int


def read_mapping(parameters: Mapping[str, Any]) -> JoyMapping:
    """Read the node's private parameters.

    Parameters
    ----------
    parameters : dict
        By name without ``~``; unknown names are of no meaning here.

    Raises
    ------
    ConfigurationError
        If a value has the wrong type or is out of range.
    """
    axes: Dict[str, int] = {}
    normal: Dict[str, float] = {}
    turbo: Dict[str, float] = {}
    for kind, names, default_name, default_axis, default_turbo in (("linear", LINEAR, "x", 1, 1.0),
                                                                   ("angular", ANGULAR, "yaw", 0, None)):
        axis, scale, fast = "axis_" + kind, "scale_" + kind, "scale_%s_turbo" % kind
        if isinstance(parameters.get(axis), dict):
            axes.update(_entries(parameters, axis, names, _index))
            normal.update(_entries(parameters, scale, names, _number))
            turbo.update(_entries(parameters, fast, names, _number))
        else:
            axes[default_name] = _index(axis, parameters.get(axis, default_axis))
            normal[default_name] = _number(scale, parameters.get(scale, 0.5))
            turbo[default_name] = _number(fast, parameters.get(
                fast, normal[default_name] if default_turbo is None else default_turbo))
    every = LINEAR + ANGULAR
    return JoyMapping(
        axes=tuple(axes.get(name) for name in every), normal=tuple(normal.get(name, 0.0) for name in every),
        turbo=tuple(turbo.get(name, 0.0) for name in every),
        enable=_index("enable_button", parameters.get("enable_button", 0), least=-1),
        enable_turbo=_index("enable_turbo_button", parameters.get("enable_turbo_button", -1), least=-1))


def _entries(parameters: Mapping[str, Any], name: str, known: Sequence[str], read: Any) -> Dict[str, Any]:
    given = parameters.get(name, {})
    if not isinstance(given, dict):
        raise ConfigurationError("~%s is %.60r; expected a dictionary, as its axes are" % (name, given))
    for key in given:
        if key not in known:
            raise ConfigurationError("~%s has the entry %.60r; expected some of %s" % (name, key, ", ".join(known)))
    return {key: read("%s/%s" % (name, key), value) for key, value in given.items()}


def _index(name: str, value: Any, least: int = 0) -> int:
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= _LARGEST:
        raise ConfigurationError("~%s is %.60r; expected a whole number from %d to %d" % (name, value, least, _LARGEST))
    return value


def _number(name: str, value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ConfigurationError("~%s is %.60r; expected a finite number" % (name, value))
    return float(value)


class Teleop:
    """Answers each joystick message with a velocity or with None.

    Parameters
    ----------
    mapping : JoyMapping
    """

    def __init__(self, mapping: JoyMapping) -> None:
        self._mapping, self._stopped = mapping, False

    def answer(self, axes: Sequence[float], buttons: Sequence[int]) -> Optional[Tuple[float, ...]]:
        """Return the command for one message.

        Parameters
        ----------
        axes : sequence of float
        buttons : sequence of int

        Returns
        -------
        tuple of float or None
            Linear x, y, z and angular x, y, z [m/s, rad/s]; zeros once when no button is held any more, then None.
        """
        mapping = self._mapping
        if _held(buttons, mapping.enable_turbo):
            scales = mapping.turbo
        elif _held(buttons, mapping.enable):
            scales = mapping.normal
        elif self._stopped:
            return None
        else:
            self._stopped = True
            return (0.0,) * 6
        self._stopped = False
        return tuple(axes[axis] * scale if axis is not None and axis < len(axes) else 0.0
                     for axis, scale in zip(mapping.axes, scales))


def _held(buttons: Sequence[int], button: int) -> bool:
    return 0 <= button < len(buttons) and bool(buttons[button])

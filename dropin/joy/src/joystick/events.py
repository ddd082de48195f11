# SPDX-License-Identifier: BSD-3-Clause
"""Events of Linux's joystick interface, and the axes and buttons that follow from them.

An event has eight bytes: time [ms], value from -32767 to 32767, type, and number of the axis or button
(Documentation/input/joydev/joystick-api.rst of Linux).
"""
from __future__ import annotations

import struct
from typing import Any, List

EVENT_BYTES = 8
_BUTTON, _AXIS, _FIRST = 0x01, 0x02, 0x80       # bits of the type; the first event of each axis and button has the last
_FARTHEST = 32767


class Stick:
    """State of a joystick.

    Parameters
    ----------
    dead_zone : float
        Share of an axis around its middle that counts as the middle, from 0 to 0.9.

    Attributes
    ----------
    axes : list of float
        From -1 to 1, positive to the left and upwards.
    buttons : list of int
        1 while pressed.
    """

    def __init__(self, dead_zone: float = 0.05) -> None:
        self._dead_zone = dead_zone
        self.axes: List[float] = []
        self.buttons: List[int] = []

    def update(self, data: bytes) -> bool:
        """Take events; return whether an axis or button has changed.

        Parameters
        ----------
        data : bytes
            Whole events; unknown types are ignored.
        """
        changed = False
        for _, value, kind, number in struct.iter_unpack("=IhBB", data[:len(data) // EVENT_BYTES * EVENT_BYTES]):
            kind &= ~_FIRST
            if kind == _BUTTON:
                changed |= _put(self.buttons, number, 0, int(value != 0))
            elif kind == _AXIS:
                changed |= _put(self.axes, number, 0.0, self._scaled(value))
        return changed

    def _scaled(self, value: int) -> float:
        """Return the value of an axis: 0 within the dead zone, and from there linear up to 1."""
        share = max(-1.0, min(1.0, value / _FARTHEST))
        beyond = abs(share) - self._dead_zone
        if beyond <= 0.0:
            return 0.0
        return -beyond / (1.0 - self._dead_zone) if share > 0.0 else beyond / (1.0 - self._dead_zone)

    def release(self) -> None:
        """Put all axes into the middle and release all buttons, as when the joystick is unplugged."""
        self.axes, self.buttons = [0.0] * len(self.axes), [0] * len(self.buttons)


def _put(values: List[Any], number: int, empty: float, value: float) -> bool:
    """Set one value of a list, which grows as needed; return whether something has changed."""
    grown = number >= len(values)
    values.extend([empty] * (number + 1 - len(values)))
    before, values[number] = values[number], value
    return grown or before != value

# SPDX-License-Identifier: BSD-3-Clause
"""Axes and buttons from the events of Linux's joystick interface."""
import struct

import pytest

from joystick.events import Stick


def event(value, kind, number, time=1):
    return struct.pack("=IhBB", time, value, kind, number)


def test_the_first_events_tell_how_many_axes_there_are():
    stick = Stick()
    assert stick.update(event(0, 0x81, 2) + event(0, 0x82, 1))
    assert (stick.axes, stick.buttons) == ([0.0, 0.0], [0, 0, 0])


@pytest.mark.parametrize("value, axis", [(0, 0.0), (32767, -1.0), (-32767, 1.0), (-32768, 1.0), (3276, 0.0),
                                         (-18022, 0.5)])
def test_an_axis_is_linear_beyond_the_dead_zone(value, axis):
    stick = Stick(0.1)
    stick.update(event(value, 2, 0))
    assert stick.axes[0] == pytest.approx(axis, abs=1e-4)


def test_a_button_is_pressed_and_released():
    stick = Stick()
    assert stick.update(event(1, 1, 0)) and stick.buttons == [1]
    assert not stick.update(event(1, 1, 0))
    assert stick.update(event(0, 1, 0)) and stick.buttons == [0]


def test_unknown_events_and_broken_ones_are_ignored():
    stick = Stick()
    assert not stick.update(event(5, 7, 0) + b"abc")
    assert (stick.axes, stick.buttons) == ([], [])


def test_a_joystick_that_is_gone_is_at_rest():
    stick = Stick()
    stick.update(event(-32767, 2, 0) + event(1, 1, 3))
    stick.release()
    assert (stick.axes, stick.buttons) == ([0.0], [0, 0, 0, 0])

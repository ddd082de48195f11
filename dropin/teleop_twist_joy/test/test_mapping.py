# SPDX-License-Identifier: BSD-3-Clause
"""Axes, scales and buttons of teleop_twist_joy."""
import math

import pytest

from joy_twist.mapping import ConfigurationError, Teleop, read_mapping

PLAIN = {"axis_linear": 1, "scale_linear": 0.4, "scale_linear_turbo": 2.0, "axis_angular": 0, "scale_angular": 1.4,
         "enable_button": 4, "enable_turbo_button": 5}
AXES = (0.5, 1.0, -0.25, 0.75)


def held(*buttons):
    return [int(button in buttons) for button in range(6)]


def test_a_held_button_passes_the_scaled_axes():
    teleop = Teleop(read_mapping(PLAIN))
    assert teleop.answer(AXES, held(4)) == pytest.approx((0.4, 0, 0, 0, 0, 0.7))
    assert teleop.answer(AXES, held(4, 5)) == pytest.approx((2.0, 0, 0, 0, 0, 0.7))      # turbo goes first


def test_a_release_sends_zeros_once():
    teleop = Teleop(read_mapping(PLAIN))
    assert teleop.answer(AXES, held(4)) is not None
    assert [teleop.answer(AXES, held()) for _ in range(3)] == [(0.0,) * 6, None, None]
    assert teleop.answer(AXES, held(4)) == pytest.approx((0.4, 0, 0, 0, 0, 0.7))
    assert teleop.answer(AXES, held()) == (0.0,) * 6


def test_defaults_are_those_of_the_package():
    teleop = Teleop(read_mapping({}))
    assert teleop.answer(AXES, held(0)) == pytest.approx((0.5, 0, 0, 0, 0, 0.25))
    assert teleop.answer(AXES, held(5)) == (0.0,) * 6                                     # no turbo button


def test_six_axes_have_each_its_own_scale():
    mapping = read_mapping({"axis_linear": {"x": 3, "y": 2}, "scale_linear": {"x": 2.0, "y": 4},
                            "axis_angular": {"yaw": 0, "roll": 1}, "scale_angular": {"yaw": 2.0},
                            "enable_turbo_button": 1})
    teleop = Teleop(mapping)
    assert teleop.answer(AXES, held(0)) == pytest.approx((1.5, -1.0, 0, 0, 0, 1.0))       # roll has no scale
    assert teleop.answer(AXES, held(1)) == (0.0,) * 6                                     # turbo has no scales


def test_a_joystick_with_fewer_axes_and_buttons_is_no_error():
    teleop = Teleop(read_mapping(PLAIN))
    assert teleop.answer((0.5,), held(4)) == pytest.approx((0, 0, 0, 0, 0, 0.7))
    assert teleop.answer((), ()) == (0.0,) * 6 and teleop.answer((), ()) is None


@pytest.mark.parametrize("parameters, words", [
    ({"axis_linear": "x"}, "~axis_linear is 'x'; expected a whole number"), ({"axis_linear": True}, "whole number"),
    ({"axis_angular": -1}, "from 0 to"), ({"scale_linear": math.nan}, "~scale_linear is nan; expected a finite"),
    ({"enable_button": -2}, "from -1 to"), ({"axis_linear": {"w": 1}}, "entry 'w'; expected some of x, y, z"),
    ({"axis_linear": {"x": 1}, "scale_linear": 2.0}, "~scale_linear is 2.0; expected a dictionary"),
    ({"axis_angular": {"yaw": 1}, "scale_angular": {"yaw": "a"}}, "~scale_angular/yaw is 'a'")])
def test_unusable_parameters_are_named(parameters, words):
    with pytest.raises(ConfigurationError) as caught:
        read_mapping(parameters)
    assert words in str(caught.value)

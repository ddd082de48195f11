# SPDX-License-Identifier: BSD-3-Clause
"""Velocities from the displacement of a marker."""
import math

import pytest

from drive_marker.velocity import ConfigurationError, read_settings


def test_defaults_scale_and_limit():
    settings = read_settings({})
    assert settings.velocity((0.4, 0.7, 0.0), 0.5) == pytest.approx((0.4, 0.0, 0.0, 1.1))
    assert settings.velocity((-9.0, 0.0, 0.0), -3.0) == pytest.approx((-1.0, 0.0, 0.0, -2.2))


def test_each_axis_has_its_own_scale_and_limits():
    settings = read_settings({"linear_scale": {"x": 2, "y": 0.5}, "max_positive_linear_velocity": {"x": 0.3},
                              "max_negative_linear_velocity": {"y": -0.1}, "angular_scale": 1.0})
    assert settings.velocity((1.0, -1.0, 1.0), 0.2) == pytest.approx((0.3, -0.1, 0.0, 0.2))


@pytest.mark.parametrize("parameters, words", [
    ({"linear_scale": "fast"}, "~linear_scale is 'fast'; expected a finite number"),
    ({"linear_scale": {"w": 1.0}}, "entry 'w'; expected some of x, y, z"),
    ({"max_angular_velocity": math.nan}, "~max_angular_velocity is nan"), ({"angular_scale": True}, "finite number"),
    ({"max_positive_linear_velocity": {"x": None}}, "~max_positive_linear_velocity/x is None")])
def test_unusable_parameters_are_named(parameters, words):
    with pytest.raises(ConfigurationError) as caught:
        read_settings(parameters)
    assert words in str(caught.value)

# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest

from motion_plan.angles import normalize_angle, wrap_angle, yaw_of_quaternion


@pytest.mark.parametrize('turns', [-3, -1, 0, 1, 4])
def test_wrap_removes_any_number_of_revolutions(turns):
    assert wrap_angle(0.7 + 2 * math.pi * turns) == pytest.approx(0.7)


def test_wrap_maps_pi_to_minus_pi():
    assert wrap_angle(math.pi) == pytest.approx(-math.pi)


def test_normalize_removes_one_revolution_only():
    assert normalize_angle(math.pi + 0.5) == pytest.approx(0.5 - math.pi)
    assert normalize_angle(-math.pi - 0.5) == pytest.approx(math.pi - 0.5)
    assert normalize_angle(6 * math.pi) == pytest.approx(4 * math.pi)
    assert normalize_angle(-1.0) == -1.0


@pytest.mark.parametrize('yaw', [-3.0, -1.0, 0.0, 0.4, 3.1])
def test_yaw_of_a_turn_about_z(yaw):
    assert yaw_of_quaternion(0, 0, math.sin(yaw / 2), math.cos(yaw / 2)) == pytest.approx(yaw)


def test_yaw_does_not_need_unit_length():
    assert yaw_of_quaternion(0, 0, 3 * math.sin(0.2), 3 * math.cos(0.2)) == pytest.approx(0.4)


def test_zero_quaternion_is_no_rotation():
    assert yaw_of_quaternion(0, 0, 0, 0) == 0.0


def test_pitched_robot_keeps_its_yaw():
    # yaw 0.5 then pitch 0.1 about the rotated y axis
    cy, sy, cp, sp = math.cos(0.25), math.sin(0.25), math.cos(0.05), math.sin(0.05)
    assert yaw_of_quaternion(-sy * sp, cy * sp, sy * cp, cy * cp) == pytest.approx(0.5)


def test_quaternion_with_nan_is_refused():
    with pytest.raises(ValueError, match='finite'):
        yaw_of_quaternion(0, 0, math.nan, 1)

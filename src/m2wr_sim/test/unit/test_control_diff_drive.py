# SPDX-License-Identifier: BSD-3-Clause
"""The equations of a differential drive: sides, rim speeds, the acceleration ramp, encoder odometry."""
import math

import pytest

from m2wr_sim.control.diff_drive import CONVENTIONS, EncoderOdometry, is_swapped, ramp, wheel_speeds

# (convention, legacyMode tag, joint tagged left stands on the left) -> driven as the right wheel
SWAPPED = [
    ("noetic", None, True, False), ("noetic", True, True, False), ("noetic", False, True, False),
    ("noetic", None, False, False), ("noetic", True, False, False), ("noetic", False, False, False),
    ("kinetic", None, True, True), ("kinetic", True, True, True), ("kinetic", False, True, False),
    ("kinetic", None, False, True), ("kinetic", True, False, True), ("kinetic", False, False, False),
    ("rep103", None, True, False), ("rep103", True, True, False), ("rep103", False, True, False),
    ("rep103", None, False, True), ("rep103", True, False, True), ("rep103", False, False, True),
]


@pytest.mark.parametrize("convention, legacy, left_is_left, swapped", SWAPPED)
def test_which_wheel_is_left(convention, legacy, left_is_left, swapped):
    left_y = 0.2 if left_is_left else -0.2
    assert is_swapped(convention, legacy, left_y, -left_y) is swapped


def test_the_table_above_speaks_of_every_convention():
    assert {row[0] for row in SWAPPED} == set(CONVENTIONS)


@pytest.mark.parametrize("linear_x, angular_z, left, right", [
    (0.5, 0.0, 0.5, 0.5), (0.0, 1.0, -0.2, 0.2), (0.5, 0.3, 0.44, 0.56), (-0.5, 0.3, -0.56, -0.44),
    (0.0, 0.0, 0.0, 0.0)])
def test_rim_speeds(linear_x, angular_z, left, right):
    assert wheel_speeds(linear_x, angular_z, 0.4, False) == pytest.approx((left, right))
    assert wheel_speeds(linear_x, angular_z, 0.4, True) == pytest.approx((right, left))


def test_no_ramp_without_a_limit():
    assert ramp((1.0, -1.0), (0.0, 0.0), (0.3, 0.4), 0.0) == ((1.0, -1.0), (0.3, 0.4))


def test_ramp_limits_both_directions_and_accumulates():
    speeds, instructed = ramp((1.0, -1.0), (0.0, 0.0), (0.0, 0.0), 0.05)
    assert speeds == instructed == pytest.approx((0.05, -0.05))
    speeds, instructed = ramp((1.0, -1.0), (0.02, -0.02), instructed, 0.05)    # from what was told, not from 0.02
    assert speeds == instructed == pytest.approx((0.10, -0.10))


def test_ramp_steps_no_farther_than_the_target():
    speeds, _ = ramp((0.03, 1.0), (0.0, 0.0), (0.0, 0.0), 0.05)
    assert speeds == pytest.approx((0.03, 0.05))


@pytest.mark.parametrize("current", [(0.995, 0.0), (0.0, -1.009)])
def test_one_wheel_at_its_target_ends_the_ramp_for_both(current):
    assert ramp((1.0, -1.0), current, (0.4, -0.4), 0.05) == ((1.0, -1.0), (0.4, -0.4))


@pytest.mark.parametrize("current", [(0.985, 0.0), (0.0, -1.02)])
def test_a_wheel_further_off_does_not(current):
    speeds, _ = ramp((1.0, -1.0), current, (0.4, -0.4), 0.05)
    assert speeds != (1.0, -1.0)


def odometry(left, right, seconds, swapped=False, steps=1000):
    encoder = EncoderOdometry(0.4, swapped)
    for _ in range(steps):
        encoder.update(left, right, seconds / steps)
    return encoder


def test_encoder_counts_a_straight_line():
    encoder = odometry(0.5, 0.5, 4.0)
    assert (encoder.x, encoder.y, encoder.theta) == pytest.approx((2.0, 0.0, 0.0), abs=1e-12)
    assert (encoder.linear_x, encoder.angular_z) == pytest.approx((0.5, 0.0), abs=1e-12)


def test_encoder_counts_a_turn_on_the_spot():
    encoder = odometry(-0.2, 0.2, 3.0)
    assert (encoder.x, encoder.y, encoder.theta) == pytest.approx((0.0, 0.0, 3.0), abs=1e-9)
    assert (encoder.linear_x, encoder.angular_z) == pytest.approx((0.0, 1.0), abs=1e-12)


def test_encoder_counts_a_circle():
    linear, angular, seconds, steps = 0.5, 0.8, 5.0, 1000
    encoder = odometry(linear - 0.2 * angular, linear + 0.2 * angular, seconds, steps=steps)
    turned = angular * seconds
    assert encoder.theta == pytest.approx(turned)
    # the midpoint rule walks straight pieces where the arc's chords are meant: too long by half / sin(half)
    half = 0.5 * turned / steps
    stretch = half / math.sin(half)
    radius = linear / angular
    assert encoder.x == pytest.approx(stretch * radius * math.sin(turned), abs=1e-10)
    assert encoder.y == pytest.approx(stretch * radius * (1.0 - math.cos(turned)), abs=1e-10)


def test_encoder_speed_has_no_sign_but_the_way_has():
    encoder = odometry(-0.5, -0.5, 2.0)
    assert encoder.x == pytest.approx(-1.0) and encoder.linear_x == pytest.approx(0.5)


def test_encoder_of_a_swapped_robot_turns_the_other_way():
    assert odometry(-0.2, 0.2, 1.0, swapped=True).theta == pytest.approx(-odometry(-0.2, 0.2, 1.0).theta)
    assert odometry(0.3, 0.5, 1.0, swapped=True).y == pytest.approx(-odometry(0.3, 0.5, 1.0).y)


@pytest.mark.parametrize("dt", [0.0, -0.1])
def test_encoder_ignores_time_that_does_not_advance(dt):
    encoder = odometry(0.5, 0.5, 1.0)
    encoder.update(9.0, 9.0, dt)
    assert (encoder.x, encoder.linear_x) == pytest.approx((0.5, 0.5))


def test_encoder_reset_returns_to_the_origin():
    encoder = odometry(0.3, 0.5, 1.0)
    encoder.reset()
    assert (encoder.x, encoder.y, encoder.theta, encoder.linear_x, encoder.angular_z) == (0.0,) * 5

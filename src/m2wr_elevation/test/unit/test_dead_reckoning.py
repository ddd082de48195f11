# SPDX-License-Identifier: BSD-3-Clause
"""Wheels give the distance, the IMU the direction."""
import math

import numpy as np
import pytest

from m2wr_elevation.dead_reckoning import DeadReckoning, rotation_of


def pitched(degrees):
    half = math.radians(degrees) / 2.0
    return (0.0, math.sin(half), 0.0, math.cos(half))


def test_a_way_uphill_leads_up():
    reckoning = DeadReckoning()
    reckoning.orient(pitched(-20.0))
    for x in np.linspace(0.0, 2.0, 21):
        reckoning.travel(x, 0.0, 0.0)
    tilt = math.radians(20.0)
    assert reckoning.position == pytest.approx((2.0 * math.cos(tilt), 0.0, 2.0 * math.sin(tilt)))


def test_driving_backwards_leads_back():
    reckoning = DeadReckoning()
    for x in (0.0, 1.0, 0.25):
        reckoning.travel(x, 0.0, 0.0)
    assert reckoning.position == pytest.approx((0.25, 0.0, 0.0))


def test_a_robot_pitches_about_its_axle():
    reckoning = DeadReckoning(-0.12)
    reckoning.orient(pitched(-30.0))
    assert reckoning.position == pytest.approx((-0.12 + 0.12 * math.cos(math.pi / 6.0), 0.0, 0.06))


def test_the_first_odometry_is_the_start_wherever_it_is():
    reckoning = DeadReckoning()
    assert reckoning.travel(7.0, -3.0, 1.0) == 0.0
    assert reckoning.position == pytest.approx((0.0, 0.0, 0.0))


@pytest.mark.parametrize("quaternion", [(0.0, 0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 1.0), (math.inf, 0.0, 0.0, 1.0)])
def test_what_is_no_orientation_is_refused(quaternion):
    with pytest.raises(ValueError, match="no orientation"):
        rotation_of(quaternion)


def test_odometry_that_is_not_finite_changes_nothing():
    reckoning = DeadReckoning()
    reckoning.travel(0.0, 0.0, 0.0)
    with pytest.raises(ValueError, match="finite"):
        reckoning.travel(math.nan, 0.0, 0.0)
    reckoning.travel(1.0, 0.0, 0.0)
    assert reckoning.position == pytest.approx((1.0, 0.0, 0.0))

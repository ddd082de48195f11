# SPDX-License-Identifier: BSD-3-Clause
"""Time in which the wheels were at rest, which limits how far a person can have turned the robot."""
import math

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.standstill import Standstill, turn_cost

USUAL, INTERVAL = 0.5, 0.1          # speed [m/s], time between two scans [s]


class Drive:
    """A robot that drives straight on and turns on the spot."""

    def __init__(self, *speeds):
        """Drive for 10 s at each speed [m/s]."""
        self.still, self.now = Standstill(), 0.0
        for speed in speeds or (USUAL,):
            for _ in range(100):
                self.step(INTERVAL, speed * INTERVAL)
        self.still.restart()
        self.still.explain()

    def step(self, interval, distance=0.0, turn=0.0):
        self.now += interval
        self.still.add(self.now, np.array([distance, 0.0, turn]))


def test_a_robot_at_its_usual_speed_never_stands():
    drive = Drive()
    for _ in range(20):
        drive.step(INTERVAL, -USUAL * INTERVAL)
    assert drive.still.longest == pytest.approx(0.0, abs=2e-3)
    assert drive.still.unexplained == pytest.approx(0.0, abs=2e-2)


@pytest.mark.parametrize("distance", [0.0, 0.25])
def test_a_gap_stands_as_long_as_its_way_does_not_need(distance):
    drive = Drive(0.01, USUAL, 0.0)         # slow motion and rest do not change the usual speed
    drive.step(2.0, distance)
    still = drive.still
    assert still.longest == still.unexplained == pytest.approx(2.0 - distance / USUAL, abs=0.1)
    still.restart()
    assert still.longest == 0.0 and still.unexplained > 1.0


def test_standstills_add_up_until_laser_and_odometry_agree():
    drive = Drive()
    for _ in range(5):
        drive.step(INTERVAL)
    still = drive.still
    assert still.unexplained == pytest.approx(0.5) and still.longest == pytest.approx(INTERVAL)
    still.explain()
    assert still.unexplained == 0.0 and still.longest > 0.0


@pytest.mark.parametrize("turn", [0.1, -0.1])
def test_a_robot_that_turns_by_its_wheels_does_not_stand(turn):
    drive = Drive()
    for _ in range(100):
        drive.step(INTERVAL, USUAL * INTERVAL, 0.01)        # slowly, while it drives
    for _ in range(100):
        drive.step(INTERVAL, 0.0, turn)
    drive.still.restart()
    drive.step(1.0, 0.0, 10.0 * turn)
    assert drive.still.longest == pytest.approx(0.0, abs=0.1)
    drive.step(1.0, 0.0, 5.0 * turn)
    assert drive.still.longest == pytest.approx(0.5, abs=0.1)


def test_a_reset_of_odometry_does_not_change_the_usual_speed():
    drive = Drive()
    drive.step(INTERVAL, -1e8)
    drive.still.restart()
    drive.step(1.0, 0.5 * USUAL)
    assert drive.still.longest == pytest.approx(0.5, abs=0.05)


def test_stamps_that_jitter_are_no_standstill():
    drive = Drive(0.0)
    for k in range(300):
        drive.step(2.9 * INTERVAL if k % 3 == 2 else 0.05 * INTERVAL, USUAL * INTERVAL)
    drive.still.restart()
    drive.step(1.0, USUAL)
    assert drive.still.longest < 0.3


def test_scans_that_arrive_late_change_nothing():
    still, other = Standstill(), Standstill()
    for k in range(60):
        still.add(INTERVAL * k, np.array([USUAL * INTERVAL, 0.0, 0.0]))
    at = 0
    for k in [0, 1, *(index + (1 if index % 3 == 0 else -1 if index % 3 == 1 else 0) for index in range(3, 60)), 60]:
        other.add(INTERVAL * k, np.array([USUAL * INTERVAL * (k - at), 0.0, 0.0]))
        at = k
    other.restart()
    still.restart()
    for one, last in ((still, 59), (other, 60)):
        one.add(INTERVAL * last + 1.0, np.array([0.5 * USUAL, 0.0, 0.0]))
    assert other.longest == pytest.approx(still.longest, abs=0.1) == pytest.approx(0.5, abs=0.1)


def test_a_turn_that_has_too_little_time_is_less_probable():
    enough = tuning.TURNS.half_turn
    assert turn_cost(math.pi, enough) == turn_cost(-0.1, enough) == turn_cost(-math.pi, 5.0) == tuning.SLIPS.cost
    assert turn_cost(math.pi, 0.5 * enough) == turn_cost(-math.pi, 0.5 * enough) == 2.0 * tuning.SLIPS.cost
    assert turn_cost(0.3, 0.0) == math.inf

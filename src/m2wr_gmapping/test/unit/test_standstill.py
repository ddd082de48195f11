# SPDX-License-Identifier: BSD-3-Clause
"""Time in which the wheels stood still, which limits how far somebody can have turned the robot."""
import math

import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.standstill import Standstill, turn_cost

USUAL, INTERVAL = 0.5, 0.1          # speed [m/s], time between two scans [s]


def driven(*speeds):
    """A robot that has driven 100 scans at each speed [m/s]."""
    still = Standstill()
    for speed in speeds or (USUAL,):
        for _ in range(100):
            still.add(INTERVAL, speed * INTERVAL, 0.0)
    still.restart()
    still.explain()
    return still


def test_a_robot_at_its_usual_speed_never_stands():
    still = driven()
    for _ in range(20):
        still.add(INTERVAL, USUAL * INTERVAL, 0.0)
    assert still.longest == pytest.approx(0.0, abs=1e-9) and still.unexplained == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("distance", [0.0, 0.25])
def test_a_gap_stands_as_long_as_its_way_does_not_need(distance):
    still = driven(0.01, USUAL, 0.0)        # slow motion and rest do not change the usual speed
    still.add(2.0, distance, 0.0)
    assert still.longest == still.unexplained == pytest.approx(2.0 - distance / USUAL, abs=0.1)
    still.restart()
    assert still.longest == 0.0 and still.unexplained > 1.0


def test_standstills_add_up_until_laser_and_odometry_agree():
    still = driven()
    for _ in range(5):
        still.add(INTERVAL, 0.0, 0.0)
    assert still.unexplained == pytest.approx(0.5) and still.longest == pytest.approx(INTERVAL)
    still.explain()
    assert still.unexplained == 0.0 and still.longest > 0.0


def test_a_robot_that_turns_by_its_wheels_does_not_stand():
    still = driven()
    for _ in range(20):
        still.add(INTERVAL, 0.0, 0.1)
    still.restart()
    still.add(1.0, 0.0, 1.0)
    assert still.longest == pytest.approx(0.0, abs=1e-9)


def test_stamps_that_jitter_are_no_standstill():
    still = Standstill()
    for k in range(300):
        still.add(3.0 * INTERVAL if k % 3 == 2 else 0.0, USUAL * INTERVAL, 0.0)
    still.restart()
    still.add(1.0, USUAL, 0.0)
    assert still.longest < 0.2


def test_a_turn_that_has_too_little_time_is_less_probable():
    enough = tuning.TURNS.half_turn
    assert turn_cost(math.pi, enough) == turn_cost(-0.1, enough) == turn_cost(-math.pi, 5.0) == tuning.SLIPS.cost
    assert turn_cost(math.pi, 0.5 * enough) == turn_cost(-math.pi, 0.5 * enough) == 2.0 * tuning.SLIPS.cost
    assert turn_cost(0.3, 0.0) == math.inf

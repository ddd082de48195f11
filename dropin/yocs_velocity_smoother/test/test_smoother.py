# SPDX-License-Identifier: BSD-3-Clause
"""Commands within limits: ramps in closed form, input that stops, feedback of the robot, bad parameters."""
import math

import pytest

from velocity_ramp.smoother import COMMANDS, ODOMETRY, ConfigurationError, Settings, Smoother, read_settings

SETTINGS = Settings(speed_lim_v=0.8, speed_lim_w=5.4, accel_lim_v=0.3, accel_lim_w=3.5, frequency=20.0)
PERIOD = 0.05


def drive(smoother, linear, angular, start, count, feedback=None):
    """Return what is sent while the command is repeated in every cycle."""
    sent = []
    for k in range(count):
        now = start + k * PERIOD
        smoother.command(linear, angular, now)
        sent.append(smoother.step(now))
        if feedback:
            smoother.feedback(*feedback(sent[-1]))
    return sent


def test_the_speed_rises_by_the_acceleration_up_to_its_limit():
    sent = drive(Smoother(SETTINGS), 2.0, 0.0, 0.0, 80)
    for k, (linear, angular) in enumerate(sent):
        assert linear == pytest.approx(min(0.8, 0.3 * PERIOD * (k + 1))) and angular == 0.0


def test_braking_is_faster_by_its_factor():
    smoother = Smoother(SETTINGS._replace(decel_factor=2.0))
    drive(smoother, 0.5, 0.0, 0.0, 60)
    braked = drive(smoother, 0.0, 0.0, 3.0, 10)
    assert braked[0][0] == pytest.approx(0.5 - 2.0 * 0.3 * PERIOD)
    assert braked[-1][0] == pytest.approx(0.5 - 2.0 * 0.3 * 10 * PERIOD)


def test_both_velocities_change_in_the_same_ratio():
    sent = drive(Smoother(SETTINGS), 0.3, 1.0, 0.0, 60)
    assert sent[-1] == (0.3, 1.0) and sent[0] == pytest.approx((0.015, 0.05))
    assert all(linear / 0.3 == pytest.approx(angular) for linear, angular in sent)


def test_when_the_input_stops_the_robot_brakes_and_falls_silent():
    smoother = Smoother(SETTINGS)
    drive(smoother, 0.3, 0.0, 0.0, 40)
    sent, zeroed = [], []
    for k in range(40, 80):
        sent.append(smoother.step(k * PERIOD))
        zeroed += [smoother.zeroed] if smoother.zeroed else []
    assert zeroed == [(0.3, 0.0)]
    assert sent[0] == (0.3, 0.0) and (0.0, 0.0) in sent and sent[-1] is None
    assert [linear for linear, _ in filter(None, sent)] == sorted((linear for linear, _ in filter(None, sent)),
                                                                  reverse=True)


def test_after_a_jump_back_of_time_the_input_counts_again():
    smoother = Smoother(SETTINGS)
    drive(smoother, 0.3, 0.0, 100.0, 40)
    assert smoother.step(1.0) is not None           # brakes
    assert drive(smoother, 0.3, 0.0, 1.0, 40)[-1] == (0.3, 0.0)


@pytest.mark.parametrize("source", [ODOMETRY, COMMANDS])
def test_a_robot_that_was_stopped_by_others_starts_from_zero(source):
    smoother = Smoother(SETTINGS._replace(robot_feedback=source))
    assert drive(smoother, 0.3, 0.0, 0.0, 40, lambda sent: sent)[-1] == (0.3, 0.0)
    smoother.feedback(0.0, 0.0)
    assert drive(smoother, 0.3, 0.0, 2.0, 1)[0] == pytest.approx((0.015, 0.0))


def test_a_robot_that_still_rolls_the_other_way_brakes_first():
    smoother = Smoother(SETTINGS._replace(robot_feedback=ODOMETRY, decel_factor=2.0))
    smoother.feedback(-0.5, 0.0)
    assert drive(smoother, 0.3, 0.0, 0.0, 1)[0] == pytest.approx((-0.5 + 2.0 * 0.3 * PERIOD, 0.0))


def test_parameters_are_read_with_defaults():
    given = {"speed_lim_v": 0.8, "speed_lim_w": "5.4e0", "accel_lim_v": 0.3, "accel_lim_w": 3.5, "quiet": True}
    assert read_settings(given) == SETTINGS
    assert read_settings(dict(given, robot_feedback=2)).robot_feedback == COMMANDS


@pytest.mark.parametrize("change, words", [
    ({"accel_lim_v": None}, "accel_lim_v is None"), ({"accel_lim_w": math.nan}, "accel_lim_w is nan"),
    ({"speed_lim_v": -1}, "0 to 10"), ({"frequency": 0}, "frequency is 0"), ({"robot_feedback": 3}, "0 (none)"),
    ({"robot_feedback": [2]}, "0 (none)"), ({"robot_feedback": True}, "0 (none)")])
def test_other_parameters_are_refused(change, words):
    with pytest.raises(ConfigurationError) as caught:
        read_settings(dict(SETTINGS._asdict(), **change))
    assert words in str(caught.value)


def test_a_limit_that_is_missing_is_named():
    with pytest.raises(ConfigurationError, match="speed_lim_v is missing"):
        read_settings({})

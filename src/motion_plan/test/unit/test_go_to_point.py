# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from motion_plan.go_to_point import GoToPoint, State
from planar_rig import STEP, TICK_STEPS, Robot, World


def test_turns_towards_the_goal_first():
    assert GoToPoint((0, 5)).update((0, 0, 0)) == (0.0, 0.7)
    assert GoToPoint((0, -5)).update((0, 0, 0)) == (0.0, -0.7)


def test_heading_within_two_degrees_goes_straight():
    go = GoToPoint((5, 0))
    assert go.update((0, 0, math.radians(1.9))) == (0.0, 0.0)
    assert go.state == State.GO_STRAIGHT_AHEAD
    assert go.update((0, 0, math.radians(1.9))) == (0.6, -0.2)
    assert go.update((0, 0, math.radians(-1.9))) == (0.6, 0.2)


def test_heading_error_while_driving_returns_to_state_0():
    go = GoToPoint((5, 0))
    go.change_state(1)
    go.update((0, 0, math.radians(2.1)))
    assert go.state == State.FIX_YAW


def test_arrival_with_a_heading_error_passes_state_0():
    go = GoToPoint((5, 0))
    go.change_state(1)
    go.update((4.8, 0, 0.1))
    assert go.state == State.FIX_YAW
    go.update((4.8, 0, 0.0))
    go.update((4.8, 0, 0.0))
    assert go.state == State.DONE
    assert go.update((4.8, 0, 1.0)) == (0.0, 0.0)


def test_goal_at_heading_pi_does_not_flip():
    go = GoToPoint((-5, 0))
    go.change_state(1)
    for yaw in (math.pi - 0.01, -math.pi + 0.01):
        assert go.update((0, 0, yaw))[0] == 0.6
        assert go.state == State.GO_STRAIGHT_AHEAD


def test_restart_turns_before_it_drives():
    go = GoToPoint((5, 0))
    go.change_state(2)
    go.restart()
    assert go.update((0, 0, 3.0)) == (0.0, -0.7)


def test_log_lines(caplog):
    caplog.set_level('INFO')
    go = GoToPoint((5, 0))
    go.update((4.9, 0, 0.0))
    go.update((4.9, 0, 0.0))
    lines = [record.getMessage() for record in caplog.records]
    assert lines[0].startswith('Yaw error: [') and lines[1] == 'State changed to [1]'
    assert lines[2].startswith('Position error: [0.0') and lines[3] == 'State changed to [2]'


@pytest.mark.parametrize('goal', [(6, 0), (-6, 0), (0, 6), (-4, -4)])
def test_comes_to_rest_within_precision(goal):
    robot, go = Robot(World(), (0, 0), 0.0, np.random.default_rng(0)), GoToPoint(goal)
    for tick in range(600):     # noqa: B007  (used after the loop)
        robot.command = go.update(robot.pose)
        for step in range(TICK_STEPS):
            if step == 2:
                robot.take_command()
            robot.step()
        if go.state == State.DONE and max(map(abs, robot.speed)) < 1e-9:
            break
    assert go.state == State.DONE
    assert 0.1 < math.hypot(goal[0] - robot.pose[0], goal[1] - robot.pose[1]) <= 0.3
    assert tick * TICK_STEPS * STEP < 25.0

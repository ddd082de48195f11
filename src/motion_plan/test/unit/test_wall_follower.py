# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest

from motion_plan.obstacle_avoidance import ObstacleAvoidance
from motion_plan.wall_follower import State, WallFollower

FAR, NEAR = 3.0, 0.5
TABLE = [    # front, fleft, fright, state, command
    (FAR, FAR, FAR, State.FIND_WALL, (0.2, -0.3)),
    (NEAR, FAR, FAR, State.TURN_LEFT, (0.0, 0.3)),
    (FAR, FAR, NEAR, State.FOLLOW_THE_WALL, (0.5, 0.0)),
    (FAR, NEAR, FAR, State.FIND_WALL, (0.2, -0.3)),
    (NEAR, FAR, NEAR, State.TURN_LEFT, (0.0, 0.3)),
    (NEAR, NEAR, FAR, State.TURN_LEFT, (0.0, 0.3)),
    (NEAR, NEAR, NEAR, State.TURN_LEFT, (0.0, 0.3)),
    (FAR, NEAR, NEAR, State.FIND_WALL, (0.2, -0.3)),
]
AVOIDANCE = [(0.6, 0.0), (0.0, 0.3), (0.0, 0.3), (0.0, -0.3), (0.0, 0.3), (0.0, -0.3), (0.0, 0.3), (0.3, 0.0)]


def regions(front, fleft, fright):
    return {'right': 1.0, 'fright': fright, 'front': front, 'fleft': fleft, 'left': 1.0}


@pytest.mark.parametrize('front, fleft, fright, state, command', TABLE)
def test_eight_cases(front, fleft, fright, state, command):
    wall = WallFollower()
    assert wall.update(None, regions(front, fleft, fright)) == command
    assert wall.state == state


@pytest.mark.parametrize('value', [1.5, math.nan])
def test_unknown_case_keeps_the_state(value, caplog):
    caplog.set_level('INFO')
    wall = WallFollower()
    wall.take_action(regions(NEAR, FAR, FAR))
    wall.take_actions(regions(value, FAR, FAR))
    assert wall.state == State.TURN_LEFT
    assert 'unknown case' in caplog.text and 'fright' in caplog.text


def test_a_change_is_logged_once(caplog):
    caplog.set_level('INFO')
    wall = WallFollower()
    for _ in range(3):
        wall.take_action(regions(NEAR, FAR, FAR))
    assert [record.getMessage() for record in caplog.records] == ['Wall follower - [1] - turn left']


def test_threshold_is_one_and_a_half_metres():
    wall = WallFollower()
    wall.take_action(regions(1.51, FAR, 1.49))
    assert wall.state == State.FOLLOW_THE_WALL


@pytest.mark.parametrize('row, command', list(zip(TABLE, AVOIDANCE)))
def test_obstacle_avoidance_cases(row, command):
    assert ObstacleAvoidance().update(None, regions(*row[:3])) == command


def test_obstacle_avoidance_threshold_is_one_metre():
    avoid = ObstacleAvoidance()
    assert avoid.update(None, regions(1.01, FAR, FAR)) == (0.6, 0.0)
    assert avoid.update(None, regions(0.99, FAR, FAR)) == (0.0, 0.3)
    assert avoid.update(None, regions(1.0, FAR, FAR)) == (0.0, 0.3)    # decides nothing: kept

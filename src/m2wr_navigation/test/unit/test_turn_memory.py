# SPDX-License-Identifier: BSD-3-Clause
"""A robot that has turned once round takes the best drive that it saw."""
import math

import numpy as np
import pytest

from closed_loop import ClosedLoop, made, world
from m2wr_navigation import registry
from m2wr_navigation.controllers.turn_memory import TurnMemory
from m2wr_navigation.supervisor import REACHED

REACH, MARGIN, STEP = 0.4, 0.1, 0.1


def turned(memory, costs, begin=0.0):
    """Turn by STEP for each cost of a drive; return the sides to which the robot might turn, each time."""
    allowed = []
    for k, cost in enumerate(costs):
        pose = np.array([1.0, 2.0, begin + STEP * k])
        memory.look(pose, REACH)
        allowed.append(memory.allowed_turns(cost, MARGIN))
        memory.note_turn(pose)
    return allowed


BOTH, NONE = (-1.0, 1.0), (0.0, 0.0)


@pytest.mark.parametrize("best, side", [(1.0, 1.0), (5.5, -1.0)])
def test_after_a_full_turn_the_robot_goes_to_the_best_heading(best, side):
    headings = np.arange(0.0, 4.0 * math.pi, STEP)
    costs = 30.0 - 10.0 * np.cos(headings - best)
    allowed = turned(TurnMemory(), costs)
    full = int(np.argmax(headings >= 2.0 * math.pi))
    assert set(allowed[:full]) == {BOTH} and allowed[full + 1] == (side, side)
    if side > 0.0:
        end = allowed.index(NONE)
        assert headings[end] == pytest.approx(best + 2.0 * math.pi, abs=0.3) and set(allowed[end:]) == {NONE}


def test_the_best_heading_counts_if_its_cost_does_not_return():
    headings = np.arange(0.0, 4.0 * math.pi, STEP)
    allowed = turned(TurnMemory(), np.where(np.arange(len(headings)) == 10, 1.0, 20.0))
    assert headings[allowed.index(NONE)] == pytest.approx(headings[10] + 2.0 * math.pi, abs=0.11)


def test_without_any_drive_the_robot_may_turn():
    assert set(turned(TurnMemory(), np.full(200, math.inf))) == {BOTH}


def test_a_new_place_is_looked_at_again():
    memory = TurnMemory()
    turned(memory, np.full(100, 5.0))
    memory.look(np.array([1.0, 2.0 + 0.9 * REACH, 0.0]), REACH)
    assert memory.allowed_turns(5.0, MARGIN) == NONE
    memory.look(np.array([1.0, 2.0 + 1.1 * REACH, 0.0]), REACH)
    assert memory.allowed_turns(5.0, MARGIN) == BOTH


def test_a_drive_that_ends_allows_a_turn():
    memory = TurnMemory()
    assert turned(memory, np.full(100, 5.0))[-1] == NONE
    assert memory.allowed_turns(math.inf, MARGIN) != NONE


TRAJECTORY = {"max_vel_x": 0.5, "min_vel_x": 0.1, "holonomic_robot": False, "min_in_place_vel_theta": 0.3,
              "occdist_scale": 0.1, "yaw_goal_tolerance": 0.2}
DWA = {"max_vel_x": 0.5, "max_vel_trans": 0.5, "max_vel_y": 0.0, "min_vel_y": 0.0, "yaw_goal_tolerance": 0.2}


@pytest.mark.parametrize("name, values", [
    ("TrajectoryPlannerROS", TRAJECTORY), ("TrajectoryPlannerROS", dict(TRAJECTORY, dwa=True)), ("DWAPlannerROS", DWA)])
def test_a_gap_that_costs_more_than_turning_is_passed(name, values):
    room = world(6.0, (3.0, 0.0, 3.2, 2.6), (3.0, 3.4, 3.2, 6.0))      # 0.8 m for 0.52 m of robot
    kind, read = made(registry.CONTROLLERS, name, **values)
    loop = ClosedLoop(room, kind(read), (1.5, 3.0, 0.0), inflation=(0.4, 10.0))
    assert loop.drive((4.8, 3.0, 0.0), 90.0) == REACHED, loop.messages
    assert not loop.hits()

# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2 among obstacles of the planar rig that are difficult in one way each."""
import math

import numpy as np
import pytest

from bug2_results import reached, unreachable
from layouts import clutter, corridor, posts, world_02, yard
from motion_plan.bug2 import State
from planar_rig import World, run_bug2


@pytest.mark.parametrize('start, goal', [((0, 6), (0, 0)), ((0.3, 0.5), (0, 6))])
def test_closed_yard_is_unreachable_from_either_side(start, goal):
    result = run_bug2(yard(), start, goal)
    unreachable(result)
    assert 'went round' in result.reason
    assert result.time < 90.0


def test_report_rule_does_not_detect_it():
    result = run_bug2(yard(), (0, 6), (0, 0), leave_rule='report', limit=120.0)
    assert result.state is State.WALL_FOLLOWING and result.hits > 1


@pytest.mark.parametrize('goal', [(-0.94, 4.73), (1.77, -0.39)])
def test_goal_inside_an_obstacle_is_unreachable(goal):
    unreachable(run_bug2(world_02(), (0, 8), goal, seed=1))


def test_goal_inside_a_post_is_unreachable():
    unreachable(run_bug2(World().disc(0, 0, 0.1), (3, 0), (0, 0)))


def test_gate_of_a_metre_and_a_half_is_found():
    reached(run_bug2(yard(1.5), (6, 0.5), (0, 0)), 120.0)


def test_gap_of_a_metre_counts_as_closed():
    unreachable(run_bug2(yard(0.9), (6, 0.5), (0, 0)))


def test_thin_posts():
    reached(run_bug2(posts(), (0, 6), (0, -5), jitter=0.2), 60.0)


@pytest.mark.parametrize('yaw', [0.0, math.pi, 1.5])
def test_goal_behind(yaw):
    reached(run_bug2(World(), (0, 0), (-5, 0), yaw=yaw), 25.0)


@pytest.mark.parametrize('width', [1.3, 1.6, 2.2])
def test_corridor_with_a_bend(width):
    reached(run_bug2(corridor(width), (0, 3), (5, -4)), 90.0)


@pytest.mark.parametrize('yaw', [0.0, 3.0, 5.0])
def test_start_with_a_post_within_the_turning_circle(yaw):
    # near enough to collide with the tip of the caster
    result = run_bug2(World().disc(0.44, 0.25, 0.05), (0, 0), (4.5, 0.0), yaw=yaw, seed=int(yaw))
    reached(result, 60.0)


def test_start_beside_a_wall():
    reached(run_bug2(World().box(0, -0.40, 6, 0.1), (0, 0), (5, 0.5)), 40.0)


def test_goal_near_a_wall():
    reached(run_bug2(World().box(3, 0, 0.2, 6), (0, 0), (2.6, 0.0)), 20.0)


@pytest.mark.parametrize('number', [0, 15, 24, 39, 57])
def test_clutter(number):
    result = run_bug2(clutter(number), (0, 8), (0, -8), seed=number, jitter=0.2)
    reached(result, 250.0)


def test_same_seed_same_track():
    first, again, other = (run_bug2(posts(), (0, 6), (0, -5), seed=seed, jitter=0.2).track for seed in (4, 4, 5))
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)

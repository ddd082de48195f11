# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2 and its behaviours in whole worlds of the planar rig."""
import math

import numpy as np
import pytest

from layouts import clutter, corridor, posts, u_trap, world_01, world_02, world_03, yard
from motion_plan.bug2 import State
from planar_rig import World, run_bug2

#: The real outline must stay this far from every obstacle [m].
MARGIN = 0.03


def reached(result, limit):
    assert result.state is State.GOAL_REACHED, (result.reason, result.robot.pose)
    assert result.clearance > MARGIN
    assert result.time < limit
    assert result.bug.distance_to_goal(result.robot.pose) <= 0.31


def unreachable(result):
    assert result.state is State.GOAL_UNREACHABLE
    assert result.clearance > MARGIN


def test_empty_arena_is_a_straight_run():
    result = run_bug2(world_01(), (0, 8), (0, -4))
    reached(result, 30.0)
    assert result.hits == 0 and result.path_length < 12.0


@pytest.mark.parametrize('seed, jitter, gain', [(0, 0.0, 1.0), (1, 0.35, 1.0), (2, 0.0, 0.98), (3, 0.35, 1.02)])
def test_world_02(seed, jitter, gain):
    result = run_bug2(world_02(), (0, 8), (0, -4), seed=seed, jitter=jitter, gain=gain)
    reached(result, 100.0)
    assert result.hits == 2 and result.path_length < 35.0


@pytest.mark.parametrize('seed, jitter', [(0, 0.0), (1, 0.35)])
def test_world_03(seed, jitter):
    reached(run_bug2(world_03(), (0, 8), (0, -4), seed=seed, jitter=jitter), 200.0)


@pytest.mark.parametrize('world, start, goal, yaw', [
    (world_02, (7, -2), (-7, 1), 1.0), (world_02, (2, 1.5), (-1, -7.5), 3.0), (world_02, (-6, -6), (2, 7.5), 0.0),
    (world_03, (-7, 7), (7, -7), 1.5), (world_03, (2, 1.5), (-1, -7.5), -2.0)])
def test_other_starts_and_goals(world, start, goal, yaw):
    reached(run_bug2(world(), start, goal, yaw=yaw, seed=7, jitter=0.2), 150.0)


def test_concave_trap():
    result = run_bug2(u_trap(), (0, 6), (0, -4))
    reached(result, 90.0)
    assert abs(result.bug.leave_point[0]) < 0.15 and result.bug.leave_point[1] < 0.0


def test_every_leave_point_is_nearer_than_its_hit_point():
    result = run_bug2(world_02(), (0, 8), (0, -4), seed=9)
    assert result.bug.distance_to_goal(result.bug.leave_point) < result.bug.distance_to_goal(result.bug.hit_point) - 0.2
    assert result.bug.distance_to_line(result.bug.leave_point) < 0.15


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

# SPDX-License-Identifier: BSD-3-Clause
"""Bug 2 and its behaviours in whole worlds of the planar rig."""
import pytest

from bug2_results import reached
from layouts import u_trap, world_01, world_02, world_03
from planar_rig import run_bug2


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

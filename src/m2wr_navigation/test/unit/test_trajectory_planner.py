# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from local_situations import block, free, made, situation, straight
from m2wr_navigation import registry
from m2wr_navigation.controllers.trajectory_planner import TrajectoryPlanner

BEFORE = (0.045, 0.0, 0.0)      # the front is 5 mm before a wall at x = 0.25


def controller(**values):
    return made(TrajectoryPlanner, **dict({"holonomic_robot": False}, **values))


def boxed_in():
    """Walls ahead and at the sides; behind it is free."""
    costmap = free()
    for box in ((0.25, -0.5, 0.4, 0.5), (-0.4, 0.2, 0.4, 0.5), (-0.4, -0.5, 0.4, -0.2)):
        block(costmap, *box)
    return costmap


def test_the_registry_finds_it_by_both_names():
    for name in ("base_local_planner/TrajectoryPlannerROS", "TrajectoryPlannerROS"):
        assert registry.find(registry.CONTROLLERS, name) is TrajectoryPlanner


def test_older_names_stand_for_parameters():
    assert set(TrajectoryPlanner.ALIASES.values()) <= set(TrajectoryPlanner.PARAMETERS)
    assert not set(TrajectoryPlanner.ALIASES) & set(TrajectoryPlanner.PARAMETERS)


@pytest.mark.parametrize("dwa, fastest", [(True, 0.25), (False, 0.55)])
def test_speeds_are_reachable_in_a_cycle_or_the_simulated_time(dwa, fastest):
    command = controller(dwa=dwa).compute(situation(free(), straight((2.0, 0.0, 0.0))))
    assert command.velocity[0] == pytest.approx(fastest) and abs(command.velocity[2]) < 0.1


def test_it_slows_down_before_the_end_of_the_plan():
    command = controller(sim_time=2.0).compute(situation(free(), straight((0.4, 0.0, 0.0))))
    assert 0.0 < command.velocity[0] <= 0.2 + 1e-9


def test_it_turns_on_the_spot_towards_a_plan_behind():
    command = controller().compute(situation(free(), straight((-2.0, 0.3, 0.0))))
    assert command.velocity[0] == 0.0 and command.velocity[2] >= 0.4


def test_a_boxed_in_robot_backs_where_it_is_free_and_says_why():
    command = controller().compute(situation(boxed_in(), straight((2.0, 0.0, 0.0)), BEFORE))
    np.testing.assert_allclose(command.velocity, [-0.1, 0.0, 0.0])
    assert command.reason.startswith("the robot backs: no velocity is valid: of ")


def test_it_does_not_back_into_an_obstacle():
    costmap = boxed_in()
    block(costmap, -0.4, -0.5, -0.2, 0.5)
    command = controller().compute(situation(costmap, straight((2.0, 0.0, 0.0)), BEFORE))
    assert command.velocity is None and "no velocity is valid" in command.reason


def test_it_continues_to_back_until_it_has_moved_far_enough():
    planner, plan = controller(), straight((2.0, 0.0, 0.0))
    planner.compute(situation(boxed_in(), plan, BEFORE))
    assert planner.compute(situation(free(), plan, (0.0, 0.0, 0.0))).velocity[0] <= 0.0
    assert planner.compute(situation(free(), plan, (-0.1, 0.0, 0.0))).velocity[0] > 0.0


def test_it_drives_ahead_again_if_it_cannot_back_any_farther():
    planner, plan = controller(), straight((2.0, 0.0, 0.0))
    planner.compute(situation(boxed_in(), plan, BEFORE))
    costmap = free()
    for box in ((-0.6, 0.2, 0.6, 0.5), (-0.6, -0.5, 0.6, -0.2), (-0.4, -0.5, -0.2, 0.5)):
        block(costmap, *box)
    assert planner.compute(situation(costmap, plan, BEFORE)).velocity[0] > 0.0


@pytest.mark.parametrize("holonomic", [True, False])
def test_only_a_holonomic_robot_steps_to_the_side(holonomic):
    costmap = free()
    for box in ((0.25, -0.5, 0.4, 0.1), (-0.4, -0.5, 0.4, -0.2), (-0.4, -0.5, -0.25, 0.1)):
        block(costmap, *box)
    plan = straight((0.0, 2.0, 1.57))
    command = controller(holonomic_robot=holonomic, y_vels="0.2,-0.2,x,nan", min_in_place_vel_theta=1.0,
                         max_vel_theta=0.0, min_vel_theta=0.0, escape_vel=0.0).compute(situation(costmap, plan, BEFORE))
    if holonomic:
        np.testing.assert_allclose(command.velocity, [0.0, 0.2, 0.0])
    else:
        assert command.velocity is None


def test_meter_scoring_weighs_distances_by_the_size_of_a_cell():
    """A costly strip on the straight way: cheap beside distances in cells, not beside distances in metres."""
    costmap = free()
    costmap.costs[56:64, 68:] = 250
    plan = straight((2.0, 0.0, 0.0))
    now = situation(costmap, plan, velocity=(0.3, 0.0, 0.0))
    in_cells = controller(occdist_scale=0.03).compute(now)
    in_metres = controller(occdist_scale=0.03, meter_scoring=True).compute(now)
    assert in_cells.velocity[0] > in_metres.velocity[0] + 0.1


def test_heading_scoring_prefers_to_look_along_the_plan():
    now = situation(free(), straight((1.0, 1.0, 0.0)), velocity=(0.3, 0.0, 0.0))
    weights = {"path_distance_bias": 0.0, "goal_distance_bias": 0.0, "min_vel_x": 0.1}
    assert controller(heading_scoring=True, heading_scoring_timestep=0.5, **weights).compute(now).velocity[2] > 0.4


def test_the_simple_attractor_leads_straight_to_the_end():
    now = situation(free(), straight((1.5, 0.0, 0.0)), velocity=(0.3, 0.0, 0.0))
    command = controller(simple_attractor=True).compute(now)
    assert command.velocity[0] > 0.4 and abs(command.velocity[2]) < 0.1


def test_the_cost_cloud_is_made_when_it_is_wanted():
    command = controller().compute(situation(free(), straight((2.0, 0.0, 0.0))))
    assert command.costs().shape == (120 * 120, 7) and command.trajectories is None


def test_at_the_goal_it_turns_with_its_limits():
    plan = straight((0.05, 0.0, 2.0))
    command = controller(max_rotational_vel=0.5).compute(situation(free(), plan, velocity=(0.0, 0.0, 0.5)))
    np.testing.assert_allclose(command.velocity, [0.0, 0.0, 0.5])
    planner = controller(yaw_goal_tolerance=0.1)
    assert planner.is_goal_reached(situation(free(), plan, (0.0, 0.0, 1.95)))
    assert not planner.is_goal_reached(situation(free(), plan, (0.0, 0.0, 1.95), (0.0, 0.0, 0.05)))
    assert not planner.is_goal_reached(situation(free(), plan, (0.0, 0.0, 2.0 - math.pi)))


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_does_not_turn_back_to_the_side_from_which_it_came(side):
    """The plan ends behind, to one side; the robot has turned there and back already."""
    local = controller()
    plan = straight((-2.0, 0.3 * side, 0.0))
    assert side * local.compute(situation(free(), plan)).velocity[2] >= 0.4
    for rate in (side, -side):
        local._oscillation.note(np.array([0.0, 0.0, rate]), np.zeros(3), 0.1)
    command = local.compute(situation(free(), plan))
    assert command.velocity[0] == 0.0 and side * command.velocity[2] <= -0.4
    moved = situation(free(), plan, (0.06, 0.0, 0.0))           # farther than oscillation_reset_dist
    assert side * local.compute(moved).velocity[2] >= 0.4


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_it_does_not_step_back_to_the_side_from_which_it_came(side):
    """Walls ahead and behind; the plan leads to one side, from which the robot has stepped back already."""
    costmap = free()
    for box in ((0.25, -0.5, 0.4, 0.5), (-0.4, -0.5, -0.25, 0.5)):
        block(costmap, *box)
    local = controller(holonomic_robot=True, y_vels="0.2,-0.2", min_in_place_vel_theta=1.0, max_vel_theta=0.0,
                       min_vel_theta=0.0, escape_vel=0.0)
    seen = situation(costmap, straight((0.0, 2.0 * side, 0.0)), (0.0, 0.0, 0.0))
    np.testing.assert_allclose(local.compute(seen).velocity, [0.0, 0.2 * side, 0.0])
    for speed in (side, -side):
        local._oscillation.note(np.array([0.0, speed, 0.0]), np.zeros(3), 0.1)
    np.testing.assert_allclose(local.compute(seen).velocity, [0.0, -0.2 * side, 0.0])

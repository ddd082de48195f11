# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from local_situations import BOX, PERIOD, block, free, made, situation, straight
from m2wr_navigation import registry
from m2wr_navigation.controllers.dwa import Dwa


def controller(**values):
    return made(Dwa, **dict({"max_vel_y": 0.0, "min_vel_y": 0.0}, **values))


def drive(dwa, costmap, plan, pose=(0.0, 0.0, 0.0), most=400):
    """Drive until the goal is reached; returns the poses, and the last situation's commands."""
    pose, velocity, track = np.array(pose, float), np.zeros(3), []
    dwa.set_plan(plan, True)
    for _ in range(most):
        now = situation(costmap, plan, pose, velocity)
        track.append(pose.copy())
        if dwa.is_goal_reached(now):
            return np.array(track), True
        command = dwa.compute(now)
        assert command.velocity is not None, command.reason
        velocity = command.velocity
        pose = pose + PERIOD * np.array([math.cos(pose[2]) * velocity[0], math.sin(pose[2]) * velocity[0], velocity[2]])
    return np.array(track), False


def test_the_registry_finds_it_by_both_names():
    for name in ("dwa_local_planner/DWAPlannerROS", "DWAPlannerROS"):
        assert registry.find(registry.CONTROLLERS, name) is Dwa


def test_it_accelerates_along_a_free_plan():
    command = controller().compute(situation(free(), straight((2.0, 0.0, 0.0))))
    assert command.velocity[0] == pytest.approx(2.5 * PERIOD) and abs(command.velocity[2]) < 0.1
    assert len(command.local_plan) > 5 and command.local_plan[-1, 0] > 0.3


@pytest.mark.parametrize("goal", [(2.0, 0.0, 0.0), (1.0, 1.0, 2.0), (-1.5, 0.5, -1.0)])
def test_it_reaches_goal_and_heading(goal):
    track, reached = drive(controller(), free(), straight(goal))
    assert reached
    assert math.hypot(track[-1, 0] - goal[0], track[-1, 1] - goal[1]) <= 0.15
    assert abs(math.remainder(track[-1, 2] - goal[2], 2 * math.pi)) <= 0.1


def test_it_drives_round_a_box_without_contact():
    costmap = free()
    block(costmap, 0.8, -0.2, 1.2, 0.6)
    plan = np.vstack([straight((0.9, -0.6, 0.0))[:-1], straight((2.0, 0.0, 0.0), (0.9, -0.6))])
    track, reached = drive(controller(), costmap, plan)
    assert reached
    for pose in track:
        turn = np.array([[math.cos(pose[2]), -math.sin(pose[2])], [math.sin(pose[2]), math.cos(pose[2])]])
        corners = BOX @ turn.T + pose[:2]
        assert not ((corners > [0.8, -0.2]) & (corners < [1.2, 0.6])).all(axis=1).any()


@pytest.mark.parametrize("gap, words", [(0.0, "have no way to the plan"), (0.1, "hit an obstacle, such as at (")])
def test_a_blocked_robot_says_why_and_where(gap, words):
    costmap = free()
    for box in ((0.25, gap, 0.4, 0.5), (-0.4, -0.5, -0.25, 0.5), (-0.4, 0.2, 0.4, 0.5), (-0.4, -0.5, 0.4, -0.2),
                (0.25, -0.5, 0.4, 0.0)):
        block(costmap, *box)
    command = controller().compute(situation(costmap, straight((2.0, 0.0, 0.0))))
    assert command.velocity is None
    assert "no velocity is valid: of" in command.reason and words in command.reason


def test_a_robot_that_accelerates_slowly_sets_out():
    """In its first cycle it reaches 0.01 m/s, with which it does not leave a cell within sim_time."""
    track, _ = drive(controller(acc_lim_x=0.1, min_vel_trans=0.0), free(), straight((2.0, 0.0, 0.0)), most=30)
    assert track[-1, 0] > 0.1


def test_a_plan_elsewhere_is_told():
    command = controller().compute(situation(free(), straight((30.0, 0.0, 0.0), (20.0, 0.0))))
    assert command.velocity is None and "does not cross the local costmap" in command.reason


def test_inscribed_cost_below_the_centre_does_not_reject_all():
    costmap = free()
    costmap.costs[:] = 253                  # the outline decides about contact
    assert controller().compute(situation(costmap, straight((2.0, 0.0, 0.0)))).velocity is not None


def test_unknown_space_is_not_entered():
    costmap = free()
    costmap.costs[:, 68:] = 255             # from x = 0.4 m on
    command = controller().compute(situation(costmap, straight((2.0, 0.0, 0.0)), velocity=(0.5, 0.0, 0.0)))
    assert command.velocity is None or command.velocity[0] * 1.7 < 0.3


def test_in_place_samples_turn_at_least_at_the_least_rate():
    dwa = controller(min_vel_trans=0.0, min_vel_theta=0.5)
    command = dwa.compute(situation(free(), straight((-2.0, 0.0, 3.0))))
    assert command.velocity[0] >= 0.01 or abs(command.velocity[2]) >= 0.5 - 1e-3
    assert np.abs(command.velocity).max() > 0.1


def test_the_latch_holds_until_there_is_a_new_goal():
    plan = straight((1.0, 0.0, 1.5))
    for latch in (True, False):
        dwa = controller(latch_xy_goal_tolerance=latch)
        dwa.set_plan(plan, True)
        dwa.compute(situation(free(), plan, (0.95, 0.0, 0.0)))
        dwa.set_plan(plan, False)           # a plan to the same goal
        away = dwa.compute(situation(free(), plan, (0.8, 0.0, 0.0)))
        assert (away.velocity[0] == 0.0) == latch
    dwa.set_plan(plan, True)
    assert dwa.compute(situation(free(), plan, (0.5, 0.0, 0.0))).velocity[0] > 0.0


def test_at_the_goal_the_robot_stops_before_it_turns():
    plan = straight((1.0, 0.0, 1.5))
    command = controller().compute(situation(free(), plan, (0.95, 0.0, 0.0), (0.5, 0.0, 0.0)))
    np.testing.assert_allclose(command.velocity, [0.25, 0.0, 0.0])
    command = controller().compute(situation(free(), plan, (0.95, 0.0, 0.0), (0.0, 0.0, 0.0)))
    assert command.velocity[0] == 0.0 and command.velocity[2] >= 0.4


def test_the_clouds_are_made_if_wanted():
    dwa = controller(publish_cost_grid_pc=True, publish_traj_pc=True)
    now = situation(free(), straight((2.0, 0.0, 0.0)))
    command = dwa.compute(now)
    costs, trajectories = command.costs(), command.trajectories()
    assert costs.shape[1] == 7 and trajectories.shape[1] == 5
    assert len(costs) == 120 * 120
    assert (trajectories[:, :4] == 0.0).all(axis=1).sum() == len(dwa.reachable(now))    # each sample begins here
    np.testing.assert_allclose(costs[:, 6], costs[:, 3:6].sum(axis=1), rtol=1e-5)


def test_a_bar_that_leaves_no_velocity_is_lifted():
    """The robot still turns left, although it was commanded to the right: only left turns are in reach."""
    dwa, plan = controller(acc_lim_theta=1.0, acc_lim_x=0.1, min_vel_trans=0.0), straight((0.0, 2.0, 1.6))
    dwa._oscillation.note(np.array([0.0, 0.0, 0.6]), np.zeros(3), 0.1)
    dwa._oscillation.note(np.array([0.0, 0.0, -0.6]), np.zeros(3), 0.1)
    assert dwa._oscillation.barred[2].tolist() == [0.0, 1.0]
    command = dwa.compute(situation(free(), plan, velocity=(0.0, 0.0, 0.8)))
    assert command.velocity is not None and command.velocity[2] > 0.6


@pytest.mark.parametrize("name", ["DWAPlannerROS", "TrajectoryPlannerROS"])
def test_a_new_plan_to_the_same_goal_keeps_the_bars(name):
    local = made(registry.find(registry.CONTROLLERS, name))
    plan = straight((2.0, 0.0, 0.0))
    local.set_plan(plan, True)
    for rate in (0.6, -0.6):
        local._oscillation.note(np.array([0.0, 0.0, rate]), np.zeros(3), 0.1)
    local.set_plan(plan, False)
    assert local._oscillation.barred[2].tolist() == [0.0, 1.0]
    local.set_plan(plan, True)
    assert not local._oscillation.barred.any()


def test_a_robot_in_an_obstacle_does_not_back_into_a_far_one():
    """Its front is in a wall; 0.3 m behind it there is another one."""
    for distance, speed in ((2.0, -0.5), (0.3, 0.0)):
        costmap = free()
        block(costmap, 0.15, -1.0, 0.3, 1.0)
        block(costmap, -0.4 - distance, -1.0, -0.2 - distance, 1.0)
        dwa = controller(min_vel_x=-0.5, min_vel_trans=0.0, vx_samples=2, acc_lim_x=10.0, max_vel_theta=0.0)
        command = dwa.compute(situation(costmap, straight((-1.0, 0.0, 0.0))))
        assert (0.0 if command.velocity is None else command.velocity[0]) == speed


@pytest.mark.parametrize("limits, sideways", [((0.0, 0.0), False), ((0.0, 0.1), True), ((-0.1, 0.0), True)])
def test_it_drives_sideways_if_its_limits_allow_it(limits, sideways):
    assert controller(min_vel_y=limits[0], max_vel_y=limits[1]).drives_sideways is sideways

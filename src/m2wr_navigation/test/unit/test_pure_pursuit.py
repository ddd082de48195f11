# SPDX-License-Identifier: BSD-3-Clause
"""Pure pursuit follows plans to their goals, and stops with a reason before obstacles."""
import math

import numpy as np
import pytest

from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.controllers.pure_pursuit import PurePursuit
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.parameters import read

FOOTPRINT = np.array([[-0.2, -0.2], [0.2, -0.2], [0.2, 0.2], [-0.2, 0.2]])
PERIOD = 0.1


def controller(**given):
    return PurePursuit(read(PurePursuit.PARAMETERS, given, "~")[0])


def straight(length, count=100, yaw=0.0):
    plan = np.zeros((count, 3))
    plan[:, 0] = np.linspace(0.0, length, count)
    plan[-1, 2] = yaw
    return plan


def curve():
    angles = np.linspace(0.0, math.pi, 200)
    return np.stack([1.5 * np.sin(angles), 1.5 - 1.5 * np.cos(angles), angles], -1)


def drive(made, plan, pose=(0.0, 0.0, 0.0), costmap=None, most=600):
    """Drive a robot that does as it is told; return its poses, and the last command or None at the goal."""
    costmap = Costmap.filled((200, 200), 0.05, (-5.0, -5.0), 0, "odom") if costmap is None else costmap
    pose, velocity, driven = np.array(pose, float), np.zeros(3), []
    made.set_plan(plan, True)
    for k in range(most):
        situation = Situation(k * PERIOD, PERIOD, pose, velocity, plan, costmap, FOOTPRINT)
        driven.append(pose.copy())
        if made.is_goal_reached(situation):
            return np.array(driven), None
        command = made.compute(situation)
        if command.velocity is None:
            return np.array(driven), command
        before, velocity = velocity, command.velocity
        assert abs(velocity[0] - before[0]) <= made.values["acc_lim_x"] * PERIOD + 1e-9
        assert abs(velocity[0]) <= made.values["max_vel_x"] + 1e-9
        assert abs(velocity[2]) <= made.values["max_vel_theta"] + 1e-9
        middle = pose[2] + 0.5 * velocity[2] * PERIOD
        pose = pose + PERIOD * np.array([velocity[0] * math.cos(middle), velocity[0] * math.sin(middle), velocity[2]])
    return np.array(driven), command


@pytest.mark.parametrize("plan", [straight(4.0), curve(), straight(0.3), straight(2.0, yaw=2.5), straight(2.0, 2)])
@pytest.mark.parametrize("pose", [(0.0, 0.0, 0.0), (0.0, 0.1, 3.0), (-0.2, -0.2, -1.5)])
def test_the_robot_arrives_with_the_heading_of_the_goal(plan, pose):
    driven, end = drive(controller(), plan, pose)
    assert end is None
    assert np.hypot(*(driven[-1, :2] - plan[-1, :2])) < 0.15
    assert abs(math.remainder(driven[-1, 2] - plan[-1, 2], 2.0 * math.pi)) < 0.1


def test_the_robot_stays_near_a_curved_plan():
    driven, _ = drive(controller(), curve())
    apart = np.abs(np.hypot(driven[:, 0], driven[:, 1] - 1.5) - 1.5)
    assert apart.max() < 0.1


def test_a_plan_backwards_begins_with_a_turn_on_the_spot():
    driven, end = drive(controller(), straight(-2.0))
    assert end is None and np.hypot(*driven[20, :2]) < 0.05 and abs(driven[20, 2]) > 1.0


def test_the_robot_stops_before_an_obstacle_and_names_the_place():
    costmap = Costmap.filled((200, 200), 0.05, (-5.0, -5.0), 0, "odom")
    costmap.costs[80:120, 140] = 254                # a wall at x = 2
    driven, end = drive(controller(), straight(4.0), costmap=costmap)
    assert end is not None and end.velocity is None
    assert 1.2 < driven[-1, 0] < 1.8 and "would collide at (1.8" in end.reason

# SPDX-License-Identifier: BSD-3-Clause
"""Controllers drive a simulated robot to its goals: planner, costmaps, supervisor and controller together."""
import math

import numpy as np
import pytest

from closed_loop import ClosedLoop, made, world
from m2wr_navigation import registry
from m2wr_navigation.supervisor import REACHED

DIFFERENTIAL = {"max_vel_y": 0.0, "min_vel_y": 0.0, "vy_samples": 1, "max_vel_x": 0.5, "max_vel_trans": 0.5,
                "min_vel_trans": 0.0, "max_vel_theta": 0.8, "min_vel_theta": 0.2, "vx_samples": 8}
ROOM = world(10.0, (4.0, 0.0, 4.4, 6.0), (6.5, 4.0, 6.9, 10.0))     # an S


def dwa(**values):
    kind, read = made(registry.CONTROLLERS, "DWAPlannerROS", **dict(DIFFERENTIAL, **values))
    return kind(read)


def trajectory_planner(**values):
    given = {"max_vel_x": 0.5, "max_vel_theta": 0.8, "min_vel_theta": -0.8, "min_in_place_vel_theta": 0.2,
             "holonomic_robot": False, "yaw_goal_tolerance": 0.1}
    kind, read = made(registry.CONTROLLERS, "TrajectoryPlannerROS", **dict(given, **values))
    return kind(read)


@pytest.mark.parametrize("values", [
    {}, {"dwa": True}, {"meter_scoring": True}, {"dwa": True, "meter_scoring": True}, {"heading_scoring": True},
    {"holonomic_robot": True, "dwa": True}], ids=lambda values: "_".join(values) or "default")
def test_trajectory_planner_drives_round_walls(values):
    loop = ClosedLoop(ROOM, trajectory_planner(**values), (1.5, 1.5, 0.0))
    assert loop.drive((8.5, 8.5, 1.0), 100.0) == REACHED, loop.messages
    assert math.hypot(*(loop.pose[:2] - 8.5)) <= 0.15 and abs(math.remainder(loop.pose[2] - 1.0, 2 * math.pi)) <= 0.1


def test_dwa_drives_round_walls_without_contact():
    loop = ClosedLoop(ROOM, dwa(), (1.5, 1.5, 0.0))
    assert loop.drive((8.5, 8.5, 1.0), 80.0) == REACHED, loop.messages
    assert math.hypot(*(loop.pose[:2] - 8.5)) <= 0.15 and abs(math.remainder(loop.pose[2] - 1.0, 2 * math.pi)) <= 0.1
    speeds = np.array(loop.commands)[:, 0]
    assert 10.0 / loop.now > 0.2 and speeds.min() >= 0.0


@pytest.mark.parametrize("make", [dwa, trajectory_planner])
@pytest.mark.parametrize("axle", [-0.05, -0.15, 0.1])
def test_a_turn_about_another_point_does_not_lose_the_goal(axle, make):
    loop = ClosedLoop(world(6.0), make(), (1.5, 3.0, 0.0), axle=axle)
    assert loop.drive((4.0, 3.0, 3.0), 40.0) == REACHED, loop.messages
    assert abs(math.remainder(loop.pose[2] - 3.0, 2 * math.pi)) <= 0.1


def test_dwa_leaves_an_obstacle_that_its_outline_is_in():
    room = world(6.0, (3.45, 2.0, 3.6, 4.0))        # the front of the robot is in the wall
    loop = ClosedLoop(room, dwa(min_vel_x=-0.2), (3.05, 3.0, 0.3))
    assert loop.hits()
    assert loop.drive((1.5, 3.0, 3.0), 40.0) == REACHED, loop.messages
    assert any("in an obstacle" in text and "it drives out" in text for text in loop.messages)

# SPDX-License-Identifier: BSD-3-Clause
"""Recovery behaviours: what is cleared, and a turn that ends by itself."""
import math

import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.controllers.controller import Situation
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint_kernels import IN_COLLISION, outline_cost
from m2wr_navigation.parameters import read
from m2wr_navigation.recoveries.recovery import Costmaps

FOOTPRINT = np.array([[-0.2, -0.1], [0.4, -0.1], [0.4, 0.1], [-0.2, 0.1]])


class Cleared(Costmaps):
    """Notes what is cleared."""

    def __init__(self):
        self.calls = []

    def layer_names(self, which):
        return ["obstacle_layer", "bumper_layer"] if which == "global" else ["obstacle_layer"]

    def clear(self, which, layers, side, inside):
        self.calls.append((which, tuple(layers), side, inside))
        return 7


def behaviour(kind, costmaps=None, **given):
    found = registry.find(registry.RECOVERIES, kind)
    values, warnings = read(found.PARAMETERS, given, "~x")
    assert not warnings
    return found("reset", values, costmaps)


def situation(stamp=0.0, yaw=0.0, costs=None):
    costs = np.zeros((100, 100), np.uint8) if costs is None else costs
    return Situation(stamp, 0.1, np.array([0.0, 0.0, yaw]), np.zeros(3), np.zeros((1, 3)),
                     Costmap(costs, 0.05, np.array([-2.5, -2.5]), "odom"), FOOTPRINT)


@pytest.mark.parametrize("given, calls", [
    ({}, [("global", ("obstacle_layer", "bumper_layer"), 3.0, False), ("local", ("obstacle_layer",), 3.0, False)]),
    (dict(affected_maps="local", reset_distance=1.8, invert_area_to_clear=True),
     [("local", ("obstacle_layer",), 1.8, True)]),
    (dict(affected_maps="global", layer_names=["bumper_layer"]), [("global", ("bumper_layer",), 3.0, False)]),
    (dict(affected_maps="local", layer_names=["obstacles"]), [("local", ("obstacle_layer",), 3.0, False)])])
def test_the_layers_that_there_are_are_cleared_in_one_step(given, calls):
    costmaps = Cleared()
    made = behaviour("ClearCostmapRecovery", costmaps, **given)
    made.begin(situation())
    step = made.step(situation())
    assert costmaps.calls == calls and step.done and step.velocity is None
    assert "7 occupied cells of" in step.reason and ("none of obstacles" in step.reason) == (
        given.get("layer_names") == ["obstacles"])


def test_move_slow_and_clear_sets_a_limit_of_speed():
    costmaps = Cleared()
    made = behaviour("move_slow_and_clear/MoveSlowAndClear", costmaps, limited_trans_speed=0.1)
    made.begin(situation())
    step = made.step(situation())
    assert costmaps.calls == [("global", ("obstacle_layer", "bumper_layer"), 1.0, True),
                              ("local", ("obstacle_layer",), 1.0, True)]
    assert step.done and step.velocity is None and step.limit == (0.1, 0.45, 0.3)
    assert "7 occupied cells in the local costmap; at most 0.1 m/s" in step.reason


def turn(made, costs=None, speed=1.0, most=500):
    """Turn a robot as it is told, times ``speed``; return its angles and the last step."""
    yaw, stamp, angles = 0.3, 0.0, []
    made.begin(situation(stamp, yaw, costs))
    for _ in range(most):
        stamp += 0.1
        step = made.step(situation(stamp, math.remainder(yaw, 2 * math.pi), costs))
        if step.done:
            return angles, step, stamp
        yaw += 0.1 * speed * step.velocity[2]
        angles.append(yaw - 0.3)
    raise AssertionError("it does not end")


def test_a_free_robot_turns_once_around():
    angles, step, _ = turn(behaviour("RotateRecovery"))
    assert angles[-1] == pytest.approx(2 * math.pi, abs=0.15) and step.reason == ""


def test_a_robot_beside_a_wall_turns_to_the_other_side():
    costs = np.zeros((100, 100), np.uint8)
    costs[55, 40:60] = 254              # 0.25 m to the left of the robot, whose nose reaches 0.4 m
    with_wall, step, _ = turn(behaviour("RotateRecovery"), costs)
    assert min(with_wall) < 0.0 and step.reason


def test_a_robot_between_walls_does_not_turn_and_says_why():
    costs = np.zeros((100, 100), np.uint8)
    costs[55, 40:60] = costs[45, 40:60] = 254
    angles, step, _ = turn(behaviour("RotateRecovery"), costs)
    assert angles == [] and "would collide in both senses" in step.reason


def test_a_robot_that_cannot_turn_ends_after_some_seconds():
    _, step, stamp = turn(behaviour("RotateRecovery"), speed=0.0)
    assert "has turned less" in step.reason and stamp < 5.0


def back_out(made, costs, pose):
    """Follow the behaviour without inertia; return the last step and the pose."""
    x, y, yaw = pose
    made.begin(placed(0.0, (x, y, yaw), costs))
    for count in range(400):
        step = made.step(placed(0.1 * count, (x, y, yaw), costs))
        if step.done:
            return step, (x, y, yaw)
        assert step.velocity[0] < 0.0
        yaw += 0.1 * step.velocity[2]
        x, y = x + 0.1 * step.velocity[0] * math.cos(yaw), y + 0.1 * step.velocity[0] * math.sin(yaw)
    pytest.fail("it does not end")


def placed(stamp, pose, costs):
    return Situation(stamp, 0.1, np.array(pose), np.zeros(3), np.zeros((1, 3)),
                     Costmap(costs, 0.05, np.array([-2.5, -2.5]), "odom"), FOOTPRINT)


def test_back_up_leaves_a_corridor_too_narrow_to_turn():
    costs = np.zeros((100, 100), np.uint8)
    costs[[46, 53], 40:] = 254                  # walls at y = -0.2 and 0.2, from x = -0.5 on
    step, pose = back_out(behaviour("BackUpRecovery", None, distance=2.0), costs, (0.3, 0.0, 0.0))
    assert "can turn after" in step.reason
    assert pose[0] < -0.8 and abs(pose[1]) < 0.05       # the tip, 0.4 m ahead, is out of the corridor


def test_back_up_does_nothing_where_the_robot_can_turn():
    step, pose = back_out(behaviour("BackUpRecovery"), np.zeros((100, 100), np.uint8), (0.0, 0.0, 0.0))
    assert step.done and not step.reason and pose == (0.0, 0.0, 0.0)


def test_back_up_continues_if_a_corner_would_graze_an_obstacle():
    """A corner is in a cell for a few hundredths of a radian, which the turn of the next recovery behaviour sees."""
    rng, grazed, costs = np.random.default_rng(3), 0, np.zeros((100, 100), np.uint8)
    costs[50, 58] = 254
    for _ in range(4000):
        x, y, yaw = rng.uniform(-0.03, 0.0), rng.uniform(-0.1, 0.1), rng.uniform(-1.4, 1.4)
        here = placed(0.0, (x, y, yaw), costs)
        rows = [outline_cost(costs, 0.05, here.costmap.origin, FOOTPRINT, x, y, yaw + turned) == IN_COLLISION
                for turned in np.arange(-1.6, 1.601, 0.01)]
        if any(rows) and not any(rows[::5]):
            grazed += 1
            assert not behaviour("BackUpRecovery").step(here).done
    assert grazed >= 3


def test_back_up_ends_before_a_wall_behind():
    costs = np.zeros((100, 100), np.uint8)
    costs[[46, 53], :] = 254
    costs[46:54, 40] = 254                      # x = -0.5
    step, pose = back_out(behaviour("BackUpRecovery", None, distance=2.0), costs, (0.0, 0.0, 0.0))
    assert "would collide backwards" in step.reason
    assert -0.3 < pose[0] < -0.2                # its end is 0.2 m behind its origin


def test_back_up_ends_if_the_robot_does_not_move():
    costs = np.zeros((100, 100), np.uint8)
    costs[[46, 53], :] = 254
    made = behaviour("BackUpRecovery")
    made.begin(placed(0.0, (0.0, 0.0, 0.0), costs))
    steps = [made.step(placed(0.1 * count, (0.0, 0.0, 0.0), costs)) for count in range(40)]
    assert "has moved less than" in next(step for step in steps if step.done).reason

# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np

from local_situations import free, made, situation
from m2wr_navigation.controllers.dwa import Dwa
from m2wr_navigation.controllers.plan_progress import PlanProgress


def corridor_and_back():
    """Ahead along y = 0 for 2.5 m, and back along y = 0.5."""
    ahead = np.linspace(0.0, 2.5, 51)
    points = np.vstack([np.column_stack([ahead, 0.0 * ahead]), np.column_stack([ahead[::-1], 0.0 * ahead + 0.5])])
    return np.column_stack([points, np.zeros(len(points))])


def test_the_nearer_leg_of_a_plan_that_comes_back_is_not_taken():
    progress, plan = PlanProgress(), corridor_and_back()
    for x in np.arange(0.0, 1.0, 0.1):
        passed = progress.advance(plan, np.array([x, 0.4, 0.0]), 3.0)       # 0.1 m from the other leg
        np.testing.assert_allclose(plan[passed, :2], [x, 0.0], atol=0.03)


def test_it_turns_with_the_plan_and_never_back():
    progress, plan, before = PlanProgress(), corridor_and_back(), 0
    for pose in plan:
        passed = progress.advance(plan, pose, 3.0)
        assert passed >= before
        before = passed
    assert before == len(plan) - 1
    assert progress.advance(plan, plan[0], 3.0) > 51         # it does not forget the first leg


def test_a_robot_that_left_the_plan_takes_it_up_again():
    progress, plan = PlanProgress(), corridor_and_back()
    assert progress.advance(plan, np.array([0.0, 9.0, 0.0]), 3.0) is None
    for y in np.arange(0.0, 2.5, 0.1):          # off the plan, then near its end only
        progress.advance(plan, np.array([0.0, -0.5 * y, 0.0]), 3.0)
    for _ in range(3):
        passed = progress.advance(plan, np.array([2.9, 0.2, 0.0]), 0.6)
    assert math.hypot(*(plan[passed, :2] - [2.5, 0.2])) < 0.3


def test_a_new_plan_begins_at_its_first_pose():
    progress, plan = PlanProgress(), corridor_and_back()
    progress.advance(plan, plan[30], 3.0)
    assert progress.advance(plan, plan[2], 3.0) == 30
    progress.reset()
    assert progress.advance(plan, plan[2], 3.0) == 2


def test_a_controller_stays_on_its_leg_behind_a_thin_wall():
    """Without new plans, with both legs in the local costmap."""
    costmap, plan = free(), corridor_and_back()
    costmap.costs[66, :105] = 254           # between the legs, at y = 0.3
    dwa = made(Dwa)
    dwa.set_plan(plan, True)
    for x in np.arange(0.0, 0.8, 0.1):
        command = dwa.compute(situation(costmap, plan, (x, 0.05, 0.0)))
        assert command.used_plan[0, 1] == 0.0 and abs(command.used_plan[0, 0] - x) < 0.03
        assert command.velocity is not None and command.velocity[0] > 0.0

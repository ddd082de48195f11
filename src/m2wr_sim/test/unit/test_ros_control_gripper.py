# SPDX-License-Identifier: BSD-3-Clause
"""The gripper's action: reached, stalled, rejected, cancelled."""
import math

import pytest
from actionlib_msgs.msg import GoalID
from control_msgs.msg import GripperCommandActionGoal

from control_robots import EFFORT, POSITION, arm

PREEMPTED, SUCCEEDED, ABORTED, REJECTED = 2, 3, 4, 5
POSITION_GRIPPER = {"type": "position_controllers/GripperActionController", "joint": "elbow"}
EFFORT_GRIPPER = {"type": "effort_controllers/GripperActionController", "joint": "elbow", "stall_timeout": 0.5,
                  "stall_velocity_threshold": 0.01, "gains": {"elbow": {"p": 300.0, "d": 30.0}}}


def goal(name, position, effort=0.0):
    message = GripperCommandActionGoal()
    message.goal_id.id, message.goal.command.position, message.goal.command.max_effort = name, position, effort
    return message


def results(robot):
    return {message.status.goal_id.id: (message.status.status, message.result.reached_goal, message.result.stalled)
            for message in robot.ports.topics["/gripper/gripper_cmd/result"].messages}


def test_goal_is_reached(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, gripper=POSITION_GRIPPER)
    robot.begin("gripper")
    robot.send("/gripper/gripper_cmd/goal", goal("close", 0.5))
    robot.run(0.5)
    assert results(robot) == {"close": (SUCCEEDED, True, False)}
    assert robot.angle("elbow") == pytest.approx(0.5, abs=0.011)


def test_goal_that_stalls_is_aborted(make_robot):
    """1 kg at 0.5 m weighs 4.9 N m: 3 N m do not hold it, and it hangs at the limit of its joint."""
    robot = make_robot(arm(EFFORT, limit='<limit lower="-0.2" upper="0.2" effort="50" velocity="3"/>'), z=0.0,
                       gripper=EFFORT_GRIPPER)
    robot.begin("gripper")
    robot.send("/gripper/gripper_cmd/goal", goal("lift", -0.15, 3.0))
    robot.run(2.5)
    assert results(robot) == {"lift": (ABORTED, False, True)}


def test_goals_are_rejected_and_cancelled(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, gripper=dict(POSITION_GRIPPER, goal_tolerance=1e-6))
    assert robot.load("gripper")
    robot.send("/gripper/gripper_cmd/goal", goal("early", 0.1))
    robot.run(0.1)
    assert robot.switch(["gripper"])
    robot.send("/gripper/gripper_cmd/goal", goal("nan", math.nan))
    robot.run(0.1)
    assert {name: entry[0] for name, entry in results(robot).items()} == {"early": REJECTED, "nan": REJECTED}
    robot.send("/gripper/gripper_cmd/goal", goal("far", 1.9))
    robot.run(0.1)
    robot.send("/gripper/gripper_cmd/cancel", GoalID())
    robot.run(0.1)
    there = robot.angle("elbow")
    robot.run(0.3)
    assert results(robot)["far"][0] == PREEMPTED
    assert robot.angle("elbow") == pytest.approx(there, abs=0.02)

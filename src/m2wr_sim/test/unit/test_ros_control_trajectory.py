# SPDX-License-Identifier: BSD-3-Clause
"""Trajectories of joints: polynomials, the action, tolerances."""
import math

import numpy as np
import pytest
import rospy
from actionlib_msgs.msg import GoalID
from control_msgs.msg import FollowJointTrajectoryActionGoal, JointTolerance
from control_msgs.srv import QueryTrajectoryStateRequest
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from control_robots import EFFORT, POSITION, VELOCITY, arm
from m2wr_sim.ros_control.pid import Gains, Pid, read_gains
from m2wr_sim.ros_control.speed_limiter import SpeedLimiter
from m2wr_sim.ros_control.trajectory import State, TrajectoryError, follow, hold, stop

ACTION = "/arm_controller/follow_joint_trajectory"
CONTROLLER = {"type": "position_controllers/JointTrajectoryController", "joints": ["elbow"]}
PREEMPTED, SUCCEEDED, ABORTED, REJECTED = 2, 3, 4, 5


def trajectory(*points, names=("elbow",), begin=0.0):
    """A message; each point is (time, positions, velocities, accelerations), the last two may be missing."""
    message = JointTrajectory(joint_names=list(names))
    message.header.stamp = rospy.Time(begin)
    for time, *values in points:
        point = JointTrajectoryPoint(time_from_start=rospy.Duration(time))
        for field, numbers in zip(("positions", "velocities", "accelerations"), values):
            setattr(point, field, list(numbers))
        message.points.append(point)
    return message


def goal(name, *points, **options):
    message = FollowJointTrajectoryActionGoal()
    message.goal_id.id = name
    tolerances = options.pop("path", []), options.pop("at_goal", [])
    message.goal.path_tolerance, message.goal.goal_tolerance = tolerances
    message.goal.goal_time_tolerance = rospy.Duration(options.pop("patience", 0.0))
    message.goal.trajectory = trajectory(*points, **options)
    return message


def results(robot):
    return {message.status.goal_id.id: (message.status.status, message.result.error_code)
            for message in robot.ports.topics[ACTION + "/result"].messages}


@pytest.mark.parametrize("last, rates", [
    ((2.0, [1.0]), lambda t: (0.5 * t, 0.5)),
    ((2.0, [1.0], [0.0]), lambda t: (0.75 * t ** 2 - 0.25 * t ** 3, 1.5 * t - 0.75 * t ** 2)),
    ((2.0, [1.0], [0.0], [0.0]), lambda t: (1.25 * t ** 3 - 0.9375 * t ** 4 + 0.1875 * t ** 5,
                                            3.75 * t ** 2 - 3.75 * t ** 3 + 0.9375 * t ** 4))])
def test_segments_are_linear_cubic_or_quintic(last, rates):
    path, remark = follow(trajectory(last), ["elbow"], [False], 0.0, hold([0.0], 0.0))
    assert remark == ""
    for t in np.linspace(0.0, 2.0, 21)[:-1]:
        state = path.sample(t)
        assert (state.positions[0], state.velocities[0]) == pytest.approx(rates(t), abs=1e-12)
    assert path.sample(5.0) == State((pytest.approx(1.0),), (0.0,), (0.0,))


def test_new_trajectory_joins_the_old_one_at_its_start():
    old, _ = follow(trajectory((2.0, [2.0])), ["elbow"], [False], 0.0, hold([0.0], 0.0))
    new, _ = follow(trajectory((1.0, [0.0]), begin=1.0), ["elbow"], [False], 0.5, old)
    assert [new.sample(time).positions[0] for time in (0.5, 1.0, 1.5, 2.0)] == pytest.approx([0.5, 1.0, 0.5, 0.0])


def test_points_in_the_past_are_dropped():
    message = trajectory((0.5, [5.0]), (2.0, [2.0]), begin=1.0)
    path, remark = follow(message, ["elbow"], [False], 2.0, hold([0.0], 0.0))
    assert remark == "Dropping first 1 trajectory point(s) out of 2, as they occur before the current time."
    assert path.sample(2.5).positions[0] == pytest.approx(1.0)
    with pytest.raises(TrajectoryError, match=r"Dropping all 2 .* Last point is 2\.000000 s in the past"):
        follow(message, ["elbow"], [False], 5.0, hold([0.0], 0.0))


def test_continuous_joints_take_the_short_way():
    path, _ = follow(trajectory((1.0, [-3.0])), ["elbow"], [True], 0.0, hold([3.0], 0.0))
    assert path.sample(1.0).positions[0] == pytest.approx(math.tau - 3.0)


def test_stop_comes_to_rest():
    path = stop(State((1.0,), (0.5,), (0.0,)), 2.0, 0.4)
    assert path.sample(2.0).velocities[0] == pytest.approx(0.5)
    assert path.sample(2.4).positions[0] == pytest.approx(1.1)
    assert path.sample(3.0).velocities[0] == 0.0


@pytest.mark.parametrize("message, told", [
    (trajectory((1.0, [0.0]), names=("wrist",)), "don't match the controller joints. Read wrist; expected elbow"),
    (trajectory((1.0, [0.0]), (1.0, [1.0])), "not strictly increasing in time. Point 1 is at 1 s"),
    (trajectory((1.0, [0.0, 1.0])), "Size mismatch in trajectory point 0: read 2 positions"),
    (trajectory((1.0, [math.inf])), "Trajectory point 0 holds a number that is not finite"),
    (trajectory(), "Trajectory has 0 points")])
def test_trajectory_that_cannot_be_followed_is_told(message, told):
    with pytest.raises(TrajectoryError) as error:
        follow(message, ["elbow"], [False], 0.0, hold([0.0], 0.0))
    assert told in str(error.value)


@pytest.mark.parametrize("kind, interface, values", [
    ("position", POSITION, {}),
    ("effort", EFFORT, {"gains": {"elbow": {"p": 800.0, "d": 60.0, "i": 500.0, "i_clamp": 30.0}}}),
    ("velocity", VELOCITY, {"gains": {"elbow": {"p": 10.0}}, "velocity_ff": {"elbow": 1.0}})])
def test_arm_follows_the_goal_of_an_action(make_robot, kind, interface, values):
    values = dict(CONTROLLER, type=kind + "_controllers/JointTrajectoryController", constraints={
        "goal_time": 1.0, "elbow": {"goal": 0.02, "trajectory": 0.2}}, **values)
    robot = make_robot(arm(interface), z=0.0, arm_controller=values)
    robot.begin("arm_controller")
    robot.send(ACTION + "/goal", goal("one", (1.0, [-0.5], [0.0]), (2.0, [0.3], [0.0])))
    robot.run(1.0)
    assert robot.angle("elbow") == pytest.approx(-0.5, abs=0.03)
    assert results(robot) == {}
    assert robot.ports.topics[ACTION + "/feedback"].messages[-1].feedback.joint_names == ["elbow"]
    robot.run(2.0)
    assert results(robot) == {"one": (SUCCEEDED, 0)}
    assert robot.angle("elbow") == pytest.approx(0.3, abs=0.02)
    assert len(robot.ports.topics["/arm_controller/state"].messages) == pytest.approx(150, abs=3)


def test_newer_goal_replaces_the_older_one_and_a_cancel_holds(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    robot.begin("arm_controller")
    robot.send(ACTION + "/goal", goal("one", (2.0, [1.0])))
    robot.run(0.5)
    robot.send(ACTION + "/goal", goal("two", (2.0, [-1.0])))
    robot.run(0.5)
    assert results(robot) == {"one": (PREEMPTED, 0)}
    robot.send(ACTION + "/cancel", GoalID())
    robot.run(0.1)
    there = robot.angle("elbow")
    robot.run(1.0)
    assert results(robot)["two"] == (PREEMPTED, 0)
    assert robot.angle("elbow") == pytest.approx(there, abs=0.02)


def test_two_goals_between_two_steps_both_get_a_result(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    robot.begin("arm_controller")
    for name in ("one", "two"):
        robot.send(ACTION + "/goal", goal(name, (0.5, [0.2])))
    robot.run(1.0)
    assert results(robot) == {"one": (PREEMPTED, 0), "two": (SUCCEEDED, 0)}


def test_goals_are_rejected_with_their_code(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    assert robot.load("arm_controller")
    robot.send(ACTION + "/goal", goal("early", (1.0, [0.1])))
    robot.run(0.1)
    assert robot.switch(["arm_controller"])
    robot.send(ACTION + "/goal", goal("names", (1.0, [0.1]), names=("wrist",)))
    robot.send(ACTION + "/goal", goal("times", (1.0, [0.1]), (0.5, [0.2])))
    robot.run(0.1)
    assert results(robot) == {"early": (REJECTED, -1), "names": (REJECTED, -2), "times": (REJECTED, -1)}


def test_a_goal_in_the_past_is_rejected_and_the_arm_stays(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    robot.begin("arm_controller")
    robot.run(3.0)
    robot.send(ACTION + "/goal", goal("late", (0.5, [0.5]), (1.0, [1.0]), begin=1.0))
    robot.run(0.5)
    result = robot.ports.topics[ACTION + "/result"].messages[-1]
    assert (result.status.status, result.result.error_code) == (REJECTED, -1)
    assert "Dropping all 2" in result.result.error_string and "in the past" in result.result.error_string
    assert robot.angle("elbow") == pytest.approx(0.0, abs=1e-3)
    robot.send("/arm_controller/command", trajectory((0.5, [0.5]), begin=1.0))
    robot.run(0.5)
    assert robot.angle("elbow") == pytest.approx(0.0, abs=1e-3)
    robot.send(ACTION + "/goal", goal("now", (0.5, [0.5])))
    robot.run(1.0)
    assert results(robot)["now"] == (SUCCEEDED, 0)


@pytest.mark.parametrize("options, code", [
    ({"path": [JointTolerance("elbow", 0.05, 0.0, 0.0)]}, -4),
    ({"at_goal": [JointTolerance("elbow", 0.01, 0.0, 0.0)], "patience": 0.1}, -5)])
def test_goal_is_aborted_when_a_tolerance_is_violated(make_robot, options, code):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    robot.begin("arm_controller")
    robot.send(ACTION + "/goal", goal("fast", (0.1, [1.9]), **options))     # the joint's limit is 3 rad/s
    robot.run(0.3)
    assert results(robot) == {"fast": (ABORTED, code)}


def test_topic_command_and_query(make_robot):
    robot = make_robot(arm(POSITION), z=0.0, arm_controller=CONTROLLER)
    robot.begin("arm_controller")
    robot.send("/arm_controller/command", trajectory((1.0, [0.8])))
    robot.run(0.5)
    query = robot.ports.services["/arm_controller/query_state"].callback
    state = query(QueryTrajectoryStateRequest(rospy.Time(robot.simulator.now_ns * 1e-9)))
    assert state.name == ["elbow"] and state.position[0] == pytest.approx(0.4, abs=0.005)
    assert state.velocity[0] == pytest.approx(0.8)
    robot.send("/arm_controller/command", JointTrajectory())
    robot.run(1.0)
    assert robot.angle("elbow") == pytest.approx(0.4, abs=0.02)


def test_pid_clamps_its_integral():
    pid = Pid(Gains(p=1.0, i=10.0, d=0.0, i_min=-0.5, i_max=0.5))
    assert [pid.update(1.0, 0.1) for _ in range(3)] == pytest.approx([1.5, 1.5, 1.5])
    assert pid.integral == pytest.approx(0.3)
    wound = Pid(Gains(p=0.0, i=10.0, d=0.0, i_min=-0.5, i_max=0.5, antiwindup=True))
    for _ in range(9):
        wound.update(1.0, 0.1)
    assert wound.integral == pytest.approx(0.05)
    assert Pid(Gains(p=1.0)).update(math.nan, 0.1) == 0.0 and Pid(Gains(p=1.0)).update(1.0, 0.0) == 0.0
    assert read_gains({"p": 1, "i": 2, "i_clamp": 3}, "here") == Gains(1.0, 2.0, 0.0, -3.0, 3.0)


def test_derivative_begins_at_zero():
    pid = Pid(Gains(d=2.0))
    assert [pid.update(error, 0.5) for error in (1.0, 2.0)] == [0.0, 4.0]


def test_speed_limits_apply_in_order():
    limiter = SpeedLimiter(velocity=(-1.0, 1.0), acceleration=(-2.0, 2.0))
    speeds = [0.0, 0.0]
    for _ in range(8):
        speeds.append(limiter.limit(3.0, speeds[-1], speeds[-2], 0.1))
    assert speeds[2:] == pytest.approx([0.2, 0.4, 0.6, 0.8, 1.0, 1.0, 1.0, 1.0])
    jerky = SpeedLimiter(jerk=(-10.0, 10.0))
    assert jerky.limit(3.0, 0.0, 0.0, 0.1) == pytest.approx(0.2)

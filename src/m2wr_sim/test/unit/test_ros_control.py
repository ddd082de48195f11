# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_control.so: joints, controllers and the services of their manager."""
import math

import pytest
from controller_manager_msgs.srv import SwitchControllerRequest, UnloadControllerRequest
from std_msgs.msg import Bool, Float64

from control_robots import DRIVE, EFFORT, PLACES, POSITION, STATES, VELOCITY, Robot, arm, cart, twist
from m2wr_sim.model.urdf.loader import load_urdf


def test_diff_drive_moves_and_its_odometry_agrees(make_robot):
    cart_ = make_robot(cart(), drive=DRIVE, states=STATES)
    cart_.begin("states", "drive")
    for _ in range(20):
        cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
        cart_.run(0.1)
    odometry = cart_.ports.topics["/drive/odom"].messages[-1]
    assert cart_.position()[0] == pytest.approx(1.0, abs=0.02)
    assert odometry.pose.pose.position.x == pytest.approx(cart_.position()[0], abs=0.01)
    assert odometry.twist.twist.linear.x == pytest.approx(0.5, abs=0.005)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_link")
    assert odometry.pose.covariance[0] == 0.001
    stamps = [message.header.stamp for message in cart_.ports.topics["/drive/odom"].messages]
    assert {later - earlier for earlier, later in zip(stamps, stamps[1:])} == {20000000}
    message = cart_.ports.topics["/joint_states"].messages[-1]
    assert message.name == sorted(PLACES) and message.velocity == pytest.approx([5.0] * 4, abs=0.05)


def test_command_ends_after_its_timeout(make_robot):
    cart_ = make_robot(cart(), drive=dict(DRIVE, cmd_vel_timeout=0.25))
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(1.0)
    stopped = cart_.position()[0]
    assert 0.1 < stopped < 0.15
    cart_.run(0.5)
    assert cart_.position()[0] == pytest.approx(stopped, abs=1e-3)


def test_acceleration_limit_is_kept(make_robot):
    limits = {"x": {"has_acceleration_limits": True, "max_acceleration": 0.5}}
    cart_ = make_robot(cart(), drive=dict(DRIVE, linear=limits, cmd_vel_timeout=5.0))
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(1.0, 0.0))
    cart_.run(1.0)
    assert cart_.ports.topics["/drive/odom"].messages[-1].twist.twist.linear.x == pytest.approx(0.5, abs=0.02)


def test_wheel_geometry_comes_from_the_description(make_robot):
    cart_ = make_robot(cart(), drive=DRIVE)
    assert cart_.load("drive")
    plugin = next(entry[0] for model in cart_.simulator.models.values() for entry in model.plugins)
    controller = plugin.manager.loaded["drive"].controller
    assert controller._separation == pytest.approx(0.5) and controller._radii == pytest.approx((0.1, 0.1))


@pytest.mark.parametrize("values, told", [
    (None, "type was not specified. Did you load the controller configuration"),
    ({"type": "diff_drive_controller/DifDriveController"}, "Did you mean diff_drive_controller/DiffDriveController?"),
    (dict(DRIVE, right_wheel="rear_right"), "#left wheels (2) != #right wheels (1)"),
    ({key: value for key, value in DRIVE.items() if key != "left_wheel"}, "Couldn't retrieve wheel param 'left_wheel'"),
    (dict(DRIVE, left_wheel=["front_left", "wing"]),
     "Could not find resource 'wing' in 'hardware_interface::VelocityJointInterface'"),
    (dict(DRIVE, wheel_radius=math.nan), "/drive/wheel_radius: read nan; expected a finite number"),
    (dict(DRIVE, publish_rate=0), "/drive/publish_rate: read 0; expected a rate above 0 Hz"),
    (dict(DRIVE, pose_covariance_diagonal=[1, 2]), "pose_covariance_diagonal: read [1, 2]; expected a list of 6"),
    (dict(DRIVE, linear={"x": {"has_velocity_limits": True}}), "/drive/linear/x/max_velocity: read None"),
    ({"type": "effort_controllers/JointEffortController", "joint": "front_left"},
     "requires a hardware interface of type 'hardware_interface::EffortJointInterface'"),
    ({"type": "joint_state_controller/JointStateController"}, "Parameter 'publish_rate' not set")])
def test_controller_that_cannot_be_loaded_says_why(make_robot, caplog, values, told):
    cart_ = make_robot(cart(), drive=values)
    assert not cart_.load("drive")
    assert told in caplog.text
    assert cart_.states() == {}
    cart_.run(0.1)


def test_states_of_a_controller(make_robot, caplog):
    cart_ = make_robot(cart(), drive=DRIVE, states=STATES)
    assert cart_.load("drive") and not cart_.load("drive")
    assert "A controller named 'drive' was already loaded" in caplog.text
    assert cart_.states() == {"drive": "initialized"}
    assert cart_.switch(["drive"]) and cart_.states() == {"drive": "running"}
    assert not cart_.switch(["drive"]) and "Controller 'drive' is already running" in caplog.text
    assert not cart_.call("unload_controller", UnloadControllerRequest("drive")).ok
    assert not cart_.switch(["other"]) and "Could not start controller with name 'other'" in caplog.text
    assert cart_.switch(["other"], strictness=SwitchControllerRequest.BEST_EFFORT)
    assert cart_.switch(stop=["drive"]) and cart_.states() == {"drive": "stopped"}
    assert cart_.call("unload_controller", UnloadControllerRequest("drive")).ok and cart_.states() == {}
    assert cart_.load("drive")


def test_one_joint_has_one_controller(make_robot, caplog):
    wheel = {"type": "velocity_controllers/JointVelocityController", "joint": "front_left"}
    cart_ = make_robot(cart(), drive=DRIVE, wheel=wheel)
    cart_.begin("drive")
    assert cart_.load("wheel") and not cart_.switch(["wheel"])
    assert "resource conflict: joint 'front_left' would belong to 'drive' and 'wheel'" in caplog.text
    assert cart_.switch(["wheel"], ["drive"])
    assert cart_.states() == {"drive": "stopped", "wheel": "running"}


def test_robot_brakes_when_its_controller_stops(make_robot):
    cart_ = make_robot(cart(), drive=DRIVE)
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.3)
    assert cart_.switch(stop=["drive"])
    cart_.run(0.2)
    there = cart_.position()[0]
    cart_.run(0.5)
    assert cart_.position()[0] == pytest.approx(there, abs=1e-3)


def test_several_publishers_of_commands_brake_the_robot(make_robot, caplog):
    cart_ = make_robot(cart(), drive=dict(DRIVE, allow_multiple_cmd_vel_publishers=False, cmd_vel_timeout=9.0))
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.5)
    cart_.ports.subscriptions["/drive/cmd_vel"].senders = 2
    cart_.run(0.5)
    there = cart_.position()[0]
    assert caplog.text.count("Detected 2 publishers. Only 1 publisher is allowed. Going to brake.") == 1
    cart_.run(0.5)
    assert cart_.position()[0] == pytest.approx(there, abs=1e-3)
    cart_.ports.subscriptions["/drive/cmd_vel"].senders = 1
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.5)
    assert cart_.position()[0] > there + 0.1


def test_state_of_the_wheels_is_published(make_robot):
    cart_ = make_robot(cart(), drive=dict(DRIVE, publish_wheel_joint_controller_state=True))
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.4)
    message = cart_.ports.topics["/drive/wheel_joint_controller_state"].messages[-1]
    assert message.joint_names == ["front_left", "rear_left", "front_right", "rear_right"]
    assert message.desired.velocities == pytest.approx([5.0] * 4)
    assert message.actual.velocities == pytest.approx([5.0] * 4, abs=0.05)
    assert message.error.positions == pytest.approx([0.0] * 4, abs=0.1)


def test_controllers_are_switched_under_load(make_robot):
    wheels = {name: {"type": "velocity_controllers/JointVelocityController", "joint": name} for name in PLACES}
    cart_ = make_robot(cart(), drive=DRIVE, states=STATES, **wheels)
    cart_.begin("states", "drive")
    assert all([cart_.load(name) for name in wheels])
    for _ in range(50):
        cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
        cart_.run(0.002)
        assert cart_.switch(list(wheels), ["drive"])
        for name in wheels:
            cart_.send("/%s/command" % name, Float64(5.0))
        cart_.run(0.002)
        assert cart_.switch(["drive"], list(wheels))
    assert cart_.states() == dict({name: "stopped" for name in wheels}, drive="running", states="running")
    stamps = [message.header.stamp for message in cart_.ports.topics["/joint_states"].messages]
    assert stamps and all(earlier < later for earlier, later in zip(stamps, stamps[1:]))
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    start = cart_.position()[0]
    cart_.run(0.4)
    assert cart_.position()[0] - start == pytest.approx(0.2, abs=0.03)


def test_emergency_stop_and_its_release(make_robot):
    cart_ = make_robot(cart("<eStopTopic>stop</eStopTopic>"), drive=dict(DRIVE, cmd_vel_timeout=10.0))
    cart_.begin("drive")
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.5)
    cart_.send("/stop", Bool(True))
    cart_.run(0.3)
    there = cart_.position()[0]
    cart_.run(0.5)
    assert cart_.position()[0] == pytest.approx(there, abs=1e-3)
    cart_.send("/stop", Bool(False))
    cart_.run(0.1)
    cart_.send("/drive/cmd_vel", twist(0.5, 0.0))
    cart_.run(0.5)
    assert cart_.position()[0] > there + 0.2


def test_controllers_publish_again_after_a_reset(make_robot):
    cart_ = make_robot(cart(), drive=DRIVE, states=STATES)
    cart_.begin("drive", "states")
    cart_.run(1.0)
    cart_.simulator.reset_simulation()
    topics = [cart_.ports.topics[name] for name in ("/drive/odom", "/joint_states")]
    for topic in topics:
        topic.messages.clear()
    cart_.run(0.2)
    assert all(len(topic.messages) >= 9 for topic in topics)


def test_plugin_waits_for_the_description(make_rig, caplog):
    rig = make_rig()
    text = cart()
    robot = Robot(rig, text, {"drive": DRIVE})
    late = make_rig()
    late.simulator.spawn(load_urdf(text, "test"), ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0, 1.0)), namespace="/")
    assert "/controller_manager/load_controller" not in late.simulator.ports.services
    late.simulator.advance(int(1e8))
    while late.simulator.now_ns < 6e9:
        late.simulator.advance(int(6e9))
    assert "found no parameter robot_description in / or above it for 5 s" in caplog.text
    late.simulator.ports.parameters["/robot_description"] = text
    until = late.simulator.now_ns + int(3e8)
    while late.simulator.now_ns < until:
        late.simulator.advance(until)
    assert "/controller_manager/load_controller" in late.simulator.ports.services
    assert robot.states() == {}


@pytest.mark.parametrize("before, after, told", [
    (VELOCITY, "hardware_interface/JointStateInterface", "No matching hardware interface found for"),
    ('<joint name="front_left">\n<hardw', '<joint name="tail">\n<hardw', "joint named \"tail\" which is not in the"),
    ("</robot>", "", "parameter /robot_description")])
def test_unusable_description_is_told(make_rig, caplog, before, after, told):
    rig, text = make_rig(), cart()
    rig.simulator.ports.parameters["/robot_description"] = text.replace(before, after, 1)
    rig.simulator.spawn(load_urdf(text, "test"), ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0, 1.0)), namespace="/")
    assert told in caplog.text and "will not run" in caplog.text
    rig.simulator.advance(int(1e7))


@pytest.mark.parametrize("kind, interface, gains", [
    ("position_controllers/JointPositionController", POSITION, None),
    ("effort_controllers/JointPositionController", EFFORT, {"p": 300.0, "d": 30.0, "i": 100.0, "i_clamp": 20.0}),
    ("velocity_controllers/JointPositionController", VELOCITY, {"p": 10.0})])
def test_arm_reaches_a_position_against_gravity(make_robot, kind, interface, gains):
    values = {"type": kind, "joint": "elbow"}
    if gains is not None:
        values["pid"] = gains
    arm_ = make_robot(arm(interface), z=0.0, elbow_position=values)
    arm_.begin("elbow_position")
    arm_.send("/elbow_position/command", Float64(-0.7))
    arm_.run(3.0)
    assert arm_.angle("elbow") == pytest.approx(-0.7, abs=0.01)
    arm_.send("/elbow_position/command", Float64(math.nan))
    arm_.run(0.1)
    assert arm_.angle("elbow") == pytest.approx(-0.7, abs=0.01)


def test_position_joint_holds_before_it_is_controlled(make_robot):
    arm_ = make_robot(arm(POSITION), z=0.0)
    arm_.run(1.0)
    assert arm_.angle("elbow") == pytest.approx(0.0, abs=1e-3)


def test_position_command_keeps_velocity_and_position_limits(make_robot):
    values = {"type": "position_controllers/JointPositionController", "joint": "elbow"}
    arm_ = make_robot(arm(POSITION), z=0.0, move=values)
    arm_.begin("move")
    arm_.send("/move/command", Float64(9.0))
    arm_.run(0.5)
    assert arm_.angle("elbow") == pytest.approx(1.5, abs=0.02)      # 3 rad/s
    arm_.run(1.0)
    assert arm_.angle("elbow") == pytest.approx(2.0, abs=0.01)


def test_gains_make_a_velocity_joint_pushed_by_a_pid(make_robot):
    arm_ = make_robot(arm(VELOCITY, kind="continuous", limit=""), z=0.0,
                      move={"type": "velocity_controllers/JointVelocityController", "joint": "elbow"},
                      **{"gazebo_ros_control/pid_gains/elbow": {"p": 50.0, "i": 200.0, "i_clamp": 100.0}})
    arm_.begin("move")
    arm_.send("/move/command", Float64(1.0))
    arm_.run(2.0)
    before = arm_.angle("elbow")
    arm_.run(0.5)
    assert arm_.angle("elbow") - before == pytest.approx(0.5, abs=0.1)


@pytest.mark.parametrize("gains, told", [
    ({"i": 1.0}, "No p gain specified for pid.  Namespace: /gazebo_ros_control/pid_gains/elbow. It has only i"),
    ({"p": math.nan}, "/gazebo_ros_control/pid_gains/elbow/p: read nan; expected a finite number"),
    ({"p": 1.0, "i_clamp_min": 2.0}, "read i_clamp_min 2 and i_clamp_max 0"),
    ("high", "read 'high'; expected gains with at least p")])
def test_unusable_gains_are_told(make_robot, caplog, gains, told):
    arm_ = make_robot(arm(VELOCITY), z=0.0, **{"gazebo_ros_control/pid_gains/elbow": gains})
    assert told in caplog.text
    arm_.run(0.1)


@pytest.mark.parametrize("kind, values, told", [
    ("effort_controllers/JointPositionController", {"joint": "elbow", "pid": {"p": math.nan}},
     "/move/pid/p: read nan; expected a finite number"),
    ("effort_controllers/JointVelocityController", {"joint": "elbow", "pid": {"p": 1.0, "i": math.inf}},
     "/move/pid/i: read inf; expected a finite number"),
    ("effort_controllers/JointTrajectoryController", {"joints": ["elbow"], "gains": {"elbow": {"p": math.nan}}},
     "/move/gains/elbow/p: read nan; expected a finite number"),
    ("effort_controllers/JointTrajectoryController", {"joints": ["elbow"], "gains": {"wrist": {"p": 1.0}}},
     "/move/gains/elbow")])
def test_unusable_gains_of_a_controller_are_told(make_robot, caplog, kind, values, told):
    arm_ = make_robot(arm(EFFORT), z=0.0, states=STATES, move=dict(values, type=kind))
    arm_.begin("states")
    assert not arm_.load("move")
    assert told in caplog.text
    arm_.run(0.1)
    assert arm_.states() == {"states": "running"}


@pytest.mark.parametrize("limits, told", [
    ({"has_velocity_limits": True}, "/joint_limits/elbow/max_velocity: read None; expected a finite number"),
    ({"has_position_limits": True, "min_position": 1.0, "max_position": -1.0}, "min_position 1 above max_position -1"),
    (3, "/joint_limits/elbow: read 3; expected a mapping of limits")])
def test_unusable_limits_are_told(make_robot, caplog, limits, told):
    make_robot(arm(VELOCITY), z=0.0, **{"joint_limits/elbow": limits}).run(0.1)
    assert told in caplog.text


def test_controller_that_fails_is_stopped_alone(make_robot, caplog, monkeypatch):
    arm_ = make_robot(arm(POSITION), z=0.0, states=STATES,
                      move={"type": "position_controllers/JointPositionController", "joint": "elbow"})
    arm_.begin("states", "move")
    monkeypatch.setattr("m2wr_sim.ros_control.controllers.forward.Forward.update", lambda *values: 1 / 0)
    arm_.run(0.1)
    assert arm_.states() == {"states": "running", "move": "stopped"}
    assert "controller 'move' failed and is stopped" in caplog.text
    monkeypatch.setattr("m2wr_sim.ros_control.controllers.forward.Forward.starting", lambda *values: 1 / 0)
    assert not arm_.switch(["move"]) and "controller 'move' failed when it was started" in caplog.text

# SPDX-License-Identifier: BSD-3-Clause
"""The differential drive plugin in a simulation: topics, update times, odometry, sides, rejections, resets."""
import logging
import math
from dataclasses import replace

import pytest

from conftest import at
from m2wr_sim.geometry import rpy_from_quaternion, yaw_of
from m2wr_sim.model.types import PluginSpec

PLUGIN = "differential_drive_controller"


def with_tags(robot, **tags):
    """Return the robot with tags of its drive plugin set, or taken out where None."""
    plugins = []
    for spec in robot.plugins:
        if spec.name == PLUGIN:
            kept = tuple(pair for pair in spec.parameters if pair[0] not in tags)
            spec = replace(spec, parameters=kept + tuple((tag, text) for tag, text in tags.items() if text is not None))
        plugins.append(spec)
    return replace(robot, plugins=tuple(plugins))


@pytest.fixture
def make(m2wr_rig, m2wr):
    """Return a function that makes a rig with m2wr, tags of its plugin in capitals' stead as ``tags``."""
    def make_with(tags=None, **options):
        return m2wr_rig(robot=with_tags(options.pop("robot", m2wr), **(tags or {})), **options)
    return make_with


def said_with(caplog, words):
    return [record.getMessage() for record in caplog.records
            if words in record.getMessage()]


# -- times --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("step_ms, times", [(1, [51, 101, 151, 201]), (2, [52, 102, 152, 202]),
                                            (5, [55, 105, 155, 205])])
def test_odometry_comes_at_gazebos_times(make, step_ms, times):
    rig = make(step_ms=step_ms).run(0.25)
    assert rig.stamps_ms("/odom") == times
    assert [stamp / 1e6 for stamp, *_ in rig.ports.transforms] == times


def test_a_robot_spawned_later_counts_from_there(make_rig, m2wr):
    rig = make_rig().run(0.2)
    rig.simulator.spawn(m2wr, at(z=0.1), namespace="/")
    assert rig.run(0.12).stamps_ms("/odom") == [251, 301]


def test_no_rate_means_every_step(make):
    assert make({"updateRate": "0"}).run(0.006).stamps_ms("/odom") == [1, 2, 3, 4, 5, 6]


def test_a_command_acts_at_the_next_tick_and_the_newest_wins(make):
    rig = make(wheel_convention="kinetic").run(0.110)
    rig.send(-0.5, 0.0).run(0.010).send(0.5, 0.0).run(0.030)
    assert rig.rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-3)
    assert rig.run(0.020).rate("joint_left_wheel") > 0.5
    assert rig.run(1.0).rate("joint_left_wheel") == pytest.approx(5.0, rel=1e-3)


def test_odometry_at_a_tick_shows_the_state_before_its_command(make):
    rig = make().run(0.1).send(0.5, 0.0).run(0.1)
    before, after = rig.messages("/odom")[1:3]
    assert before.twist.twist.linear.x == pytest.approx(0.0, abs=1e-4) and after.twist.twist.linear.x > 0.05


def test_a_command_given_while_paused_acts_afterwards(make):
    rig = make().run(0.1)
    rig.simulator.paused = True
    rig.send(0.5, 0.0)
    assert rig.simulator.advance(10 ** 9) == 10 ** 8 and len(rig.messages("/odom")) == 1
    rig.simulator.paused = False
    assert rig.run(1.0).rate("joint_left_wheel") == pytest.approx(5.0, rel=1e-3)


def test_the_last_command_holds_for_ever(make):
    rig = make(step_ms=5).send(0.2, 0.0).run(30.0)
    assert rig.messages("/odom")[-1].twist.twist.linear.x == pytest.approx(0.2, rel=1e-3)


@pytest.mark.parametrize("timeout_ms", [20, 300])
def test_a_command_timeout_stops_the_robot(make, timeout_ms):
    rig = make(command_timeout_ns=timeout_ms * 10 ** 6)
    for _ in range(100):                    # as long as commands come, every 10 ms
        rig.send(0.2, 0.0).run(0.01)
    assert rig.rate("joint_left_wheel") == pytest.approx(2.0, rel=1e-3)
    rig.run(max(0, timeout_ms - 60) * 1e-3)
    if timeout_ms > 60:
        assert rig.rate("joint_left_wheel") == pytest.approx(2.0, rel=1e-3)
    assert rig.run(0.5).rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-6)


# -- what odometry says -------------------------------------------------------------------------------------------

def test_the_message_is_gazebos(make):
    rig = make().run(0.06)
    message, = rig.messages("/odom")
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "link_chassis")
    assert [message.pose.covariance[k] for k in (0, 7, 14, 21, 28, 35)] == [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]
    assert sum(value != 0.0 for value in message.pose.covariance) == 6 and not any(message.twist.covariance)
    (stamp, parent, child, position, orientation), = rig.ports.transforms
    assert (stamp, parent, child) == (message.header.stamp, "odom", "link_chassis")
    pose = message.pose.pose
    assert position == (pose.position.x, pose.position.y, pose.position.z)
    assert orientation == (pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w)


def test_world_odometry_is_the_absolute_pose(make):
    rig = make(pose=at(2.0, 1.0, 0.1, math.pi), wheel_convention="kinetic").run(0.5)
    pose = rig.messages("/odom")[-1].pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((2.0, 1.0, 0.0999), abs=2e-4)
    rig.send(0.5, 0.8).run(4.0)
    message, (position, orientation) = rig.messages("/odom")[-1], rig.pose()
    published = (message.pose.pose.position.x, message.pose.pose.position.y)
    assert math.dist(published, position[:2]) < 0.03        # the robot has driven on for up to 49 ms
    yaw = yaw_of((0.0, 0.0, message.pose.pose.orientation.z, message.pose.pose.orientation.w))
    assert math.remainder(yaw - yaw_of(orientation), 2 * math.pi) == pytest.approx(0.0, abs=0.05)
    twist = message.twist.twist             # of the chassis frame, which stands 0.05 m ahead of the axle
    assert (twist.linear.x, twist.linear.y, twist.angular.z) == pytest.approx((0.5, 0.05 * 0.8, 0.8), abs=5e-4)
    assert (twist.linear.z, twist.angular.x, twist.angular.y) == (0.0, 0.0, 0.0)


def test_encoder_odometry_follows_the_wheels_from_zero(make):
    rig = make({"odometrySource": "encoder"}, pose=at(2.0, 1.0, 0.1, math.pi), wheel_convention="kinetic")
    rig.run(0.5).send(0.5, 0.8).run(5.0)
    first, message = rig.messages("/odom")[0], rig.messages("/odom")[-1]
    assert (first.pose.pose.position.x, first.pose.pose.position.y) == pytest.approx((0.0, 0.0), abs=1e-4)
    theta = yaw_of((0.0, 0.0, message.pose.pose.orientation.z, message.pose.pose.orientation.w))
    radius, orientation = 0.5 / 0.8, message.pose.pose.orientation
    # from the way it turned the closed form of a circle gives where it is; spinning up takes a few milliseconds
    assert message.pose.pose.position.x == pytest.approx(radius * math.sin(theta), abs=0.01)
    assert message.pose.pose.position.y == pytest.approx(radius * (1.0 - math.cos(theta)), abs=0.01)
    assert message.pose.pose.position.z == orientation.x == orientation.y == 0.0
    assert (message.twist.twist.linear.x, message.twist.twist.angular.z) == pytest.approx((0.5, 0.8), rel=1e-3)
    travelled = 0.8 * (message.header.stamp * 1e-9 - 0.551)
    assert math.remainder(theta - travelled, 2 * math.pi) == pytest.approx(0.0, abs=0.05)


def test_encoder_speed_has_no_sign(make):
    message = make({"odometrySource": "encoder"}).send(-0.3, 0.0).run(2.0).messages("/odom")[-1]
    assert message.twist.twist.linear.x == pytest.approx(0.3, rel=1e-3) and message.pose.pose.position.x < -0.4


def test_encoder_odometry_uses_the_tags_of_the_plugin(make):
    """Under the plain Noetic mapping m2wr turns clockwise while its wheels count as if it turned left."""
    rig = make({"odometrySource": "encoder"}, wheel_convention="noetic").send(0.0, 0.5).run(2.0)
    assert rig.messages("/odom")[-1].twist.twist.angular.z == pytest.approx(0.5, rel=1e-3)
    assert yaw_of(rig.pose()[1]) < -0.5


# -- which topics -------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("tag, spawned_in, prefix", [
    (None, "/", ""), (None, "/robot1", "/robot1"), (None, "robot1", "/robot1"), (None, "", "/m2wr"),
    (None, None, "/m2wr"),
    ("/fleet/a", "/robot1", "/fleet/a"), ("", None, "/m2wr"), ("/", "/robot1", "")])
def test_the_namespace_of_topics(make, tag, spawned_in, prefix):
    rig = make({"robotNamespace": tag}, namespace=spawned_in)
    assert prefix + "/odom" in rig.ports.topics and prefix + "/cmd_vel" in rig.ports.subscriptions
    rig.send(0.3, 0.0, prefix + "/cmd_vel").run(0.5)
    assert rig.pose()[0][0] > 0.05 and len(rig.messages(prefix + "/odom")) == 9


def test_topics_and_frames_follow_their_tags(make):
    rig = make({"commandTopic": "/abs/cmd", "odometryTopic": "wheels/odom", "odometryFrame": "/start",
                "robotBaseFrame": None}).run(0.06)
    assert list(rig.ports.subscriptions) == ["/abs/cmd"]
    message, = rig.messages("/wheels/odom")
    assert (message.header.frame_id, message.child_frame_id) == ("start", "base_footprint")


def test_publish_tf_false_removes_odometry_altogether(make):
    rig = make({"publishTf": "false"}).send(0.3, 0.0).run(0.5)
    assert "/odom" not in rig.ports.topics and rig.ports.transforms == []
    assert rig.pose()[0][0] > 0.05


def test_publish_odom_tf_false_leaves_the_topic(make):
    rig = make({"publishOdomTF": "0"}).run(0.12)
    assert len(rig.messages("/odom")) == 2 and rig.ports.transforms == []


def test_wheel_transforms_are_posed_in_the_model(make):
    rig = make({"publishWheelTF": "True", "publishOdomTF": "false"}, pose=at(3.0, 2.0, 0.1, 1.0)).run(0.06)
    (_, parent, child, position, _), second = rig.ports.transforms
    assert (parent, child) == ("link_chassis", "link_right_wheel")
    assert position == pytest.approx((-0.05, 0.2, 0.0), abs=1e-3)
    assert second[2] == "link_left_wheel" and second[3] == pytest.approx((-0.05, -0.2, 0.0), abs=1e-3)


def test_wheel_states_hold_positions_only_right_wheel_first(make):
    rig = make({"publishWheelJointState": "1"}, wheel_convention="kinetic").send(0.2, 0.5).run(2.0)
    message = rig.messages("/joint_states")[-1]
    assert message.name == ["joint_right_wheel", "joint_left_wheel"]
    # kinetic: the left one is outside
    assert len(message.position) == 2 and message.position[1] > message.position[0] > 0.0
    assert list(message.velocity) == list(message.effort) == []
    assert rig.stamps_ms("/joint_states")[:2] == [51, 101]      # and no other publisher


# -- sides --------------------------------------------------------------------------------------------------------

TURNS = [("noetic", None, -1), ("noetic", "true", -1), ("noetic", "false", -1),
         ("kinetic", None, 1), ("kinetic", "true", 1), ("kinetic", "false", -1),
         ("rep103", None, 1), ("rep103", "true", 1), ("rep103", "false", 1)]


@pytest.mark.parametrize("convention, legacy, sign", TURNS)
def test_which_way_m2wr_turns_for_positive_angular_z(make, caplog, convention, legacy, sign):
    caplog.set_level(logging.INFO)
    rig = make({"legacyMode": legacy}, wheel_convention=convention).send(0.5, 0.3).run(2.0)
    turned = yaw_of(rig.pose()[1])
    assert turned == pytest.approx(sign * 0.3 * 1.92, rel=0.05)
    assert rig.rate("joint_left_wheel") == pytest.approx(5.0 + 0.6 * sign, rel=1e-3)        # at y = -0.2
    assert rig.rate("joint_right_wheel") == pytest.approx(5.0 - 0.6 * sign, rel=1e-3)
    sentence, = said_with(caplog, "wheel_convention")
    assert "joint_left_wheel" in sentence and "on the robot's RIGHT side (y = -0.200 m)" in sentence
    assert "\"%s\"" % convention in sentence and "~wheel_conventions/m2wr" in sentence
    assert ("counter-clockwise, as REP 103 asks" if sign > 0 else "turns it clockwise, against REP 103") in sentence
    assert [record.levelname for record in caplog.records if record.getMessage() == sentence] == [
        "INFO" if sign > 0 else "WARNING"]         # nothing is wrong with a robot that turns as it should


@pytest.mark.parametrize("convention, legacy, sign", [
    ("noetic", None, 1), ("noetic", "true", 1), ("kinetic", None, -1), ("kinetic", "false", 1), ("rep103", "true", 1)])
def test_which_way_a_robot_with_true_names_turns(make, caplog, convention, legacy, sign):
    rig = make({"leftJoint": "joint_right_wheel", "rightJoint": "joint_left_wheel", "legacyMode": legacy},
               wheel_convention=convention).send(0.5, 0.3).run(2.0)
    assert math.copysign(1, yaw_of(rig.pose()[1])) == sign
    assert len(said_with(caplog, "wheel_convention")) == (1 if sign < 0 else 0)


def test_a_convention_can_be_chosen_for_one_model(make_rig, m2wr):
    rig = make_rig(wheel_convention="noetic", wheel_conventions={"b": "rep103"})
    for index, name in enumerate("ab"):
        rig.simulator.spawn(m2wr, at(0.0, 3.0 * index, 0.1), name)
        rig.send(0.0, 0.5, "/%s/cmd_vel" % name)
    rig.run(2.0)
    assert yaw_of(rig.pose("a")[1]) < -0.5 and yaw_of(rig.pose("b")[1]) > 0.5


@pytest.mark.parametrize("described, conventions, sign", [
    ("kinetic", {}, 1), ("rep103", {}, 1), ("noetic", {}, -1), ("kinetic", {"m2wr": "noetic"}, -1),
    ("noetic", {"m2wr": "rep103"}, 1), ("kinetic", {"other": "noetic"}, 1)])
def test_a_description_chooses_unless_a_parameter_does(make, caplog, described, conventions, sign):
    rig = make({"wheelConvention": described}, wheel_conventions=conventions).send(0.0, 0.3).run(1.0)
    assert math.copysign(1, yaw_of(rig.pose()[1])) == sign
    assert not said_with(caplog, "<wheelConvention>")


def test_a_described_convention_that_is_none_is_named(make, caplog):
    rig = make({"wheelConvention": "melodic"}).send(0.0, 0.3).run(1.0)
    assert yaw_of(rig.pose()[1]) < 0.0
    sentence, = said_with(caplog, "<wheelConvention>")
    assert "must be one of noetic, kinetic, rep103 but is \"melodic\"" in sentence


def test_a_wrong_separation_is_named_and_turns_as_far_off(make, caplog):
    rig = make({"wheelSeparation": "0.5"}, wheel_convention="kinetic").send(0.0, 0.4).run(3.0)
    sentence, = said_with(caplog, "wheelSeparation")
    assert "0.5 m" in sentence and "0.4 m apart" in sentence and "1.25 times" in sentence
    assert rig.messages("/odom")[-1].twist.twist.angular.z == pytest.approx(0.4 * 1.25, rel=1e-3)


# -- speeds and refusals ------------------------------------------------------------------------------------------

def test_lateral_and_other_turning_commands_are_ignored(make):
    from geometry_msgs.msg import Twist
    rig, message = make(), Twist()
    message.linear.y, message.linear.z, message.angular.x, message.angular.y = 1.0, 1.0, 1.0, 1.0
    rig.ports.send("/cmd_vel", message)
    rig.run(0.5)
    assert rig.pose()[0][:2] == pytest.approx((0.0, 0.0), abs=1e-4)


@pytest.mark.parametrize("linear, angular", [
    (float("nan"), 0.0), (0.0, float("nan")), (float("inf"), 0.0), (0.0, float("-inf")), (1e5, 0.0), (0.0, -1e300)])
def test_a_non_finite_command_leaves_the_last_one(make, caplog, linear, angular):
    rig = make(step_ms=5).send(0.3, 0.0).run(1.0)
    for _ in range(120):                    # twelve seconds of them
        rig.send(linear, angular).run(0.1)
    assert rig.rate("joint_left_wheel") == pytest.approx(3.0, rel=1e-3)
    sentences = said_with(caplog, "refused")
    assert len(sentences) == 3              # at once, after five seconds, after ten
    assert "m2wr" in sentences[0] and "expected finite" in sentences[0]
    assert "(linear.x = 0.3, angular.z = 0.0) stays" in sentences[0]
    assert ("linear.x = %s, angular.z = %s" % (linear, angular)) in sentences[0]
    assert rig.send(0.1, 0.0).run(1.0).rate("joint_left_wheel") == pytest.approx(1.0, rel=1e-3)


def test_wheel_acceleration_ramps_once_per_period_and_step(make):
    rig = make({"wheelAcceleration": "0.4"}).send(0.5, 0.0).run(0.045)
    speeds = []
    for _ in range(8):
        rig.run(0.05)
        speeds.append(rig.rate("joint_right_wheel") * 0.1)
    assert speeds == pytest.approx([0.4 * 0.051 * (k + 1) for k in range(8)], rel=5e-3)
    assert rig.run(2.0).rate("joint_right_wheel") == pytest.approx(5.0, rel=1e-3)


def test_without_enough_torque_it_hardly_accelerates(make):
    slow = make({"wheelTorque": "0.1"}).send(0.5, 0.0).run(0.5).messages("/odom")[-1].twist.twist.linear.x
    # two wheels of 0.1 N m at 0.1 m push 6.4 kg and turn the wheels themselves
    expected = 2.0 * 0.1 / 0.1 / (6.4 + 2.0 * 1e-3 / 0.01) * (0.451 - 0.051)
    assert slow == pytest.approx(expected, rel=0.05)


@pytest.mark.parametrize("tags, words", [
    ({"leftJoint": "joint_left"}, "\"joint_left\" is no joint of m2wr (it has joint_left_wheel, joint_right_wheel)"),
    ({"rightJoint": None}, "\"right_joint\" is no joint of m2wr"),
    ({"wheelDiameter": "0"}, "expected a length from"), ({"wheelSeparation": "-0.4"}, "expected a length from"),
    ({"updateRate": "often"}, "<updateRate> holds \"often\""), ({"wheelTorque": "-1"}, "at least 0"),
    ({"wheelSeparation": "nan"}, "expected a length from"), ({"wheelSeparation": "1e-320"}, "expected a length from"),
    ({"wheelDiameter": "1e300"}, "expected a length from")])
def test_a_plugin_that_cannot_work_is_named_and_the_rest_runs(make, caplog, tags, words):
    rig = make(tags).run(0.12)
    error, = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert words in error and "will not run" in error and "libgazebo_ros_diff_drive.so" in error
    assert "/odom" not in rig.ports.topics and rig.ports.transforms == []
    assert len(rig.messages("/m2wr/laser/scan")) == 3 and not any(
        subscription.open for subscription in rig.ports.subscriptions.values())


@pytest.mark.parametrize("kind", ["fixed", "ball"])
def test_a_joint_that_no_motor_drives_is_named(make, m2wr, caplog, kind):
    joints = tuple(replace(joint, kind=kind) if "left" in joint.name else joint for joint in m2wr.joints)
    rig = make(robot=replace(m2wr, joints=joints)).run(0.1)
    error, = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert '"joint_left_wheel" of type %s cannot be driven' % kind in error and "/odom" not in rig.ports.topics


@pytest.mark.parametrize("tags", [{"odometrySource": "gps"}, {"publishTf": "perhaps"}, {"publishWheelTF": ""}])
def test_senseless_choices_keep_the_default(make, tags):
    rig = make(tags, pose=at(2.0, 0.0, 0.1)).run(0.06)
    assert rig.messages("/odom")[0].pose.pose.position.x == pytest.approx(2.0, abs=1e-3)
    assert len(rig.ports.transforms) == 1


def test_dead_tags_are_named(make, caplog):
    caplog.set_level(logging.INFO)
    make({"torqueLimit": "3"})
    sentence, = said_with(caplog, "unsupported elements ignored")
    assert "<torque>" in sentence and "<torqueLimit>" in sentence and "<updateRate>" not in sentence


# -- resets -------------------------------------------------------------------------------------------------------

def test_after_reset_world_the_wheels_turn_until_the_next_tick(make):
    rig = make(pose=at(1.0, 2.0, 0.1)).send(0.5, 0.0).run(2.020)
    rig.simulator.reset_world()
    assert rig.rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-6)
    assert rig.run(0.040).rate("joint_left_wheel") > 0.8        # the motor still has its old target
    assert rig.run(0.040).rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-3)      # the tick at 2.071 took it away
    assert rig.stamps_ms("/odom")[-2:] == [2001, 2071]
    message = rig.messages("/odom")[-1]
    assert (message.pose.pose.position.x, message.pose.pose.position.y) == pytest.approx((1.0, 2.0), abs=0.02)
    rest = rig.run(0.5).pose()[0]
    assert rig.run(1.0).pose()[0] == pytest.approx(rest, abs=1e-4)      # the command is forgotten


def test_after_reset_simulation_odometry_starts_again(make):
    rig = make().send(0.5, 0.5).run(2.020)
    count = len(rig.messages("/odom"))
    rig.simulator.reset_simulation()
    rig.run(0.12)
    assert rig.stamps_ms("/odom")[count:] == [51, 101]
    assert rig.messages("/odom")[-1].pose.pose.position.x == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("rewound", [False, True])
def test_resets_zero_the_encoder(make, rewound):
    rig = make({"odometrySource": "encoder"}).send(0.5, 0.0).run(2.020)
    assert rig.messages("/odom")[-1].pose.pose.position.x > 0.8
    rig.simulator.reset_simulation() if rewound else rig.simulator.reset_world()
    assert rig.run(0.3).messages("/odom")[-1].pose.pose.position.x == pytest.approx(0.0, abs=0.03)


def test_a_robot_on_its_head_reports_it(make):
    rig = make(pose=((0.0, 0.0, 0.3), (1.0, 0.0, 0.0, 0.0))).run(0.06)
    orientation = rig.messages("/odom")[0].pose.pose.orientation
    assert abs(rpy_from_quaternion((orientation.x, orientation.y, orientation.z, orientation.w))[0]) > 3.0


def test_two_plugins_of_one_kind_do_not_mix(make_rig, m2wr):
    rig = make_rig(wheel_convention="kinetic")
    for index, name in enumerate(("one", "two")):
        rig.simulator.spawn(m2wr, at(0.0, 3.0 * index, 0.1), name)
    rig.send(0.3, 0.0, "/one/cmd_vel").run(1.0)
    assert rig.pose("one")[0][0] > 0.2 and rig.pose("two")[0][0] == pytest.approx(0.0, abs=1e-4)
    assert isinstance(rig.simulator.models["one"].record.plugins[0], PluginSpec)

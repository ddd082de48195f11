# SPDX-License-Identifier: BSD-3-Clause
"""The skid steering plugin: wheel speeds, sides, odometry, tf, names, refusals (test_behaviour_robots: rotation)."""
import logging
import math
from dataclasses import replace

import pytest
from geometry_msgs.msg import Twist

from conftest import at
from m2wr_sim.model.types import PluginSpec

WHEELS = {"leftFrontJoint": "joint_left_wheel", "leftRearJoint": "joint_left_wheel",
          "rightFrontJoint": "joint_right_wheel", "rightRearJoint": "joint_right_wheel", "wheelDiameter": "0.2"}


@pytest.fixture
def make(make_rig, m2wr):
    """Return a function that puts m2wr into a rig, one wheel a side; its wheels are on the wrong sides."""
    def make_with(tags=(), pose=at(z=0.1), namespace=None, **options):
        rig = make_rig(joint_states=False, **options)
        spec = PluginSpec("skid", "libgazebo_ros_skid_steer_drive.so", tuple(dict(WHEELS, **dict(tags)).items()),
                          where="m2wr: plugin \"skid\"")
        rig.simulator.spawn(replace(m2wr, plugins=(spec,)), pose, namespace=namespace)
        return rig
    return make_with


def test_wheel_speeds(make):
    rig = make().send(0.5, 0.5).run(2.0)        # rim speeds 0.5 -+ 0.5 * 0.4 / 2
    assert rig.rate("joint_left_wheel") == pytest.approx(4.0, rel=0.01)
    assert rig.rate("joint_right_wheel") == pytest.approx(6.0, rel=0.01)


@pytest.mark.parametrize("convention, sign", [("noetic", -1.0), ("kinetic", -1.0), ("rep103", 1.0)])
def test_swapped_wheels_turn_by_the_convention(make, caplog, convention, sign):
    caplog.set_level(logging.INFO)
    rig = make(wheel_convention=convention).send(0.0, 0.5).run(2.0)
    assert rig.messages("/odom")[-1].twist.twist.angular.z == pytest.approx(sign * 0.5, rel=0.02)
    assert "on the robot's RIGHT side" in caplog.text and "~wheel_conventions/m2wr" in caplog.text


def test_ticks_come_when_more_than_a_period_has_passed(make):
    assert make({"updateRate": "20"}).run(0.16).stamps_ms("/odom") == [51, 101, 151]


def test_the_defaults(make):
    rig = make(pose=at(1.0, 2.0, 0.1, 0.5)).send(0.3, 0.0).run(1.0)
    message = rig.messages("/odom")[-1]
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
    assert rig.stamps_ms("/odom")[:3] == [11, 21, 31] and not rig.ports.transforms
    assert [message.pose.covariance[index] for index in range(0, 36, 7)] == [1e-4, 1e-4, 1e12, 1e12, 1e12, 0.01]
    assert message.twist.covariance == message.pose.covariance


def test_odometry_is_the_true_pose_but_flat(make):
    rig = make({"covariance_x": "1", "covariance_y": "2", "covariance_yaw": "3"}, at(1.0, 2.0, 0.1, 0.5)).run(0.5)
    message = rig.messages("/odom")[-1]
    where = message.pose.pose.position
    assert (where.x, where.y, where.z) == pytest.approx((1.0, 2.0, 0.0), abs=1e-3)
    assert 2.0 * math.asin(message.pose.pose.orientation.z) == pytest.approx(0.5, abs=1e-3)
    assert [message.pose.covariance[index] for index in (0, 7, 35)] == [1.0, 2.0, 3.0]


def test_optional_tf_includes_height(make):
    rig = make({"broadcastTF": "true", "robotBaseFrame": "base"}).run(0.05)
    stamp, parent, child, position, _ = rig.ports.transforms[-1]
    assert (parent, child) == ("odom", "base") and position[2] == pytest.approx(0.1, abs=1e-3)
    assert stamp == rig.messages("/odom")[-1].header.stamp


def test_command_ends_by_timeout(make):
    rig = make(command_timeout_ns=200000000).send(0.5, 0.0).run(0.2)
    assert rig.rate("joint_left_wheel") == pytest.approx(5.0, rel=0.02)
    assert rig.run(0.8).rate("joint_left_wheel") == pytest.approx(0.0, abs=0.01)
    assert make().send(0.5, 0.0).run(3.0).rate("joint_left_wheel") == pytest.approx(5.0, rel=0.02)


def test_non_finite_command_is_rejected(make, caplog):
    rig = make().send(0.5, 0.0).run(0.5)
    for bad in (math.nan, math.inf, 1e12, -1e300):
        rig.send(bad, 0.0).run(0.1)
    assert rig.rate("joint_left_wheel") == pytest.approx(5.0, rel=0.02)
    assert caplog.text.count("refused a velocity command") == 1


def test_namespaces(make):
    assert "/odom" in make().ports.topics and "/bot/odom" in make(namespace="/bot").ports.topics
    rig = make({"commandTopic": "go", "odometryTopic": "where"})
    assert "/where" in rig.ports.topics and "/go" in rig.ports.subscriptions


def test_a_reset_stops_it(make):
    rig = make().send(0.5, 0.0).run(1.0)
    rig.simulator.reset_simulation()
    rig.run(0.5)
    assert rig.pose()[0][0] == pytest.approx(0.0, abs=1e-3) and len(rig.stamps_ms("/odom")) > 130


@pytest.mark.parametrize("tags, words", [({"leftRearJoint": "nose"}, "\"nose\" is no joint of m2wr"),
                                         ({"wheelDiameter": "0"}, "expected a length from"),
                                         ({"torque": "-1"}, "at least 0")])
def test_configuration_errors_are_logged(make, caplog, tags, words):
    assert "/odom" not in make(tags).ports.topics and words in caplog.text


def test_motor_without_torque_does_not_move(make):
    rig = make({"torque": "0"}).send(0.5, 0.0).run(1.0)
    assert rig.pose()[0][0] == pytest.approx(0.0, abs=1e-3)


def test_only_linear_x_and_angular_z_count(make):
    rig, message = make(), Twist()
    message.linear.y = message.linear.z = message.angular.x = message.angular.y = 1.0
    rig.ports.send("/cmd_vel", message)
    assert rig.run(0.5).rate("joint_left_wheel") == pytest.approx(0.0, abs=1e-3)

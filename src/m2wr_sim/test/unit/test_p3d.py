# SPDX-License-Identifier: BSD-3-Clause
"""The p3d plugin: true pose and velocity, offsets, frames of reference, noise, rate."""
import math
from dataclasses import replace

import numpy as np
import pytest

from conftest import at
from m2wr_sim.model.types import PluginSpec

TOPIC = "/truth"


@pytest.fixture
def make(make_rig, m2wr):
    def make_with(pose=None, options=(), **tags):
        rig = make_rig(joint_states=False, **dict(options))
        tags = dict({"bodyName": "link_chassis", "topicName": "truth"}, **tags)
        spec = PluginSpec("truth", "libgazebo_ros_p3d.so", tuple(tags.items()), where="m2wr: plugin \"truth\"")
        rig.simulator.spawn(replace(m2wr, plugins=m2wr.plugins + (spec,)), pose or at(z=0.1))
        return rig
    return make_with


def test_position_heading_and_velocity_in_the_world(make):
    rig = make(at(1.0, 2.0, 0.1, 0.5 * math.pi), {"wheel_convention": "kinetic"})
    rig.send(0.5, 0.0, "/m2wr/cmd_vel").run(2.0)
    message = rig.messages(TOPIC)[-1]
    assert message.header.frame_id == "world" and message.child_frame_id == "link_chassis"
    position, turn = rig.pose()
    assert message.pose.pose.position.y == pytest.approx(position[1], abs=0.001) and position[1] > 2.8
    assert message.pose.pose.orientation.z == pytest.approx(turn[2], abs=1e-6)
    assert (message.twist.twist.linear.x, message.twist.twist.linear.y) == pytest.approx((0.0, 0.5), abs=1e-3)


def test_every_step_by_default_and_the_stamp_is_the_step(make):
    assert make().run(0.01).stamps_ms(TOPIC) == list(range(1, 11))


def test_the_rate_counts_from_the_last_message(make):
    assert make(updateRate="30").run(0.14).stamps_ms(TOPIC) == [34, 68, 102, 136]


def test_the_first_message_does_not_wait_for_a_period(make):
    rig = make(updateRate="1")
    rig.ports.topics[TOPIC].listening = False
    rig.run(2.5)
    rig.ports.topics[TOPIC].listening = True
    assert rig.run(0.01).stamps_ms(TOPIC) == [2501]


def test_offsets_are_added_in_the_axes_of_the_world(make):
    rig = make(at(1.0, 0.0, 0.1, 0.5 * math.pi), xyzOffset="0.5 0 1", rpyOffset="0 0 0.3").run(0.5)
    pose = rig.messages(TOPIC)[-1].pose.pose
    assert (pose.position.x, pose.position.y, pose.position.z) == pytest.approx((1.5, 0.0, 1.1), abs=1e-3)
    assert 2.0 * math.atan2(pose.orientation.z, pose.orientation.w) == pytest.approx(0.5 * math.pi + 0.3, abs=1e-4)


def test_a_link_as_frame_of_reference(make):
    rig = make(at(3.0, 1.0, 0.1, 1.0), {"wheel_convention": "kinetic"}, bodyName="link_left_wheel",
               frameName="link_chassis")
    rig.send(0.5, 0.0, "/m2wr/cmd_vel").run(2.0)
    message = rig.messages(TOPIC)[-1]
    where, linear, angular = message.pose.pose.position, message.twist.twist.linear, message.twist.twist.angular
    assert (where.x, where.y, where.z) == pytest.approx((-0.05, -0.2, 0.0), abs=1e-3)
    assert (linear.x, linear.y) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert angular.y == pytest.approx(5.0, rel=1e-3) and message.header.frame_id == "link_chassis"


def test_noise_affects_velocity_only_and_sets_covariance(make):
    rig = make(gaussianNoise="0.1").run(2.0)
    messages = rig.messages(TOPIC)[500:]
    values = np.array([(m.twist.twist.linear.x, m.twist.twist.linear.z, m.twist.twist.angular.y) for m in messages])
    assert values.std(axis=0) == pytest.approx(0.1, rel=0.1) and np.abs(values.mean(axis=0)).max() < 0.01
    assert np.std([m.pose.pose.position.x for m in messages]) < 1e-5
    for covariance in (messages[0].pose.covariance, messages[0].twist.covariance):
        assert np.allclose(np.reshape(covariance, (6, 6)), 0.01 * np.eye(6))


def test_variance_overflow_gives_infinity(make):
    message = make(gaussianNoise="1e200").run(0.05).messages(TOPIC)[-1]
    assert message.pose.covariance[0] == math.inf


def test_same_seed_repeats_noise_after_reset(make):
    rig = make(gaussianNoise="0.1").run(0.05)
    rig.simulator.reset_simulation()
    rig.run(0.05)
    speeds = [message.twist.twist.linear.y for message in rig.messages(TOPIC)]
    assert speeds[:50] == speeds[50:]


@pytest.mark.parametrize("tags, words", [
    ({"bodyName": "nose"}, "\"nose\" is no link of m2wr"), ({"bodyName": ""}, "needs a <bodyName>"),
    ({"topicName": ""}, "needs a <topicName>"), ({"frameName": "moon"}, "\"moon\" is no link"),
    ({"xyzOffset": "1 2"}, "three finite numbers"), ({"gaussianNoise": "-1"}, "at least 0"),
    ({"bodyName": "sensor_laser"}, "was merged into \"link_chassis\"")])
def test_configuration_errors_are_logged(make, caplog, tags, words):
    rig = make(**tags)
    assert TOPIC not in rig.ports.topics and words in caplog.text and "will not run" in caplog.text


def test_a_scoped_link_is_found(make):
    assert make(bodyName="m2wr::link_chassis").run(0.01).messages(TOPIC)

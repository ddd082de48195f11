# SPDX-License-Identifier: BSD-3-Clause
"""Joint states: of the joints that a plugin names, and of robots without a plugin for them."""
from dataclasses import replace

import pytest

from m2wr_sim.model.types import PluginSpec

TOPIC = "/joint_states"


def asking(robot, **tags):
    spec = PluginSpec("states", "libgazebo_ros_joint_state_publisher.so", tuple(tags.items()),
                      where="m2wr: plugin \"states\"")
    return replace(robot, plugins=robot.plugins + (spec,))


def test_robot_without_plugin_publishes_at_the_set_rate(m2wr_rig):
    rig = m2wr_rig(joint_state_rate=50.0).run(0.1)
    assert rig.stamps_ms(TOPIC) == [21, 41, 61, 81]
    assert rig.messages(TOPIC)[0].name == ["joint_left_wheel", "joint_right_wheel"]


def test_joint_states_can_be_disabled(m2wr_rig):
    assert TOPIC not in m2wr_rig(joint_states=False).ports.topics


def test_model_without_plugins_has_no_joint_states(make_rig, m2wr):
    rig = make_rig()
    rig.simulator.spawn(replace(m2wr, plugins=()), ((0.0, 0.0, 0.1), (0.0, 0.0, 0.0, 1.0)), namespace="/")
    assert TOPIC not in rig.ports.topics


def test_the_tag_chooses_joints_and_rate(m2wr_rig, m2wr):
    robot = asking(m2wr, jointName=" joint_right_wheel , joint_left_wheel,", updateRate="20")
    rig = m2wr_rig(robot=robot).run(0.16)
    assert rig.stamps_ms(TOPIC) == [51, 101, 151]
    assert all(message.name == ["joint_right_wheel", "joint_left_wheel"] for message in rig.messages(TOPIC))


def test_the_rate_is_100_where_it_is_missing(m2wr_rig, m2wr):
    rig = m2wr_rig(robot=asking(m2wr, jointName="joint_left_wheel")).run(0.04)
    assert rig.stamps_ms(TOPIC) == [11, 21, 31]


def test_positions_count_turns_and_velocities_are_rates(m2wr_rig):
    rig = m2wr_rig(step_ms=5, wheel_convention="kinetic").send(0.5, 0.5).run(10.0)
    message = rig.messages(TOPIC)[-1]
    assert message.velocity == pytest.approx([6.0, 4.0], rel=1e-3) and list(message.effort) == []
    assert message.position[0] == pytest.approx(6.0 * 9.9, rel=0.02)
    assert message.position[1] == pytest.approx(4.0 * 9.9, rel=0.02)
    assert message.header.frame_id == ""


@pytest.mark.parametrize("namespace, topic", [("/", TOPIC), ("/robot1", "/robot1/joint_states"),
                                              (None, "/m2wr/joint_states")])
def test_the_namespace(m2wr_rig, namespace, topic):
    assert len(m2wr_rig(namespace=namespace).run(0.05).messages(topic)) == 2


def test_no_messages_without_subscribers(m2wr_rig):
    rig = m2wr_rig()
    port = rig.ports.topics[TOPIC]
    port.listening = False
    rig.run(0.2)
    assert port.messages == []
    port.listening = True
    assert rig.run(0.05).stamps_ms(TOPIC) == [201, 221, 241]        # where they would have been, none made up for


def test_stamps_do_not_depend_on_time_of_subscription(m2wr_rig):
    rig = m2wr_rig()
    port = rig.ports.topics[TOPIC]
    port.listening = False
    rig.run(0.067)
    port.listening = True
    assert rig.run(0.05).stamps_ms(TOPIC) == [81, 101]


def test_missing_joint_is_logged(m2wr_rig, m2wr, caplog):
    rig = m2wr_rig(robot=asking(m2wr, jointName="joint_left_wheel, elbow")).run(0.06)
    error, = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert "\"elbow\" is no joint of m2wr (it has joint_left_wheel, joint_right_wheel)" in error
    assert TOPIC not in rig.ports.topics and len(rig.messages("/odom")) == 1


def test_tag_without_joints_is_logged(m2wr_rig, m2wr, caplog):
    m2wr_rig(robot=asking(m2wr))
    error, = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    assert "needs a <jointName> element" in error


@pytest.mark.parametrize("rewound, times", [(False, [131, 151, 171]), (True, [21, 41, 61])])
def test_joint_states_continue_after_reset(m2wr_rig, rewound, times):
    rig = m2wr_rig().run(0.111)
    before = len(rig.messages(TOPIC))
    rig.simulator.reset_simulation() if rewound else rig.simulator.reset_world()
    assert rig.run(0.07).stamps_ms(TOPIC)[before:] == [time + (0 if rewound else 1) for time in times]

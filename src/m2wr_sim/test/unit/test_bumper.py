# SPDX-License-Identifier: BSD-3-Clause
"""The bumper plugin: names, places, forces in the axes of the link, rate, and what is wrong with a sensor."""
from dataclasses import replace

import pytest

from conftest import at, box
from m2wr_sim.model.types import PluginSpec, Sensor

TOPIC = "/bumper_states"


def bumper(collisions=("collision",), kind="contact", pose=at(z=0.25), **tags):
    """Return a crate of 10 kg with a contact sensor."""
    spec = PluginSpec("bumper", "libgazebo_ros_bumper.so", tuple(tags.items()), where="crate: plugin \"bumper\"")
    sensor = Sensor("front", kind, update_rate=50.0, contact_collisions=collisions, plugins=(spec,))
    model = box("crate", 0, 0, 0, static=False, mass=10.0)
    return replace(model, pose=pose, links=(replace(model.links[0], sensors=(sensor,)),))


@pytest.fixture
def make(make_rig):
    def make_with(*models, **options):
        rig = make_rig(*models, joint_states=False)
        pose = options.pop("pose", at(z=0.25))
        rig.simulator.spawn(bumper(pose=pose, **options), pose)
        return rig
    return make_with


def test_a_crate_on_the_ground(make):
    rig = make().run(1.0)
    message = rig.messages(TOPIC)[-1]
    state, = message.states
    assert message.header.frame_id == "world"
    assert (state.collision1_name, state.collision2_name) == ("crate::link::collision", "ground_plane::link::collision")
    assert len(state.wrenches) == len(state.contact_positions) == len(state.contact_normals) == len(state.depths) == 4
    assert state.total_wrench.force.z == pytest.approx(98.0, abs=1e-3)
    assert sum(wrench.force.z for wrench in state.wrenches) == pytest.approx(98.0, abs=1e-3)
    assert abs(state.total_wrench.torque.x) < 1e-3
    assert all(normal.z == pytest.approx(1.0) for normal in state.contact_normals)
    assert state.info == ("Debug:  i:(0/1)     my geom:crate::link::collision   "
                          "other geom:ground_plane::link::collision         time:0.981000000\n")


def test_messages_have_no_states_without_contact(make):
    rig = make(pose=at(z=20.0)).run(0.5)
    assert len(rig.messages(TOPIC)) == 25 and not any(message.states for message in rig.messages(TOPIC))


def test_rate_is_that_of_the_sensor(make):
    assert make().run(0.1).stamps_ms(TOPIC) == [1, 21, 41, 61, 81]


def test_wrenches_are_in_axes_of_own_link(make):
    pose = ((0.0, 0.0, 0.25), (0.7071067811865476, 0.0, 0.0, 0.7071067811865476))       # y up
    state, = make(pose=pose).run(1.0).messages(TOPIC)[-1].states
    assert state.total_wrench.force.y == pytest.approx(98.0, abs=1e-2)
    assert abs(state.total_wrench.force.z) < 1e-2 and state.contact_normals[0].z == pytest.approx(1.0)


def test_contact_between_two_messages_is_in_the_second(make):
    rig = make(pose=at(z=3.0)).run(0.505)
    place = rig.simulator.models["crate"].place
    place(rig.engine, at(z=0.2499))
    rig.run(0.003)
    place(rig.engine, at(z=3.0))
    rig.run(0.05)
    assert rig.stamps_ms(TOPIC)[-3:] == [501, 521, 541]
    assert [len(message.states) for message in rig.messages(TOPIC)[-3:]] == [0, 1, 0]


def test_robot_hitting_a_wall_reports_contact(make_rig, m2wr):
    rig = make_rig(box("wall", 1.5, 0.0, 0.5, (0.2, 2.0, 1.0)), joint_states=False, wheel_convention="kinetic")
    chassis = m2wr.links[0]
    spec = PluginSpec("bumper", "libgazebo_ros_bumper.so", (("bumperTopicName", "contact"), ("frameName", "base")),
                      where="x")
    names = tuple(shape.name for shape in chassis.collisions)
    sensor = Sensor("front", "contact", update_rate=20.0, contact_collisions=names, plugins=(spec,))
    rig.simulator.spawn(replace(m2wr, links=(replace(chassis, sensors=(sensor,)),) + m2wr.links[1:]), at(z=0.1),
                        namespace="/")
    rig.send(0.5, 0.0).run(4.0)
    walls = [[state for state in message.states if "wall" in state.collision2_name]
             for message in rig.messages("/contact")]
    first = next(index for index, states in enumerate(walls) if states)
    assert 1.5 < first / 20.0 < 3.5 and all(walls[first + 1:])
    push = walls[-1][0].total_wrench.force.x
    assert -200.0 < push < -5.0 and walls[-1][0].contact_normals[0].x == pytest.approx(-1.0, abs=1e-3)
    assert rig.messages("/contact")[-1].header.frame_id == "base"


def test_contacts_are_not_stored_without_subscribers(make):
    rig = make()
    rig.ports.topics[TOPIC].listening = False
    rig.run(0.5)
    rig.ports.topics[TOPIC].listening = True
    rig.run(0.01)
    assert rig.stamps_ms(TOPIC) == [501]


def test_watch_ends_with_the_model(make):
    rig = make().run(0.1)
    rig.simulator.delete("crate")
    assert rig.engine._watches == []
    rig.run(0.1)


@pytest.mark.parametrize("collisions, words", [(("nose",), "names nose"), ((), "names no <collision>")])
def test_missing_collision_is_logged_and_reports_nothing(make, caplog, collisions, words):
    rig = make(collisions=collisions).run(0.2)
    assert words in caplog.text and "collisions collision" in caplog.text
    assert rig.messages(TOPIC) and not any(message.states for message in rig.messages(TOPIC))


def test_other_sensor_type_is_rejected(make, caplog):
    assert TOPIC not in make(kind="ray").ports.topics
    assert "must be in a <sensor type=\"contact\">" in caplog.text

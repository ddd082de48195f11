# SPDX-License-Identifier: BSD-3-Clause
"""The state topics of the world: who is in them, and that they follow what moves, is moved, comes and goes."""
import pytest

from conftest import at
from gazebo_msgs.msg import LinkStates, ModelStates
from m2wr_sim.plugins.world_states import WorldStates
from m2wr_sim.runtime.ports import LocalPort

REST = (0.0, 0.0, 0.0)


@pytest.fixture
def make(m2wr_rig, build):
    """Return a function that makes a rig of a box and m2wr, and the two ports of its state topics."""
    def make_with(rate=100.0, **options):
        rig = m2wr_rig(build.box("box", 3.0, 1.0, 0.5), **options)
        ports = LocalPort("models"), LocalPort("links")
        for port, kind in zip(ports, (ModelStates, LinkStates)):
            port.publish = lambda table, port=port, kind=kind: port.messages.append(table.message(kind))
        rig.simulator.add_observer(WorldStates(rig.simulator, *ports, rate=rate), "states")
        return rig, ports
    return make_with


def of(message, name):
    """Return position, heading part of the orientation, and velocity of a name."""
    index = message.name.index(name)
    pose, twist = message.pose[index], message.twist[index]
    return ((pose.position.x, pose.position.y, pose.position.z), pose.orientation.z,
            (twist.linear.x, twist.linear.y, twist.linear.z))


def test_names_are_in_load_order(make):
    rig, (models, links) = make()
    rig.run(0.02)
    assert models.messages[-1].name == ["ground_plane", "box", "m2wr"]
    assert links.messages[-1].name[:2] == ["ground_plane::link", "box::link"]
    assert "m2wr::link_left_wheel" in links.messages[-1].name


def test_values_are_those_of_the_engine(make):
    rig, (models, links) = make(wheel_convention="kinetic")
    rig.run(0.5).send(0.5, 0.3).run(1.0)
    messages, now_ns = len(models.messages), rig.simulator.now_ns
    state = rig.simulator.model_state("m2wr")           # what is published next is the state before the step
    rig.simulator.advance(now_ns + 10 ** 7)
    while len(models.messages) == messages:
        state = rig.simulator.model_state("m2wr")
        rig.simulator.advance(rig.simulator.now_ns + rig.simulator.step_ns)
    assert of(models.messages[-1], "m2wr") == (state.position, state.orientation[2], state.linear)
    assert of(links.messages[-1], "m2wr::link_chassis")[0] == pytest.approx(state.position, abs=0.2)


def test_a_paused_world_is_shown_once_to_each_who_subscribes(make):
    rig, (models, links) = make()
    states, audience = rig.simulator.observers[-1][0], ["one"]
    states._audiences[0] = lambda: tuple(audience)
    states.rest()
    states.rest()
    assert len(models.messages) == 1
    audience.append("two")              # it has connected after the first message
    states.rest()
    states.rest()
    assert len(models.messages) == 2


def test_what_changes_in_a_paused_world_is_shown(make):
    rig, (models, links) = make()
    states = rig.simulator.observers[-1][0]
    states.rest()
    rig.simulator.set_model_state("m2wr", at(1.0, 2.0, 0.1), REST, REST)
    states.rest()
    assert of(models.messages[-1], "m2wr")[0][:2] == pytest.approx((1.0, 2.0))
    rig.simulator.delete("box")
    states.rest()
    assert models.messages[-1].name == ["ground_plane", "m2wr"] and len(models.messages) == 3


def test_moved_static_model_has_its_new_pose(make):
    rig, (models, links) = make()
    rig.run(0.1)
    assert of(models.messages[-1], "box") == ((3.0, 1.0, 0.5), 0.0, REST)
    rig.simulator.set_model_state("box", at(1.0, 2.0, 0.5, yaw=1.0), REST, REST)
    rig.run(0.1)
    for message, name in ((models.messages[-1], "box"), (links.messages[-1], "box::link")):
        position, turn, velocity = of(message, name)
        assert position == (1.0, 2.0, 0.5) and turn == pytest.approx(0.4794255) and velocity == REST


def test_spawned_and_deleted_models(make, build):
    rig, (models, _) = make()
    rig.run(0.1)
    rig.simulator.delete("box")
    rig.run(0.1)
    assert models.messages[-1].name == ["ground_plane", "m2wr"]
    rig.simulator.spawn(build.box("box", 5.0, 0.0, 0.5), at(5.0, 0.0, 0.5))
    rig.run(0.1)
    assert of(models.messages[-1], "box")[0] == (5.0, 0.0, 0.5)


def test_only_subscribed_topics_are_published(make):
    rig, (models, links) = make()
    models.listening = False
    rig.run(0.1)
    assert not models.messages and len(links.messages) == 9
    links.listening = False
    rig.run(0.5)
    models.listening = True
    rig.run(0.1)
    assert len(links.messages) == 9 and 9 <= len(models.messages) <= 11     # nothing is caught up

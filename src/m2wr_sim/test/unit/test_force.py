# SPDX-License-Identifier: BSD-3-Clause
"""The force and force-torque plugins: Newton's law, the weight in a joint, the side it acts on, refusals."""
import math
from dataclasses import replace

import numpy as np
import pytest
from geometry_msgs.msg import Wrench

from conftest import at, box
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.types import Axis, Box, Collision, Inertial, Joint, Link, Model, PluginSpec


def wrench(force=(0.0, 0.0, 0.0), torque=(0.0, 0.0, 0.0)):
    message = Wrench()
    message.force.x, message.force.y, message.force.z = force
    message.torque.x, message.torque.y, message.torque.z = torque
    return message


@pytest.fixture
def pushed(make_rig):
    """Return a rig with a body of 2 kg far above the ground that a topic pushes."""
    rig = make_rig(joint_states=False)
    rig.engine.set_gravity((0.0, 0.0, 0.0))
    spec = PluginSpec("push", "libgazebo_ros_force.so", (("bodyName", "link"), ("topicName", "push")), where="x")
    body = box("body", 0, 0, 0, static=False, mass=2.0)
    rig.simulator.spawn(replace(body, plugins=(spec,)), at(z=50.0))
    return rig


def test_force_accelerates_until_the_next(pushed):
    pushed.ports.send("/push", wrench((4.0, 0.0, 0.0)))
    pushed.run(1.0)
    assert pushed.pose("body")[0][0] == pytest.approx(1.0, rel=0.002)       # a = 2, s = a t^2 / 2
    pushed.ports.send("/push", wrench())
    pushed.run(1.0)
    assert pushed.pose("body")[0][0] == pytest.approx(3.0, rel=0.002)


def test_a_torque_turns(pushed):
    pushed.ports.send("/push", wrench(torque=(0.0, 0.0, 0.1)))
    pushed.run(0.5)
    inertia = 2.0 * (0.5 ** 2 + 0.5 ** 2) / 12.0
    state = pushed.simulator.models["body"].state(pushed.engine)
    assert state.angular_velocity[2] == pytest.approx(0.05 / inertia, rel=1e-3)


def test_non_finite_wrench_is_rejected_and_reset_ends_it(pushed, caplog):
    pushed.ports.send("/push", wrench((4.0, 0.0, 0.0)))
    pushed.run(0.1)
    pushed.ports.send("/push", wrench((math.nan, 0.0, 0.0)))
    pushed.run(0.9)
    assert pushed.pose("body")[0][0] == pytest.approx(1.0, rel=0.002) and "rejected; expected" in caplog.text
    pushed.simulator.reset_world()
    assert pushed.run(0.5).pose("body")[0][0] == 0.0


@pytest.mark.parametrize("bad", [wrench((1e9, 0.0, 0.0)), wrench((0.0, 0.0, -1e300)), wrench(torque=(0.0, 1e9, 0.0))])
def test_wrench_above_the_limits_is_rejected(pushed, caplog, bad):
    pushed.ports.send("/push", wrench((4.0, 0.0, 0.0)))
    pushed.run(0.1)
    for _ in range(3):
        pushed.ports.send("/push", bad)
        pushed.run(0.3)
    assert pushed.pose("body")[0][0] == pytest.approx(1.0, rel=0.002)
    assert caplog.text.count("rejected; expected at most 2e+07 N and 833333 N m") == 1


@pytest.mark.parametrize("strong", [wrench((1e7, 0.0, 0.0)), wrench(torque=(0.0, 8e5, 0.0))])
def test_wrench_ends_when_its_body_is_too_fast(pushed, caplog, strong):
    pushed.ports.send("/push", strong)
    pushed.run(1.0)
    state = pushed.simulator.models["body"].state(pushed.engine)
    fastest = max(map(abs, state.linear_velocity + state.angular_velocity))
    assert 1e4 < fastest < 2e4 and caplog.text.count("ended: link moves at") == 1


# -- force and torque in a joint ----------------------------------------------------------------------------------

SHIFT = 0.2


def mast(pose=at(z=0.1), kind="fixed", **tags):
    """Return a heavy foot with a load of 2 kg on it whose centre of mass is ``SHIFT`` ahead of the joint."""
    tags = dict({"jointName": "neck", "topicName": "felt"}, **tags)
    foot = Link("foot", inertial=Inertial(20.0), collisions=(Collision("foot", Box((1.0, 1.0, 0.2))),))
    load = Link("load", at(z=0.5), Inertial(2.0, at(x=SHIFT), (0.1, 0.0, 0.0, 0.1, 0.0, 0.1)))
    neck = Joint("neck", kind, "foot", "load", axis=Axis((0.0, 1.0, 0.0)))
    spec = PluginSpec("felt", "libgazebo_ros_ft_sensor.so", tuple(tags.items()), where="mast: plugin \"felt\"")
    return Model("mast", (foot, load), (neck,), pose=pose, plugins=(spec,))


@pytest.fixture
def standing(make_rig):
    def make(pose=at(z=0.1), **options):
        rig = make_rig(joint_states=False)
        rig.simulator.spawn(mast(pose, **options), pose)
        return rig
    return make


def values(message):
    force, torque = message.wrench.force, message.wrench.torque
    return (force.x, force.y, force.z, torque.x, torque.y, torque.z)


def test_load_gives_downward_force_and_pitch_torque(standing):
    message = standing().run(1.0).messages("/felt")[-1]
    assert message.header.frame_id == "load"
    assert values(message) == pytest.approx((0.0, 0.0, -19.6, 0.0, 19.6 * SHIFT, 0.0), abs=0.01)


def test_wrench_is_in_the_axes_of_the_child(standing):
    pose = ((0.0, 0.0, 0.5), quaternion_from_rpy(0.5 * math.pi, 0.0, 0.0))      # lies on its side, y up
    message = standing(pose).run(1.0).messages("/felt")[-1]
    assert values(message)[:3] == pytest.approx((0.0, -19.6, 0.0), abs=0.02)


def test_wrench_is_zero_before_the_first_step(standing):
    assert values(standing().run(0.001).messages("/felt")[0]) == (0.0,) * 6


def test_rate_and_noise(standing):
    rig = standing(updateRate="100", gaussianNoise="0.5").run(5.0)
    assert rig.stamps_ms("/felt")[:3] == [10, 20, 30]
    scatter = np.std([values(message) for message in rig.messages("/felt")[50:]], axis=0)
    assert scatter == pytest.approx(0.5, rel=0.2)


@pytest.mark.parametrize("tags, words", [({"jointName": "x"}, "\"x\" is no joint of mast (it has neck)"),
                                         ({"jointName": ""}, "needs a <jointName>"),
                                         ({"topicName": ""}, "needs a <topicName>")])
def test_missing_elements_are_logged(standing, caplog, tags, words):
    assert not standing(**tags).ports.topics and words in caplog.text

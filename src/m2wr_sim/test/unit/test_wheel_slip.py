# SPDX-License-Identifier: BSD-3-Clause
"""The wheel slip plugin: slip velocity in proportion to the force, on level ground with a slanted gravity."""
import math
from dataclasses import replace

import pytest
from std_msgs.msg import Float64

from control_robots import LINK, PLACES, WHEEL
from m2wr_sim.model.types import PluginSpec, World
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.physics import factory
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

RADIUS, MASS, SPEED, LOAD = 0.1, 12.0, 5.0, 30.0        # m, kg with all wheels, rad/s, N
JOINT = """<joint name="{0}" type="continuous"><parent link="base"/><child link="{0}_link"/><origin xyz="{1}"/>
<axis xyz="0 1 0"/></joint>"""
WHEEL_TAG = """<wheel link_name="{}_link"><slip_compliance_lateral>{}</slip_compliance_lateral>
<slip_compliance_longitudinal>{}</slip_compliance_longitudinal>
<wheel_normal_force>{}</wheel_normal_force></wheel>"""
PLUGIN = '<gazebo><plugin name="slip" filename="{}">{}</plugin></gazebo>'


def cart(lateral=0.0, longitudinal=0.0, places=PLACES, library="libWheelSlipPlugin.so", load=LOAD, more=""):
    """A box of 10 kg on wheels of together 2 kg, without drive."""
    text = LINK.format("base", 10, 0.3, '<collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision>')
    for name, place in places.items():
        text += LINK.format(name + "_link", 2.0 / len(places), 0.003, WHEEL) + JOINT.format(name, place)
    tags = "".join(WHEEL_TAG.format(name, lateral, longitudinal, load) for name in places)
    return load_urdf("<robot name='cart'>%s%s</robot>" % (text, PLUGIN.format(library, tags + more)), "cart.urdf")


def barrow(lateral, longitudinal):
    """The same on one axle, with two balls that slide without friction."""
    wheels = {"left": "0 0.25 -0.05", "right": "0 -0.25 -0.05"}
    text = LINK.format("base", 10, 0.3, "".join(
        '<collision><origin xyz="%g 0 -0.098"/><geometry><sphere radius="0.05"/></geometry></collision>' % x
        for x in (0.2, -0.2)))
    text += "".join(LINK.format(name + "_link", 1.0, 0.003, WHEEL) + JOINT.format(name, place)
                    for name, place in wheels.items())
    text += '<gazebo reference="base"><mu1>0</mu1><mu2>0</mu2></gazebo>'
    tags = "".join(WHEEL_TAG.format(name, lateral, longitudinal, LOAD) for name in wheels)
    return load_urdf("<robot name='cart'>%s%s</robot>" % (text, PLUGIN.format("libWheelSlipPlugin.so", tags)), "b")


@pytest.fixture
def roll(make_rig):
    """Return a function that puts a cart on the ground under a gravity, and turns its wheels by motors."""
    def make(model, gravity=(0.0, 0.0, -9.8), speed=SPEED):
        rig = make_rig(joint_states=False)
        rig.simulator.spawn(model, ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0, 1.0)), name="cart", namespace="/")
        rig.run(0.3)
        rig.engine.set_gravity(gravity)
        for joint in rig.simulator.models["cart"].handle.joints.values():
            rig.engine.set_joint_motor(joint, speed, 1e3)
        return rig
    return make


def velocity(rig):
    return rig.simulator.models["cart"].state(rig.engine).linear_velocity


@pytest.mark.parametrize("robot", [cart, barrow])
def test_slip_ahead_is_compliance_times_force(roll, robot):
    rig = roll(robot(0.0, 0.4), (-1.5, 0.0, -9.8)).run(1.5)
    wheels = len(rig.simulator.models["cart"].handle.joints)
    force = MASS * 1.5 / wheels
    slip = 0.4 * RADIUS * SPEED * force / LOAD
    assert velocity(rig)[0] == pytest.approx(RADIUS * SPEED - slip, rel=0.01)
    assert slip > 0.02


@pytest.mark.parametrize("robot", [cart, barrow])
def test_slip_sideways_is_compliance_times_force(roll, robot):
    rig = roll(robot(0.6, 0.0), (0.0, 1.5, -9.8)).run(1.5)
    wheels = len(rig.simulator.models["cart"].handle.joints)
    assert velocity(rig)[1] == pytest.approx(0.6 * RADIUS * SPEED * MASS * 1.5 / wheels / LOAD, rel=0.01)
    assert velocity(rig)[0] == pytest.approx(RADIUS * SPEED, rel=0.01)


def test_beyond_its_grip_a_wheel_slides(roll):
    speeds = []
    for robot in (cart(0.6, 0.6), replace(cart(), plugins=())):
        rig = roll(robot, (0.0, 12.0, -9.8)).run(0.5)
        before = velocity(rig)[1]
        speeds.append(velocity(rig.run(0.2))[1] - before)
    assert speeds[0] == pytest.approx(speeds[1], rel=0.01) and speeds[0] > 0.4


def test_wheels_that_rest_hold(roll):
    rig = roll(cart(0.6, 0.6), (1.0, 1.0, -9.8), speed=0.0).run(1.0)
    assert velocity(rig)[:2] == pytest.approx((0.0, 0.0), abs=1e-3)


def test_slips_are_published_as_gazebo_does(roll):
    rig = roll(cart(0.6, 0.4), (-1.5, 1.0, -9.8)).run(1.0)
    message = rig.messages("/cart/wheel_slip/wheel_slips")[-1]
    assert message.name == sorted(name + "_link" for name in PLACES)
    assert len(rig.messages("/cart/wheel_slip/wheel_slips")) == 1300          # in every step
    scale = RADIUS * SPEED * MASS / len(PLACES) / LOAD
    assert message.position == pytest.approx([-0.4 * scale * 1.5] * 4, rel=0.02)
    assert message.velocity == pytest.approx([0.6 * scale * 1.0] * 4, rel=0.02)
    assert message.effort == pytest.approx([RADIUS * SPEED] * 4, rel=1e-3)


@pytest.mark.parametrize("value, slip", [(0.8, 0.8), (0.0, 0.0), (-1.0, 0.2), (math.nan, 0.2), (1e9, 0.2)])
def test_a_topic_sets_the_compliance_of_all_wheels(roll, value, slip):
    rig = roll(cart(0.2, 0.0, library="libgazebo_ros_wheel_slip.so"), (0.0, 1.5, -9.8))
    rig.ports.send("/cart/wheel_slip/lateral_compliance", Float64(value))
    assert velocity(rig.run(1.5))[1] == pytest.approx(slip * RADIUS * SPEED * MASS * 1.5 / 4 / LOAD, rel=0.01, abs=5e-4)


def test_a_parameter_sets_the_compliance_at_the_start(make_rig):
    rig = make_rig(joint_states=False)
    rig.ports.parameters["/cart/wheel_slip/slip_compliance_unitless_longitudinal"] = 0.4
    rig.simulator.spawn(cart(), ((0.0, 0.0, 0.15), (0.0, 0.0, 0.0, 1.0)), name="cart", namespace="/")
    rig.engine.set_gravity((-1.5, 0.0, -9.8))
    for joint in rig.simulator.models["cart"].handle.joints.values():
        rig.engine.set_joint_motor(joint, SPEED, 1e3)
    force = MASS * 1.5 / 4
    assert velocity(rig.run(1.5))[0] == pytest.approx(RADIUS * SPEED * (1.0 - 0.4 * force / LOAD), rel=0.01)


@pytest.mark.parametrize("model, part", [
    (cart(load=0.0), "<wheel_normal_force> 0 N"), (cart(load=-3.0), "<wheel_normal_force> -3 N"),
    (cart(lateral=-1.0), 'slip_compliance_lateral> holds "-1.0"'),
    (cart(places={}), "no <wheel"),
    (cart(places={}, more=WHEEL_TAG.format("ghost", 1, 1, 1)), '"ghost_link" is no link'),
    (cart(places={}, more=WHEEL_TAG.replace("{}_link", "base").format(1, 1, 1)), '"base" is no wheel')])
def test_wheels_that_cannot_slip_are_told(roll, caplog, model, part):
    roll(model).run(0.1)
    assert part in caplog.text
    assert "not supported" not in caplog.text


def test_one_bad_wheel_leaves_the_others(roll, caplog):
    rig = roll(cart(0.6, 0.0, more=WHEEL_TAG.format("ghost", 1, 1, 1)), (0.0, 1.5, -9.8)).run(1.5)
    assert "this wheel does not slip" in caplog.text
    assert velocity(rig)[1] == pytest.approx(0.6 * RADIUS * SPEED * MASS * 1.5 / 4 / LOAD, rel=0.01)


def test_both_engines_agree_to_the_bit():
    pytest.importorskip("numba")
    results = []
    for kind in ("native", "pyode"):
        engine = factory.make_engine(kind, EngineSettings())
        simulator = Simulator(engine, RayScene(), LocalPorts(lambda message: message), SimConfig())
        from builders import ground
        simulator.load_world(World(models=(ground(),)))
        for name, model, y in (("cart", cart(0.5, 0.3), 0.0), ("barrow", barrow(0.5, 0.3), 2.0)):
            simulator.spawn(model, ((0.0, y, 0.15), (0.0, 0.0, 0.0, 1.0)), name=name)
            for joint in simulator.models[name].handle.joints.values():
                engine.set_joint_motor(joint, 3.0, 10.0)
        engine.set_gravity((0.5, 0.7, -9.8))
        simulator.advance(10**9)
        simulator.delete("cart")
        simulator.advance(2 * 10**8)
        results.append(simulator.models["barrow"].state(engine))
        simulator.close()
    assert results[0] == results[1]


def test_the_tags_of_each_wheel_are_kept_apart():
    from m2wr_sim.plugins.base import PluginReader
    spec = PluginSpec("p", "x.so", (("a", "1"), ("wheel/@link_name", "left"), ("wheel/force", "2"),
                                    ("wheel/@link_name", "right"), ("wheel/force", "3")))
    reader = PluginReader(spec)
    assert [(group.text("@link_name"), group.number("force")) for group in reader.groups("wheel")] == [
        ("left", 2.0), ("right", 3.0)]
    assert reader.unread() == ["a"]

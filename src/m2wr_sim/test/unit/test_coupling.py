# SPDX-License-Identifier: BSD-3-Clause
"""Joints of SDF that couple two motions, and joints with two axes: closed forms for position, rate and effort."""
import math

import pytest

from sdf_documents import model

REST = ((0.0, 0.0, 1.0), (0.0, 0.0, 0.0, 1.0))
LINK = """<link name="{}"><pose>{} 0 0 0</pose><gravity>0</gravity><inertial><mass>{}</mass><inertia>
<ixx>{inertia}</ixx><iyy>{inertia}</iyy><izz>{inertia}</izz>
<ixy>0</ixy><ixz>0</ixz><iyz>0</iyz></inertia></inertial></link>"""
FIX = '<joint name="fix" type="fixed"><parent>world</parent><child>base</child></joint>'
JOINT = '<joint name="{}" type="{}"><parent>{}</parent><child>{}</child>{}</joint>'
AXIS = "<axis><xyz>{}</xyz>{}</axis>"


def link(name, place, mass=1.0, inertia=0.01):
    return LINK.format(name, place, mass, inertia=inertia)


def gears(ratio, axis_of_second="0 0 1", apart=0.3, inertias=(0.01, 0.04), reference="base"):
    """Two wheels on a fixed base, beside each other along x; a negative ``apart`` of 0 puts them on one line."""
    return (link("base", "0 0 0") + FIX + link("one", "0 0 0.1", inertia=inertias[0])
            + link("two", "%g 0 0.1" % apart, inertia=inertias[1])
            + JOINT.format("first", "revolute", "base", "one", AXIS.format("0 0 1", ""))
            + JOINT.format("second", "revolute", "base", "two", AXIS.format(axis_of_second, ""))
            + JOINT.format("mesh", "gearbox", "one", "two", "<gearbox_ratio>%g</gearbox_ratio>" % ratio
                           + "<gearbox_reference_body>%s</gearbox_reference_body>" % reference
                           + AXIS.format("0 0 1", "") + "<axis2><xyz>0 0 1</xyz></axis2>"))


def screw(pitch="<screw_thread_pitch>0.05</screw_thread_pitch>", parent="base"):
    """A nut of 2 kg on a thread along z."""
    return (link("base", "0 0 0") + FIX + link("nut", "0 0 0.3", 2.0, 0.01)
            + JOINT.format("thread", "screw", parent, "nut", pitch + AXIS.format("0 0 1", "")))


def cross(kind="universal", more="", second="0 1 0"):
    """A wheel that turns about x on the base, and about its own y."""
    return (link("base", "0 0 0") + FIX + link("wheel", "0 0 0.3", 2.0, 0.02)
            + JOINT.format("knuckle", kind, "base", "wheel", AXIS.format("1 0 0", "")
                           + "<axis2><xyz>%s</xyz>%s</axis2>" % (second, more)))


@pytest.fixture
def spawn(make_rig):
    """Return a function that makes a rig with a model, and returns it with the model's joints."""
    def make(body, version="1.6", **options):
        rig = make_rig(**options)
        rig.simulator.spawn(model(body, version), REST)
        return rig, rig.simulator.models["m"].handle.joints
    return make


@pytest.mark.parametrize("ratio, axis", [(2.0, "0 0 1"), (0.5, "0 0 1"), (3.0, "0 0 -1"), (-2.0, "0 0 1"),
                                         (-0.4, "0 0 1")])
def test_gears_turn_by_their_ratio(spawn, ratio, axis):
    rig, joints = spawn(gears(ratio, axis))
    before = rig.engine.solver_messages
    rig.engine.set_joint_motor(joints["first"], 4.0, 100.0)
    rig.run(3.0)
    sign = -1.0 if axis == "0 0 -1" else 1.0            # the joint's own axis is the opposite of the gear's
    assert rig.engine.joint_angle(joints["first"]) == pytest.approx(12.0, rel=4e-3)
    assert rig.engine.joint_angle(joints["second"]) == pytest.approx(-sign * ratio * rig.engine.joint_angle(
        joints["first"]), rel=1e-4)
    assert rig.engine.solver_messages == before


def test_a_torque_feels_the_inertia_behind_the_gear(spawn):
    rig, joints = spawn(gears(2.0))
    for _ in range(500):
        rig.engine.add_joint_force(joints["first"], 0.17)
        rig.run(0.001)
    # 0.17 N m on 0.01 + 2^2 * 0.04 kg m^2, for half a second
    assert rig.rate("first", "m") == pytest.approx(0.5, rel=0.005)
    assert rig.rate("second", "m") == pytest.approx(-1.0, rel=0.005)


@pytest.mark.parametrize("pitch, way", [("<screw_thread_pitch>0.05</screw_thread_pitch>", 0.05 / math.tau),
                                        ("<thread_pitch>-100</thread_pitch>", 0.01),
                                        ("<thread_pitch>40</thread_pitch>", -0.025)])
@pytest.mark.parametrize("parent", ["base", "world"])
def test_a_screw_advances_by_its_pitch(spawn, pitch, way, parent):
    rig, joints = spawn(screw(pitch, parent))
    before = rig.engine.solver_messages
    rig.engine.set_joint_motor(joints["thread"], 5.0, 100.0)
    rig.run(2.0)
    angle = rig.engine.joint_angle(joints["thread"])
    height = rig.engine.link_pose(rig.simulator.models["m"].handle.links["nut"])[0][2] - 1.3
    assert angle == pytest.approx(10.0, abs=0.01)
    assert height == pytest.approx(way * angle, rel=1e-3)
    assert rig.engine.solver_messages == before


def test_a_weight_turns_a_steep_screw(spawn):
    rig, joints = spawn(screw("<screw_thread_pitch>0.6283185307179586</screw_thread_pitch>").replace(
        "<gravity>0</gravity><inertial><mass>2.0", "<inertial><mass>2.0"))
    rig.run(0.5)
    # m g k = (I + m k^2) of angular acceleration, with k = 0.1 m/rad
    assert rig.rate("thread", "m") == pytest.approx(-0.5 * 2.0 * 9.8 * 0.1 / (0.01 + 2.0 * 0.01), rel=0.01)


@pytest.mark.parametrize("kind", ["universal", "revolute2"])
def test_both_axes_of_a_joint_are_driven_and_read(spawn, kind):
    rig, joints = spawn(cross(kind))
    rig.engine.set_joint_motor(joints["knuckle"], 0.2, 100.0)
    rig.engine.set_joint_motor(joints["knuckle::axis2"], 20.0, 100.0)
    rig.run(2.0)
    assert rig.engine.joint_angle(joints["knuckle"]) == pytest.approx(0.4, abs=0.002)
    assert rig.engine.joint_angle(joints["knuckle::axis2"]) == pytest.approx(40.0, abs=0.05)     # six rotations
    assert (rig.rate("knuckle", "m"), rig.rate("knuckle::axis2", "m")) == pytest.approx((0.2, 20.0), abs=0.01)


@pytest.mark.parametrize("name, speeds", [("knuckle", (0.5, 0.0)), ("knuckle::axis2", (0.0, 0.5))])
def test_an_effort_acts_on_the_axis_that_is_named(spawn, name, speeds):
    rig, joints = spawn(cross())
    for _ in range(100):
        rig.engine.add_joint_force(joints[name], 0.1)
        rig.run(0.001)
    assert (rig.rate("knuckle", "m"), rig.rate("knuckle::axis2", "m")) == pytest.approx(speeds, abs=1e-3)


def test_limits_and_damping_of_the_second_axis_hold(spawn):
    rig, joints = spawn(cross("revolute2", "<limit><lower>-0.3</lower><upper>0.3</upper></limit>"
                              "<dynamics><damping>0.5</damping></dynamics>"))
    rig.engine.set_joint_motor(joints["knuckle::axis2"], 5.0, 0.2)
    rig.run(0.5)
    # 0.2 N m against a damping of 0.5 N m s/rad
    assert rig.rate("knuckle::axis2", "m") == pytest.approx(0.4, rel=0.02)
    rig.run(2.0)
    assert rig.engine.joint_angle(joints["knuckle::axis2"]) == pytest.approx(0.3, abs=0.01)


def test_both_axes_are_in_the_joint_states(spawn):
    states = '<plugin name="p" filename="libgazebo_ros_joint_state_publisher.so"><jointName>knuckle, knuckle::axis2' \
        "</jointName></plugin>"
    rig, joints = spawn(cross() + states)
    rig.engine.set_joint_motor(joints["knuckle::axis2"], 2.0, 100.0)
    rig.run(1.0)
    message = rig.messages("/m/joint_states")[-1]
    assert message.name == ["knuckle", "knuckle::axis2"]
    assert message.velocity == pytest.approx([0.0, 2.0], abs=0.01)


@pytest.mark.parametrize("version, axis", [("1.11", "axis"), ("1.11", "axis2")])
def test_mimic_of_sdf_follows(spawn, version, axis):
    follower = '<mimic joint="knuckle" axis="%s"><multiplier>0.5</multiplier><offset>0.1</offset>' % axis \
        + "<reference>0.04</reference></mimic>"
    rig, joints = spawn(cross() + link("finger", "0.5 0 0.3") + JOINT.format(
        "second", "revolute", "base", "finger", AXIS.format("0 0 1", follower)), version)
    rig.engine.set_joint_motor(joints["knuckle" + ("" if axis == "axis" else "::axis2")], 0.5, 100.0)
    rig.run(2.0)
    assert rig.engine.joint_angle(joints["second"]) == pytest.approx(0.5 * (1.0 - 0.04) + 0.1, abs=2e-3)


@pytest.mark.parametrize("body, part", [
    (gears(2.0, apart=0.0), "rotate about one line"), (gears(2.0, "1 0 0"), "not parallel"),
    (gears(-1.0), "ratio is -1"), (gears(0.0), "ratio is"), (gears(2.0, reference="ghost"), 'names "ghost"'),
    (gears(2.0, reference="one"), "no revolute joint"), (screw("<thread_pitch>0</thread_pitch>"), "pitch of 0 m"),
    (cross("revolute2", second="1 1 0"), "not at right angles"),
    (cross("screw_2"), "joint type"), (FIX + link("base", "0 0 0") + link("a", "1 0 0") + JOINT.format(
        "j", "revolute", "base", "a", AXIS.format("0 0 1", "<mimic><multiplier>2</multiplier></mimic>")),
     "without the attribute joint")])
def test_what_will_not_move_is_told_with_its_place(body, part):
    found = model(body)
    assert any(part in note and "m.sdf" in note for note in found.notes), found.notes


def test_a_removed_model_takes_its_rows_along(spawn):
    rig, _ = spawn(gears(2.0) + screw().replace('"base"', '"plate"').replace(">base<", ">plate<").replace(
        '"fix"', '"fix2"'))
    rig.run(0.1)
    rig.simulator.delete("m")
    rig.run(0.1)


def test_both_engines_agree_to_the_bit():
    from m2wr_sim.model.types import World
    from m2wr_sim.physics import factory
    from m2wr_sim.physics.engine import EngineSettings
    from m2wr_sim.runtime.ports import LocalPorts
    from m2wr_sim.runtime.simulator import SimConfig, Simulator
    from m2wr_sim.sensors.ray_scene import RayScene
    pytest.importorskip("numba")
    results = []
    for kind in ("native", "pyode"):
        engine = factory.make_engine(kind, EngineSettings())
        simulator = Simulator(engine, RayScene(), LocalPorts(lambda message: message), SimConfig())
        simulator.load_world(World())
        joints, links = {}, []
        for name, body in (("gears", gears(2.0)), ("screw", screw()), ("cross", cross("revolute2"))):
            simulator.spawn(model(body, name=name), REST)
            joints[name] = simulator.models[name].handle.joints
            links += simulator.models[name].handle.links.values()
        for name, joint in (("gears", "first"), ("screw", "thread"), ("cross", "knuckle::axis2")):
            engine.set_joint_motor(joints[name][joint], 3.0, 10.0)
        simulator.advance(10**9)
        results.append([engine.link_state(number) for number in links]
                       + [engine.joint_rate(number) for table in joints.values() for number in table.values()])
        simulator.close()
    assert results[0] == results[1]


def test_controllers_drive_both_axes_of_a_joint(make_rig):
    names = ("knuckle", "knuckle::axis2")
    text = "<robot name='m'><link name='base'/>" + "".join(
        '<transmission name="{0}_t"><type>transmission_interface/SimpleTransmission</type><joint name="{0}">'
        "<hardwareInterface>hardware_interface/VelocityJointInterface</hardwareInterface></joint>"
        '<actuator name="{0}_m"/></transmission>'.format(name) for name in names) + "</robot>"
    rig = make_rig(joint_states=False)
    rig.ports.parameters["/robot_description"] = text
    rig.ports.parameters["/states"] = {"type": "joint_state_controller/JointStateController", "publish_rate": 50}
    for place, name in enumerate(names):
        kind = "velocity_controllers/JointVelocityController"
        rig.ports.parameters["/turn_%d" % place] = {"type": kind, "joint": name}
    rig.simulator.spawn(model(cross("revolute2") + '<plugin name="c" filename="libgazebo_ros_control.so"/>'), REST,
                        namespace="/")
    from controller_manager_msgs.srv import LoadControllerRequest, SwitchControllerRequest
    from std_msgs.msg import Float64
    services = rig.ports.services
    wanted = ["states", "turn_0", "turn_1"]
    for name in wanted:
        assert services["/controller_manager/load_controller"].callback(LoadControllerRequest(name)).ok
    assert services["/controller_manager/switch_controller"].callback(
        SwitchControllerRequest(wanted, [], SwitchControllerRequest.STRICT, False, 0.0)).ok
    rig.ports.send("/turn_0/command", Float64(0.2))
    rig.ports.send("/turn_1/command", Float64(3.0))
    rig.run(1.0)
    assert (rig.rate("knuckle", "m"), rig.rate("knuckle::axis2", "m")) == pytest.approx((0.2, 3.0), abs=0.01)
    state = rig.messages("/joint_states")[-1]
    assert dict(zip(state.name, state.velocity)) == pytest.approx({"knuckle": 0.2, "knuckle::axis2": 3.0}, abs=0.01)

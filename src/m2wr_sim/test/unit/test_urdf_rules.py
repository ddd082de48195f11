# SPDX-License-Identifier: BSD-3-Clause
"""Gazebo's rules from URDF to a simulated robot that no other test shows: what is kept, what counts, what moves how."""
import math
from dataclasses import replace

import pytest

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import rotate
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.model.types import Axis, Surface
from m2wr_sim.model.urdf.loader import load_urdf

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
QUARTER = '<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>'
UP = (math.sqrt(0.5),) * 2


def link(name, body=INERTIAL):
    return '<link name="{}">{}</link>'.format(name, body)


def shape(tag, name="", radius=0.1, rest=""):
    return '<{0}{1}><geometry><sphere radius="{2}"/></geometry>{3}</{0}>'.format(
        tag, ' name="{}"'.format(name) if name else "", radius, rest)


def joint(name, kind, parent, child, body=""):
    return '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'.format(
        name, kind, parent, child, body)


def block(reference, text):
    return "<gazebo{}>{}</gazebo>".format(' reference="{}"'.format(reference) if reference else "", text)


def robot(*parts, **options):
    return load_urdf('<robot name="r">\n{}\n</robot>'.format("\n".join(parts)), "r.urdf", **options)


def two_links(of_link="", of_joint="", of_collision="", **options):
    """Return a robot of two links and a hinge, with more in the second link, its joint, its collision."""
    return robot(link("a"), link("b", INERTIAL + of_link + shape("collision", rest=of_collision)),
                 joint("j", "continuous", "a", "b", QUARTER + '<axis xyz="0 1 0"{}/>'.format(
                     of_joint if of_joint.startswith(" ") else "") + (of_joint if of_joint.startswith("<") else "")),
                 **options)


# -- what a description holds -------------------------------------------------------------------------------------

@pytest.mark.parametrize("more", [
    {"of_link": "<pose>1 2 3 0 0 0</pose>"},
    {"of_joint": '<joint_properties damping="5" friction="6"/>'},
    {"of_joint": ' rpy="1 2 3"'},
    {"of_collision": "<surface><friction><ode><mu>0.1</mu><slip1>1</slip1></ode></friction></surface>",
     "honour_collision_surface": False},
])
def test_elements_that_gazebo_ignores_are_reported(more):
    changed, plain = two_links(**more), two_links()
    assert (changed.links, changed.joints) == (plain.links, plain.joints)
    # the file works without it: a remark, and no warning
    assert len(changed.remarks) == 1 and changed.notes == plain.notes == plain.remarks == ()


@pytest.mark.parametrize("tag", ["visual", "collision"])
@pytest.mark.parametrize("further, told", [('<material name="grey"/>', "a material belongs after </geometry>"),
                                           ('<box size="1 1 1"/>', "the first element of <geometry> is the shape.")])
def test_first_element_of_a_geometry_is_its_shape(tag, further, told):
    model = robot(link("a", INERTIAL + shape(tag).replace("</geometry>", further + "</geometry>")))
    kept, = getattr(model.links[0], tag + "s")
    note, = [note for note in model.notes if "<geometry>" in note]
    assert kept.geometry.radius == 0.1 and note.startswith("r.urdf:2: ") and told in note


def test_a_slider_without_limit_is_rejected():
    with pytest.raises(ModelError, match="<limit> is missing.*prismatic"):
        robot(link("a"), link("b"), joint("j", "prismatic", "a", "b"))


@pytest.mark.parametrize("kind", ["fixed", "continuous", "revolute", "prismatic"])
@pytest.mark.parametrize("given", ['effort="1"', 'velocity="1"', 'lower="-1" upper="1"'])
def test_limit_needs_effort_and_velocity(kind, given):
    with pytest.raises(ModelError, match="expected effort and velocity with every <limit>"):
        robot(link("a"), link("b"), joint("j", kind, "a", "b", "<limit {}/>".format(given)))


def test_colours_of_a_urdf_name_no_material():
    red = '<material name="Gazebo/Red"><color rgba="1 0 0 1"/></material>'
    visual, = robot(link("a", INERTIAL + shape("visual", rest=red))).links[0].visuals
    assert visual.material is None


@pytest.mark.parametrize("tag", ["collision", "visual"])
def test_all_shapes_of_a_link_keep_order_and_names(tag):
    parts = shape(tag, radius=0.1) + shape(tag, "a_rim", 0.2) + shape(tag, "rim", 0.3) + shape(tag, radius=0.4)
    body = robot(link("a", INERTIAL + parts)).links[0]
    kept = body.collisions if tag == "collision" else body.visuals
    assert [part.geometry.radius for part in kept] == [0.1, 0.2, 0.3, 0.4]
    assert [part.name for part in kept] == [
        "a_" + tag, "a_rim_%s_1" % tag, "a_fixed_joint_lump__rim_%s_2" % tag, "a_%s_3" % tag]


def test_products_of_inertia_are_kept_and_couple_the_axes(make_engine):
    tensor = '<inertia ixx="0.3" ixy="0.1" ixz="-0.05" iyy="0.4" iyz="0.02" izz="0.5"/>'
    model = robot(link("a", '<inertial><mass value="2"/>{}</inertial>'.format(tensor)),
                  block("a", "<turnGravityOff>true</turnGravityOff>"))
    assert model.links[0].inertial.inertia == (0.3, 0.1, -0.05, 0.4, 0.02, 0.5)
    engine = make_engine(1, [model])
    number = engine.handles[0].links["a"]
    engine.add_link_force(number, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    engine.step(1)
    x, y, z = (rate / 1e-3 for rate in engine.link_state(number).angular_velocity)
    assert 0.3 * x + 0.1 * y - 0.05 * z == pytest.approx(0.0, abs=1e-3)         # torque = tensor . acceleration
    assert 0.1 * x + 0.4 * y + 0.02 * z == pytest.approx(0.0, abs=1e-3)
    assert -0.05 * x + 0.02 * y + 0.5 * z == pytest.approx(1.0, abs=1e-3)


def test_the_first_links_velocity_stands_for_the_model(make_rig):
    rig = make_rig()
    model = replace(two_links(), pose=((0.0, 0.0, 5.0), (0.0, 0.0, 0.0, 1.0)))
    rig.simulator.spawn(model, model.pose)
    numbers = rig.simulator.models["r"].handle.links
    rig.engine.set_link_velocity(numbers["a"], (0.1, 0.2, 0.3), (0.0, 0.0, 0.4))
    rig.engine.set_link_velocity(numbers["b"], (5.0, 6.0, 7.0), (8.0, 9.0, 0.5))
    state = rig.simulator.models["r"].state(rig.engine)
    assert state.linear_velocity == pytest.approx((0.1, 0.2, 0.3))
    assert state.angular_velocity == pytest.approx((0.0, 0.0, 0.4))


# -- fixed joints -------------------------------------------------------------------------------------------------

def test_shapes_of_a_merged_link_stand_where_its_joint_put_them():
    parts = "".join('<{0}><origin xyz="0.5 0 0"/><geometry><sphere radius="1"/></geometry></{0}>'.format(tag)
                    for tag in ("collision", "visual"))
    body, = robot(link("a"), link("b", INERTIAL + parts), joint("j", "fixed", "a", "b", QUARTER)).links
    for part in body.collisions + body.visuals:
        assert part.pose[0] == pytest.approx((1.0, 0.5, 0.0))
        assert part.pose[1] == pytest.approx((0.0, 0.0) + UP)
    assert [part.name for part in body.collisions + body.visuals] == [
        "a_fixed_joint_lump__b_collision", "a_fixed_joint_lump__b_visual"]


def test_a_sensor_of_a_link_that_was_kept_stays_on_it():
    model = robot(link("a"), link("b"), joint("j", "fixed", "a", "b", QUARTER),
                  block("j", "<preserveFixedJoint>true</preserveFixedJoint>"),
                  block("b", "<sensor name='s' type='ray'><pose>1 0 0 0 0 0</pose></sensor>"))
    assert model.lumped == () and model.links[0].sensors == ()
    assert model.links[1].sensors[0].pose[0] == (1.0, 0.0, 0.0)


def test_tags_of_a_link_merged_twice_apply_by_its_name():
    model = robot(link("a", INERTIAL + shape("collision")), link("b", INERTIAL + shape("collision")),
                  link("c", INERTIAL + shape("collision") + shape("visual")),
                  joint("ab", "fixed", "a", "b"), joint("bc", "fixed", "b", "c"),
                  block("c", "<mu1>0.3</mu1><material>Gazebo/Green</material>"), block("b", "<mu1>0.2</mu1>"))
    body, = model.links
    assert [part.surface.mu for part in body.collisions] == [1.0, 0.2, 0.3]
    assert body.visuals[0].material == "Gazebo/Green"


@pytest.mark.parametrize("tag", ["bodyName", "frameName"])
def test_model_plugin_on_a_merged_link_moves_to_the_carrier(tag):
    model = robot(link("a"), link("b"), joint("j", "fixed", "a", "b", QUARTER), block(
        "", "<plugin name='p' filename='libp.so'><{0}>b</{0}><rpyOffset>0 0 0.5</rpyOffset></plugin>".format(tag)))
    plugin, = model.plugins
    assert plugin.find(tag) == "a"
    assert [float(word) for word in plugin.find("xyzOffset").split()] == pytest.approx([1.0, 0.0, 0.0])
    assert [float(word) for word in plugin.find("rpyOffset").split()] == pytest.approx([0, 0, math.pi / 2 + 0.5])


@pytest.mark.parametrize("tag", ["bodyName", "frameName"])
def test_a_sensors_plugin_on_a_merged_link_keeps_its_names(tag):
    model = robot(link("a"), link("b"), joint("j", "fixed", "a", "b", QUARTER), block(
        "b", "<sensor name='s' type='imu'><plugin name='p' filename='libp.so'><{0}>b</{0}></plugin></sensor>"
        .format(tag)))
    plugin, = model.links[0].sensors[0].plugins
    assert plugin.parameters == ((tag, "b"),)


@pytest.mark.parametrize("body", ["", INERTIAL.replace('mass value="1"', 'mass value="0"')])
@pytest.mark.parametrize("kind, switch", [
    ("continuous", ""), ("fixed", "preserveFixedJoint"), ("fixed", "disableFixedJointLumping")])
def test_massless_link_is_dropped_with_its_children(body, kind, switch):
    model = robot(link("a"), link("b", body), link("c"), joint("ab", kind, "a", "b"),
                  joint("bc", "continuous", "b", "c"), block("ab", "<{0}>true</{0}>".format(switch)) if switch else "")
    assert [found.name for found in model.links] == ["a"] and model.joints == ()
    assert any('"b"' in note and "with it c" in note for note in model.notes)


def test_massless_link_gets_mass_of_merged_links():
    model = robot(link("a"), link("b", ""), link("c"), joint("ab", "continuous", "a", "b"),
                  joint("bc", "fixed", "b", "c", QUARTER))
    assert [found.name for found in model.links] == ["a", "b"]
    assert model.links[1].inertial.mass == 1.0
    assert model.links[1].inertial.pose[0] == pytest.approx((1.0, 0.0, 0.0))


# -- extension tags -----------------------------------------------------------------------------------------------

TAGS = [("b", "mu1", "0.5"), ("b", "mu2", "0.5"), ("b", "kp", "5000"), ("b", "kd", "7"), ("b", "minDepth", "0.01"),
        ("b", "maxVel", "0.3"), ("b", "fdir1", "0 1 0"), ("b", "maxContacts", "3"), ("b", "laserRetro", "9"),
        ("b", "turnGravityOff", "true"), ("b", "dampingFactor", "0.2"), ("b", "selfCollide", "true"),
        ("b", "material", "Gazebo/Red"), ("j", "stopErp", "0.5"), ("j", "stopCfm", "0.5"), ("j", "fudgeFactor", "0.5"),
        ("j", "springReference", "0.5"), ("j", "springStiffness", "0.5"), ("", "static", "true"),
        ("fix", "preserveFixedJoint", "true"), ("fix", "disableFixedJointLumping", "true")]


@pytest.mark.parametrize("owner, tag, value", TAGS)
def test_value_of_a_tag_is_its_text_or_an_attribute(owner, tag, value):
    def made(text):
        return robot(link("a"), link("b", INERTIAL + shape("collision") + shape("visual")), link("c"),
                     joint("j", "continuous", "a", "b"), joint("fix", "fixed", "b", "c"), text)

    in_text = made(block(owner, "<{0}> {1} </{0}>".format(tag, value)))
    in_attribute = made(block(owner, '<{} value="{}"/>'.format(tag, value)))
    assert in_text == in_attribute and in_text.notes == ()
    assert (in_text.links, in_text.joints, in_text.static) != (
        made("").links, made("").joints, made("").static), "the tag has no effect"


@pytest.mark.parametrize("owner, tag", [("b", "canonicalBody"), ("", "canonicalBody"), ("j", "provideFeedback"),
                                        ("j", "cfmDamping"), ("j", "implicitSpringDamper")])
def test_tags_without_effect_change_nothing_and_cause_no_warning(owner, tag):
    def made(*more):
        return robot(link("a"), link("b"), joint("j", "continuous", "a", "b", '<dynamics damping="0.5"/>'), *more)

    model, plain = made(block(owner, "<{0}>true</{0}>".format(tag))), made()
    assert (model.links, model.joints, model.notes) == (plain.links, plain.joints, ())
    assert "<%s>" % tag in model.remarks[0]


def test_an_empty_reference_means_the_model():
    assert robot(link("a"), '<gazebo reference=" "><static>true</static></gazebo>').static


# -- joints -------------------------------------------------------------------------------------------------------

def test_joint_defaults_of_urdf_and_sdf():
    item, = robot(link("a"), link("b"), joint("j", "continuous", "a", "b")).joints
    assert item.axis == replace(Axis(), xyz=(1.0, 0.0, 0.0))
    model, = load_sdf_models('<sdf version="1.6"><model name="m"><link name="a"/><link name="b"/><joint name="j" '
                             'type="revolute"><parent>a</parent><child>b</child><axis/></joint></model></sdf>')
    assert model.joints[0].axis == Axis()
    assert Axis() == Axis((0.0, 0.0, 1.0), damping=0.0, friction=0.0, lower=-1e16, upper=1e16, effort=-1.0,
                          velocity=-1.0, stop_erp=0.2, stop_cfm=0.0)


def bolted(of_joint="", kind="continuous", body=INERTIAL):
    """Return an arm on a joint whose frame is turned a quarter about z; the world holds it, gravity passes over."""
    return robot(link("world", ""), link("arm", body), joint("j", kind, "world", "arm", QUARTER + of_joint),
                 block("arm", "<turnGravityOff>true</turnGravityOff>"))


def test_axis_is_in_the_frame_of_the_child(make_engine):
    engine = make_engine(1, [bolted('<axis xyz="1 0 0"/>')])
    handle = engine.handles[0]
    engine.set_joint_motor(handle.joints["j"], 2.0, 100.0)
    engine.step(250)
    assert engine.joint_angle(handle.joints["j"]) == pytest.approx(0.5, abs=5e-3)
    assert engine.link_state(handle.links["arm"]).angular_velocity == pytest.approx((0.0, 2.0, 0.0), abs=1e-6)
    raised = rotate(engine.link_pose(handle.links["arm"])[1], (0.0, 0.0, 1.0))
    assert raised == pytest.approx((math.sin(0.5), 0.0, math.cos(0.5)), abs=5e-3)       # as about the world's y axis


def test_a_slider_slides_along_its_axis_in_the_childs_frame(make_engine):
    engine = make_engine(1, [bolted('<axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1" velocity="1"/>',
                                    "prismatic")])
    handle = engine.handles[0]
    engine.set_joint_motor(handle.joints["j"], 2.0, 1e4)
    engine.step(250)
    assert engine.link_pose(handle.links["arm"])[0] == pytest.approx((1.0, 0.5, 0.0), abs=0.01)
    assert engine.joint_angle(handle.joints["j"]) == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize("damping", [0.05, -0.05])
def test_damping_brakes_whatever_its_sign(make_engine, damping):
    engine = make_engine(1, [bolted('<axis xyz="0 0 1"/><dynamics damping="{}"/>'.format(damping))])
    handle = engine.handles[0]
    engine.set_link_velocity(handle.links["arm"], (0.0, 0.0, 0.0), (0.0, 0.0, 3.0))
    engine.step(1000)
    assert engine.joint_rate(handle.joints["j"]) == pytest.approx(3.0 * math.exp(-0.05 / 0.1), rel=1e-2)


def test_hinges_with_the_limits_exchanged_stop_at_both(make_engine):
    engine = make_engine(1, [bolted('<axis xyz="0 0 1"/><limit lower="0.4" upper="-0.2" effort="1" velocity="1"/>',
                                    "revolute")])
    number = engine.handles[0].joints["j"]
    for rate, stop in ((1.0, 0.4), (-1.0, -0.2)):
        engine.set_joint_motor(number, rate, 5.0)
        engine.step(1500)
        assert engine.joint_angle(number) == pytest.approx(stop, abs=5e-3)


def three_balls(*self_colliding):
    """Return three balls that lie in one another; joints lead from the first to the second and on to the third."""
    ball = INERTIAL + shape("collision", radius=0.3)
    place = '<origin xyz="0.05 0 0"/>'
    return robot(link("a", ball), link("b", ball), link("c", ball), joint("ab", "continuous", "a", "b", place),
                 joint("bc", "continuous", "b", "c", place),
                 *(block(name, "<selfCollide>true</selfCollide>") for name in self_colliding))


@pytest.mark.parametrize("self_colliding, pairs", [
    ("", set()), ("ab", set()), ("a", set()), ("ac", {("r::a::a_collision", "r::c::c_collision")}),
    ("abc", {("r::a::a_collision", "r::c::c_collision")})])
def test_self_collide_needs_both_links_and_no_joint(make_engine, self_colliding, pairs):
    engine = make_engine(1, [three_balls(*self_colliding)])
    engine.step(3)
    assert {tuple(sorted((contact.first, contact.second))) for contact in engine.drain_contact_events()} == pairs


def test_links_of_different_models_collide(make_engine):
    one = robot(link("a", INERTIAL + shape("collision")))
    engine = make_engine(1, [replace(one, name="one"), replace(one, name="two")])
    engine.step(1)
    contact, = engine.drain_contact_events()
    assert {contact.first, contact.second} == {"one::a::a_collision", "two::a::a_collision"}


def test_static_bodies_collide_only_with_moving_ones(make_engine, build):
    ball = build.sphere("ball", -0.49, 0, 0.2, static=False)
    engine = make_engine(1, [build.box("one", 0, 0, 0.2), build.box("two", 0.1, 0, 0.15), ball])
    engine.step(3)
    assert {frozenset((contact.first, contact.second)) for contact in engine.drain_contact_events()} == {
        frozenset(("ball::link::collision", "one::link::collision"))}


SLED = (link("a", INERTIAL + '<collision><geometry><box size="0.4 0.4 0.2"/></geometry></collision>'),
        block("a", "<mu1>0</mu1><mu2>0</mu2>"))


@pytest.mark.parametrize("more, sleeps", [
    ((), True),
    ((block("", "<allow_auto_disable>false</allow_auto_disable>"),), False),
    ((block("a", "<sensor name='s' type='ray'/>"),), False),
    ((link("b"), joint("j", "continuous", "a", "b"), block("b", "<turnGravityOff>true</turnGravityOff>")), False)])
def test_slow_body_without_joint_or_sensor_is_disabled(make_engine, build, more, sleeps):
    engine = make_engine(1, [build.ground(), replace(robot(*SLED + more), pose=build.at(z=0.1))])
    for number in engine.handles[1].links.values():
        engine.set_link_velocity(number, (0.09, 0.0, 0.0), (0.0, 0.0, 0.0))      # slow is below 0.1 m/s
    engine.step(3000)
    moved = engine.link_pose(engine.handles[1].links["a"])[0][0]
    assert moved == pytest.approx(0.09 if sleeps else 0.27, abs=2e-3)


@pytest.mark.parametrize("axis", [0, 1])
@pytest.mark.parametrize("slip", [0.1, 0.05])
def test_slip_does_not_depend_on_the_number_of_contacts(make_engine, build, slip, axis):
    force = (2.0, 0.0, 0.0) if axis == 0 else (0.0, 2.0, 0.0)
    crate = build.box("crate", 0, 0, 0.25, static=False, mass=1.0, surface=Surface(slip1=slip, slip2=slip))
    engine = make_engine(1, [build.ground(), crate])
    number = engine.handles[1].links["link"]
    for _ in range(500):
        engine.add_link_force(number, force, (0.0, 0.0, 0.0))
        engine.step(1)
    gathered = 1.0 - math.exp(-0.5 / slip)          # after half a second; mass times slip is the time constant
    assert engine.link_state(number).linear_velocity[axis] == pytest.approx(2.0 * slip * gathered, rel=0.02)

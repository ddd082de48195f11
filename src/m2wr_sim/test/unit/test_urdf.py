# SPDX-License-Identifier: BSD-3-Clause
"""URDF to model: the report's robot, the conversion rules one by one, and what is refused."""
import math
from pathlib import Path

import pytest

from m2wr_sim.api.loading import read_robot
from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy
from m2wr_sim.model.types import Cylinder, Noise, Sphere
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.urdf.xacro_text import expanded

DATA = Path(__file__).resolve().parent.parent / "data"
DESCRIPTION = Path(__file__).resolve().parents[3] / "m2wr_description"
M2WR = DESCRIPTION / "urdf" / "m2wr.xacro"

INERTIAL = ('<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>')
BALL = '<collision><geometry><sphere radius="0.1"/></geometry></collision>'


def link(name, body=INERTIAL):
    return '<link name="{}">{}</link>'.format(name, body)


def joint(name, kind, parent, child, body=""):
    return '<joint name="{}" type="{}"><parent link="{}"/><child link="{}"/>{}</joint>'.format(
        name, kind, parent, child, body)


def robot(*parts, **options):
    return load_urdf('<robot name="r">\n{}\n</robot>'.format("\n".join(parts)), "r.urdf", **options)


def refusal(*parts):
    with pytest.raises(ModelError) as caught:
        robot(*parts)
    return str(caught.value)


def m2wr_text():
    return expanded(M2WR.read_text(), str(M2WR), {"m2wr_description": str(DESCRIPTION)}.get)


@pytest.fixture(scope="module")
def m2wr():
    return load_urdf(m2wr_text(), str(M2WR))


# -- the report's robot -------------------------------------------------------------------------------------------

def test_m2wr_links_joints_and_lumped_laser(m2wr):
    assert m2wr.name == "m2wr" and m2wr.pose == IDENTITY and not m2wr.static
    assert [body.name for body in m2wr.links] == ["link_chassis", "link_left_wheel", "link_right_wheel"]
    assert [(item.name, item.kind, item.parent) for item in m2wr.joints] == [
        ("joint_left_wheel", "revolute", "link_chassis"), ("joint_right_wheel", "revolute", "link_chassis")]
    assert m2wr.lumped == (("sensor_laser", "link_chassis", ((0.15, 0.0, 0.05), IDENTITY[1])),)


def test_m2wr_masses_and_places(m2wr):
    chassis, left, right = m2wr.links
    assert sum(body.inertial.mass for body in m2wr.links) == pytest.approx(6.4)
    assert chassis.inertial.pose[0] == pytest.approx((0.025, 0.0, 0.55 / 6))
    assert left.pose[0] == pytest.approx((-0.05, -0.2, 0.0)) and right.pose[0] == pytest.approx((-0.05, 0.2, 0.0))
    # box and laser about their common centre; the laser lies (0.15, 0, -0.05) from the box's
    reduced = 5.0 * 1.0 / 6.0
    laser_xx, laser_zz = (3 * 0.05 ** 2 + 0.1 ** 2) / 12, 0.05 ** 2 / 2
    assert chassis.inertial.inertia == pytest.approx((
        0.0395416666667 + laser_xx + reduced * 0.05 ** 2, 0.0, reduced * 0.15 * 0.05,
        0.106208333333 + laser_xx + reduced * (0.15 ** 2 + 0.05 ** 2), 0.0,
        0.106208333333 + laser_zz + reduced * 0.15 ** 2))


def test_m2wr_collision_names(m2wr):
    assert [[part.name for part in body.collisions] for body in m2wr.links] == [
        ["link_chassis_fixed_joint_lump__collision_chassis_collision",
         "link_chassis_fixed_joint_lump__caster_front_collision_collision_1",
         "link_chassis_fixed_joint_lump__sensor_laser_collision_2"],
        ["link_left_wheel_fixed_joint_lump__link_right_wheel_collision_collision"],
        ["link_right_wheel_collision_collision"]]


def test_m2wr_surface_is_default_except_caster_friction(m2wr):
    box, caster, laser = (part.surface for part in m2wr.links[0].collisions)
    assert (caster.mu, caster.mu2, caster.slip1, caster.slip2) == (0.0, 0.0, 1.0, 1.0)
    assert (box.mu, box.mu2, box.slip1) == (laser.mu, laser.mu2, laser.slip1) == (1.0, 1.0, 0.0)
    assert m2wr.links[0].collisions[1].geometry == Sphere(0.05)
    literal = load_urdf(m2wr_text(), str(M2WR), honour_collision_surface=False)
    assert literal.links[0].collisions[1].surface == box


def test_m2wr_wheels(m2wr):
    for body, item in zip(m2wr.links[1:], m2wr.joints):
        assert item.axis.xyz == (0.0, 1.0, 0.0)
        assert (item.axis.damping, item.axis.friction) == (0.0, 0.0)
        assert (item.axis.lower, item.axis.upper) == (-1e16, 1e16)
        assert (item.axis.effort, item.axis.velocity) == (10000.0, 1000.0)
        assert body.collisions[0].geometry == Cylinder(0.1, 0.04)
        assert body.collisions[0].pose[1] == pytest.approx(quaternion_from_rpy(0.0, 1.5707, 1.5707))


def test_m2wr_laser_and_plugins(m2wr):
    laser, = m2wr.links[0].sensors
    assert (laser.name, laser.kind, laser.update_rate, laser.visualize) == ("head_hokuyo_sensor", "ray", 20.0, False)
    assert laser.pose == ((0.15, 0.0, 0.05), IDENTITY[1])
    ray = laser.ray
    assert (ray.samples, ray.min_angle, ray.max_angle, ray.range_min, ray.range_max) == (
        720, -1.570796, 1.570796, 0.1, 10.0)
    assert ray.noise == Noise("gaussian", 0.0, 0.01)
    assert laser.plugins[0].filename == "libgazebo_ros_laser.so" and laser.plugins[0].reference == "link_chassis"
    assert laser.plugins[0].find("frameName") == "sensor_laser"
    drive, = m2wr.plugins
    assert drive.filename == "libgazebo_ros_diff_drive.so" and drive.reference is None
    assert [drive.find(tag) for tag in ("leftJoint", "rightJoint", "wheelSeparation", "torque", "wheelTorque")] == [
        "joint_left_wheel", "joint_right_wheel", "0.4", "0.1", None]


def test_m2wr_unsupported_elements_are_remarks(m2wr):
    remarks = " ".join(m2wr.remarks)
    assert m2wr.notes == ()
    for dead, instead in (("<pose>", "<origin>"), ("<joint_properties>", "<dynamics"), ("<surface>", "<mu1>")):
        sentence = [remark for remark in m2wr.remarks if dead in remark]
        assert len(sentence) == 1 and instead in sentence[0], remarks
    assert "rpy" not in remarks       # all zeros there


# -- conversion, rule by rule -------------------------------------------------------------------------------------

def test_names_of_model_and_origin_of_robot():
    text = '<robot name="r"><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>{}</robot>'.format(link("a"))
    model = load_urdf(text, model_name="other")
    assert model.name == "other"
    assert model.pose[0] == (1.0, 2.0, 3.0) and model.pose[1] == pytest.approx((0, 0, math.sqrt(0.5), math.sqrt(0.5)))


@pytest.mark.parametrize("kind, body, expected", [
    ("continuous", "", ("revolute", -1e16, 1e16, -1.0, -1.0)),
    ("revolute", '<limit lower="1" upper="-1" effort="2" velocity="3"/>', ("revolute", -1.0, 1.0, 2.0, 3.0)),
    ("prismatic", '<limit effort="2" velocity="3"/>', ("prismatic", 0.0, 0.0, 2.0, 3.0)),
])
def test_joint_kinds_and_limits(kind, body, expected):
    item, = robot(link("a"), link("b"), joint("j", kind, "a", "b", body)).joints
    assert (item.kind, item.axis.lower, item.axis.upper, item.axis.effort, item.axis.velocity) == expected
    assert item.axis.xyz == (1.0, 0.0, 0.0)      # URDF's default axis


def test_axis_is_scaled_to_one_and_dynamics_are_kept():
    item, = robot(link("a"), link("b"), joint("j", "continuous", "a", "b", '<axis xyz="0 3 4"/>'
                                              '<dynamics damping="0.5" friction="0.25"/>')).joints
    assert item.axis.xyz == pytest.approx((0.0, 0.6, 0.8))
    assert (item.axis.damping, item.axis.friction) == (0.5, 0.25)


@pytest.mark.parametrize("kind", ["floating", "planar"])
def test_floating_and_planar_joints_connect_nothing(kind):
    model = robot(link("a"), link("b"), joint("j", kind, "a", "b", '<origin xyz="1 0 0"/>'))
    assert model.joints == () and model.links[1].pose[0] == (1.0, 0.0, 0.0)
    assert any("moves freely" in note for note in model.notes)


def test_link_poses_chain_through_joints_and_lumped_links():
    model = robot(link("a"), link("b"), link("c"), joint("j1", "fixed", "a", "b", '<origin xyz="1 0 0" rpy="0 0 '
                                                         '1.5707963267948966"/>'),
                  joint("j2", "continuous", "b", "c", '<origin xyz="2 0 0"/>'))
    assert [body.name for body in model.links] == ["a", "c"]
    assert model.links[1].pose[0] == pytest.approx((1.0, 2.0, 0.0))
    assert model.joints[0].parent == "a" and model.joints[0].pose == IDENTITY


def test_base_link_goes_into_a_base_footprint_without_mass():
    model = robot(link("base_footprint", ""), link("base_link", INERTIAL + BALL),
                  joint("base", "fixed", "base_footprint", "base_link", '<origin xyz="0 0 0.5"/>'))
    body, = model.links
    assert body.name == "base_footprint" and body.inertial.mass == 1.0
    assert body.inertial.pose[0] == pytest.approx((0.0, 0.0, 0.5))
    assert body.collisions[0].name == "base_footprint_fixed_joint_lump__base_link_collision"


def test_link_without_mass_goes_with_all_behind_it():
    model = robot(link("a"), link("ghost", BALL), link("b"), link("c"), joint("j1", "continuous", "a", "ghost"),
                  joint("j2", "continuous", "ghost", "b"), joint("j3", "continuous", "a", "c"))
    assert [body.name for body in model.links] == ["a", "c"] and [item.name for item in model.joints] == ["j3"]
    note, = [note for note in model.notes if '"ghost"' in note]
    assert "with it b" in note


def test_link_with_negative_mass_goes_as_one_without():
    negative = INERTIAL.replace('mass value="1"', 'mass value="-2"')
    model = robot(link("a"), link("anti", negative), link("b"), joint("j1", "continuous", "a", "anti"),
                  joint("j2", "continuous", "anti", "b"))
    note, = model.notes
    assert [body.name for body in model.links] == ["a"] and model.joints == ()
    assert "link[anti]/inertial/mass>: mass is -2; expected a positive mass" in note and "with it b" in note


@pytest.mark.parametrize("shape", ['<box size="0 1 1"/>', '<sphere radius="-1"/>', '<cylinder radius="1" length="0"/>'])
def test_shapes_without_extent_are_skipped_and_reported(shape):
    parts = "".join("<{0}><geometry>{1}</geometry></{0}>".format(tag, shape) for tag in ("collision", "visual"))
    model = robot(link("a", INERTIAL + parts + BALL))
    assert [part.geometry for part in model.links[0].collisions] == [Sphere(0.1)] and model.links[0].visuals == ()
    assert ["this collision is left out" in note for note in model.notes] == [True, False]
    assert all("positive number" in note and "r.urdf:2" in note for note in model.notes)


def test_invalid_plugin_offset_on_a_lumped_link_is_reported():
    model = robot(link("a"), link("b"), joint("j", "fixed", "a", "b"), '<gazebo><plugin name="p" filename="libp3d.so">'
                  '<bodyName>b</bodyName><xyzOffset>1 0</xyzOffset></plugin></gazebo>')
    note, = model.notes
    assert model.plugins[0].find("bodyName") == "a" and 'xyzOffset is "1 0"; expected three numbers' in note


def test_root_without_mass_leaves_nothing():
    assert "no link has mass" in refusal(link("a", BALL), link("b"), joint("j", "continuous", "a", "b"))


def test_root_called_world_bolts_the_robot_down():
    model = robot(link("world", ""), link("base"), link("lamp"), joint("bolt", "fixed", "world", "base",
                                                                       '<origin xyz="1 2 0"/>'),
                  joint("hold", "fixed", "base", "lamp"))
    body, = model.links
    item, = model.joints
    assert body.name == "base" and body.pose[0] == (1.0, 2.0, 0.0)
    assert (item.kind, item.parent, item.child) == ("fixed", "world", "base")


def test_mesh_collision_is_skipped_and_reported():
    mesh = '<geometry><mesh filename="package://p/a.stl" scale="1 1 1"/></geometry>'
    model = robot(link("a", INERTIAL + "<visual>" + mesh + "</visual><collision>" + mesh + "</collision>" + BALL))
    assert [part.geometry for part in model.links[0].collisions] == [Sphere(0.1)]
    note, = [note for note in model.notes if "mesh" in note]
    assert "package://p/a.stl" in note and "r.urdf:2" in note


def test_colours_come_from_the_robots_materials():
    model = robot('<material name="red"><color rgba="1 0 0 1"/></material>', link("a", INERTIAL + (
        '<visual><geometry><sphere radius="1"/></geometry><material name="red"/></visual>')))
    assert model.links[0].visuals[0].rgba == (1.0, 0.0, 0.0, 1.0)


def test_transmissions_of_any_shape_do_no_harm():
    model = robot(link("a"), '<transmission name="t"><joint name="x"/></transmission>')
    assert len(model.links) == 1 and model.notes == ()


def test_plugin_on_a_lumped_link_gets_carrier_and_offsets():
    origin = '<origin xyz="1 0 0" rpy="0 0 1.5707963267949"/>'
    model = robot(link("a"), link("b"), joint("j", "fixed", "a", "b", origin),
                  '<gazebo><plugin name="p" filename="libp3d.so"><bodyName>b</bodyName><xyzOffset>1 0 0</xyzOffset>'
                  '</plugin></gazebo>')
    plugin, = model.plugins
    assert plugin.find("bodyName") == "a"
    assert [float(word) for word in plugin.find("xyzOffset").split()] == pytest.approx([1.0, 1.0, 0.0])
    assert [float(word) for word in plugin.find("rpyOffset").split()] == pytest.approx([0.0, 0.0, math.pi / 2])


# -- xacro --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("namespace", ["http://www.ros.org/wiki/xacro", "https://www.ros.org/wiki/xacro",
                                       "http://ros.org/wiki/xacro"])
def test_a_xacro_file_is_expanded(namespace, tmp_path):
    path = tmp_path / "r.xacro"
    path.write_text('<robot name="r" xmlns:xacro="{}"><xacro:property name="m" value="3"/>'
                    '<link name="a">{}</link></robot>'.format(namespace, INERTIAL.replace('"1"', '"${m}"')))
    model = read_robot(path)
    assert model.links[0].inertial.mass == 3.0


@pytest.mark.parametrize("name, parts", [
    ("undefined_symbol.xacro", ("undefined_symbol.xacro", "no_such_symbol")),
    ("unknown_macro.xacro", ("unknown_macro.xacro", "no_such_macro")),
    ("bad_macro_argument.xacro", ("bad_macro_argument.xacro", "wheel")),
    ("missing_include.xacro", ("missing_include.xacro", "not_there.xacro")),
    ("includes_entities.xacro", ("entities.xacro", "entity")),
])
def test_xacro_that_does_not_expand_names_file_and_cause(name, parts):
    path = DATA / name
    with pytest.raises(ModelError) as caught:
        read_robot(path)
    for part in parts:
        assert part in str(caught.value)


def test_invalid_xacro_reports_file_and_line(tmp_path):
    head = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">\n'
    (tmp_path / "a.xacro").write_text(head + '<link name="${1}">\n</robot>')
    with pytest.raises(ModelError, match=r"a\.xacro:3: not well-formed"):
        read_robot(tmp_path / "a.xacro")
    (tmp_path / "part.xacro").write_text("<robot>\n<link>\n</robot>")
    with pytest.raises(ModelError, match=r"part\.xacro:3: not well-formed"):
        (tmp_path / "a.xacro").write_text(head + '<xacro:include filename="part.xacro"/></robot>')
        read_robot(tmp_path / "a.xacro")


def test_unknown_package_in_find_is_reported(tmp_path):
    text = ('<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">'
            '<xacro:include filename="$(find no_such_package)/a.xacro"/></robot>')
    (tmp_path / "r.xacro").write_text(text)
    with pytest.raises(ModelError) as caught:
        read_robot(tmp_path / "r.xacro")
    assert "$(find no_such_package)" in str(caught.value)


@pytest.mark.parametrize("inside", [
    '<xacro:property name="m" value="3"/>', '<link name="${(lambda: open(TARGET, \'w\'))()}"/>',
    '<link name="$(eval open(TARGET, \'w\'))"/>', '<xacro:include filename="/etc/passwd"/>',
    '<link name="${load_yaml(\'/etc/passwd\')}"/>', '<link name="${\'a\'*3*10**9}"/>'])
def test_xacro_in_text_is_rejected_and_nothing_of_it_runs(inside, tmp_path):
    target = tmp_path / "owned"
    text = '<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">{}{}</robot>'.format(
        link("a"), inside.replace("TARGET", "'%s'" % target))
    for read in (load_urdf, read_robot):
        with pytest.raises(ModelError, match="this is xacro, not yet URDF.*xacro FILE.xacro > FILE.urdf"):
            read(text)
    assert not target.exists()


# -- refusals -----------------------------------------------------------------------------------------------------

TWO = link("a") + link("b")


@pytest.mark.parametrize("parts, words", [
    (("",), ("the robot has no link", "at least one <link>")),
    ((link("a"), link("a")), ('another link "a" in line 2',)),
    ((TWO, joint("j", "fixed", "a", "b"), joint("j", "fixed", "a", "b")), ('another joint "j"',)),
    ((TWO,), ("2 root links (a, b)",)),
    ((TWO, joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")), ("ring",)),
    ((TWO, link("c"), joint("j", "fixed", "a", "b"), joint("k", "fixed", "b", "a")), ("ring", "tree")),
    ((TWO, link("c"), joint("j", "fixed", "a", "c"), joint("k", "fixed", "b", "c")), ("already the child of joint",)),
    ((link("a"), joint("j", "fixed", "a", "nowhere")), ('child link "nowhere" is no link', "one of a")),
    ((TWO, joint("j", "spinning", "a", "b")), ('joint type is "spinning"', "continuous")),
    ((TWO, joint("j", "revolute", "a", "b")), ("<limit> is missing", "revolute")),
    ((TWO, joint("j", "continuous", "a", "b", '<limit velocity="1"/>')), ("attribute effort is missing", "<limit>")),
    ((TWO, joint("j", "continuous", "a", "b", '<limit effort="1"/>')), ("attribute velocity is missing",)),
    ((TWO, joint("j", "continuous", "a", "b", '<axis xyz="0 0 0"/>')), ("no length",)),
    ((link("a", INERTIAL.replace('value="1"', 'value="-1"')),), ("link[a]", "mass is -1", "positive mass")),
    ((link("a", INERTIAL.replace('value="1"', 'value="nan"')),), ('"nan"', "finite number")),
    ((link("a", INERTIAL.replace('ixx="0.1"', 'ixx="inf"')),), ('"inf"', "finite number")),
    ((link("a", INERTIAL.replace(' izz="0.1"', '')),), ("attribute izz is missing",)),
    ((link("a", INERTIAL + BALL.replace("sphere", "blob")),), ('unknown geometry "blob"', "box, cylinder, sphere")),
    ((link("a", INERTIAL + BALL.replace("<geometry>", '<origin xyz="1 2"/><geometry>')),), ("3 numbers",)),
    (('<link/>',), ("attribute name is missing",)),
])
def test_bad_urdf_is_rejected_with_file_line_and_expectation(parts, words):
    message = refusal(*parts)
    assert message.startswith("r.urdf:") and "; expected " in message
    for word in words:
        assert word in message


@pytest.mark.parametrize("text", ["<sdf version='1.6'/>", "<model name='x'/>"])
def test_other_roots_are_rejected(text):
    with pytest.raises(ModelError, match="entity format is invalid.*expected <robot>"):
        load_urdf(text)


@pytest.mark.parametrize("text", ["", "not xml", "<robot name='r'>", b"\xff\xfe"])
def test_what_is_no_xml_is_rejected(text):
    with pytest.raises(ModelError, match="robot_description"):
        load_urdf(text)


def test_inertia_no_body_can_have_is_reported_but_accepted():
    model = robot(link("a", INERTIAL.replace('ixx="0.1"', 'ixx="0.5"')))
    note, = model.notes
    assert "no real body" in note and "link[a]" in note


def test_nothing_is_printed(capfd):
    robot(link("a", INERTIAL + "<strange/>"), joint("j", "fixed", "a", "b", "<odd/>"), link("b"))
    captured = capfd.readouterr()
    assert captured.out == captured.err == ""


@pytest.mark.parametrize("axis", ["1e200 0 0", "1e308 1e308 1e308"])
def test_numbers_with_overflowing_squares_raise_no_traceback(axis):
    try:
        robot(TWO, joint("j", "continuous", "a", "b", '<axis xyz="{}"/>'.format(axis)))
    except ModelError as error:
        assert "j" in str(error)
    try:
        robot(link("a", '<collision><geometry><box size="1e200 1 1"/></geometry></collision>'))
    except ModelError:
        pass

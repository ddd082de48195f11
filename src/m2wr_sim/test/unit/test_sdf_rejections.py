# SPDX-License-Identifier: BSD-3-Clause
"""SDF documents with invalid or unsupported parts: what is skipped or rejected, and the messages."""
import time

import pytest

from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy, rotate
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.types import Surface
from sdf_documents import BOX, LINK, QUARTER, TURNED, joint, model, static, told, world


def collision(geometry):
    return static("m", '<link name="l">\n<collision name="c"><geometry>' + geometry + "</geometry></collision></link>")


BAD_SHAPES = [
    (collision("<pyramid/>"), ('unknown geometry "pyramid"', "box, cylinder, sphere, plane", "model[m]", ":4:")),
    (collision("<box/>"), ("<size> is missing",)),
    (collision("<box><size>1 1</size></box>"), ("3 numbers",)),
    (collision("<box><size>1 0 1</size></box>"), ("three positive numbers",)),
    (collision("<sphere><radius>nan</radius></sphere>"), ('radius is "nan"', "finite")),
    (collision("<cylinder><radius>1</radius></cylinder>"), ("<length> is missing",)),
    (collision("<plane><normal>0 0 0</normal></plane>"), ("no length",)),
    (static("m", '<link name="l"><collision name="c"/></link>'), ("<geometry> is missing",)),
    (static("m", '<link name="l"><collision>{}</collision></link>'.format(BOX)), ("attribute name is missing",)),
]


@pytest.mark.parametrize("part, words", BAD_SHAPES)
def test_invalid_collision_is_skipped(part, words):
    loaded, note = told(part)
    assert note.startswith("a.world:") and "; expected " in note and "/world[w]/model[m]" in note
    assert note.endswith("; this collision is left out.")
    assert loaded.models[0].name == "m" and loaded.models[0].links[0].collisions == ()
    for word in words:
        assert word in note


def test_link_without_an_invalid_collision_or_visual_loads():
    loaded, note = told(static("m", '<link name="l"><visual name="v"><geometry/></visual><visual name="w"/>'
                               '<collision name="c">{}</collision></link>'.format(BOX)))
    link, = loaded.models[0].links
    assert "visual[w]" in note and "this visual is left out" in note and len(link.collisions) == 1


@pytest.mark.parametrize("body, words", [
    ("<inertial><mass>-1</mass></inertial>", ("mass is -1", "a positive mass", "link[l]")),
    ("<inertial><mass>0</mass></inertial>", ("mass is 0", "a positive mass"))])
def test_a_moving_model_without_mass_is_skipped(body, words):
    bad = '<model name="m">{}<link name="l">{}</link></model>'
    loaded, note = told(bad.format("", body))
    assert len(loaded.models) == 1 and "this model is left out" in note and "model[m]" in note
    assert all(word in note for word in words)
    assert len(world(bad.format("<static>1</static>", body)).models) == 1       # what never moves needs no mass
    with pytest.raises(ModelError, match=words[0]):
        load_sdf_models("<sdf version='1.6'>" + bad.format("", body) + "</sdf>")


@pytest.mark.parametrize("text, words", [
    ('<link name="a"/>' + joint(), ('child "b" is no link', "one of a")),
    ('<link name="b"/>' + joint(), ('parent "a" is no link', "one of b or world")),
    (TURNED + joint(kind="rubber"), ('joint type is "rubber"', "revolute, prismatic")),
    (TURNED + joint("<axis><xyz>0 0 0</xyz></axis>"), ("no length", "a direction")),
    (TURNED + '<joint name="j" type="fixed"><child>b</child></joint>', ("<parent> is missing",)),
    (TURNED + '<joint name="j" type="ball"><parent>a</parent><child>world</child></joint>', ("child is the world",)),
    (TURNED + '<joint name="j" type="fixed"><parent>a</parent><child>a</child></joint>', ('both "a"',)),
    (TURNED + '<joint type="fixed"><parent>a</parent><child>b</child></joint>', ("attribute name is missing",))])
def test_invalid_joint_is_skipped_as_in_gazebo(text, words):
    loaded, note = told('<model name="m">{}</model>'.format(text))
    assert loaded.models[0].joints == () and loaded.models[0].links
    assert note.endswith("; this joint is left out.") and "model[m]" in note
    assert all(word in note for word in words)


def test_a_fixed_joint_to_the_world_may_name_it_as_the_child():
    bolted = '<joint name="j" type="fixed"><pose>1 2 3 0 0 0</pose><parent>{}</parent><child>{}</child></joint>'
    turned_round, usual = (model(TURNED + bolted.format(*ends)).joints[0] for ends in (("b", "world"), ("world", "b")))
    assert (turned_round.parent, turned_round.child, turned_round.kind) == ("world", "b", "fixed")
    assert (turned_round.parent, turned_round.child) == (usual.parent, usual.child)


@pytest.mark.parametrize("parent, child", [("m::a", "m::b"), ("a", "m::b"), ("m::a", "b")])
def test_the_ends_of_a_joint_may_be_reported_with_their_model(parent, child):
    ends = "<parent>{}</parent><child>{}</child>"
    hinge = TURNED + joint("<axis><xyz>1 0 0</xyz></axis>", more="<pose>0 0 1 0 0 0</pose>")
    text = '<model name="m">{}</model>'
    plain, named = (world(text.format(body)) for body in (hinge, hinge.replace(ends.format("a", "b"),
                                                                               ends.format(parent, child))))
    assert named.models == plain.models and plain.models[0].joints and not named.notes


def test_nested_model_takes_precedence_over_own_links():
    found = model('<link name="a"/><link name="b"/><model name="m"><link name="a"/></model>'
                  '<joint name="j" type="fixed"><parent>b</parent><child>m::a</child></joint>')
    assert found.joints[0].child == "m::a"


def test_joint_to_a_skipped_nested_model_is_skipped():
    body = ('<link name="base"/><model name="arm"><link name="upper"><inertial><mass>0</mass></inertial></link></model>'
            '<joint name="shoulder" type="fixed"><parent>base</parent><child>arm::upper</child></joint>')
    loaded = world('<model name="m">' + body + "</model>")
    assert [link.name for link in loaded.models[0].links] == ["base"] and loaded.models[0].joints == ()
    assert ["this model" in note or "this joint" in note for note in loaded.notes] == [True, True]


@pytest.mark.parametrize("part, words", [
    ('<include><name>x</name></include>', ("<uri> is missing", "this include")),
    ("<plugin name='x'/>", ("attribute filename", "this plugin")),
    ('<light type="point"/>', ("attribute name", "this light")),
    ("<model/>", ("attribute name", "this model")),
    ("<frame/>", ("attribute name", "this frame"))])
def test_part_without_a_required_element_is_skipped(part, words):
    loaded, note = told(part)
    assert len(loaded.models) == 1 and note.startswith("a.world:3: <sdf/world[w]/") and "; expected " in note
    assert all(word in note for word in words)


@pytest.mark.parametrize("body, words", [
    ("<plugin name='x'/>", "this plugin"), ("<plugin filename='libx.so'/>", "attribute name is missing"),
    ("<link/>", "this link"), ("<joint type='fixed'/>", "this joint")])
def test_only_the_invalid_part_of_a_model_is_skipped(body, words):
    loaded, note = told(static("m", LINK + body))
    assert words in note and len(loaded.models[0].links) == 1
    assert [plugin.name for plugin in loaded.models[0].plugins] == (["libx.so"] if "libx" in body else [])


def test_a_sensor_without_a_type_or_name_is_skipped():
    for attributes, words in (("name='s'", "attribute type"), ("type='ray'", "attribute name")):
        loaded, note = told(static("m", "<link name='l'><sensor {}/></link>".format(attributes)))
        assert words in note and "this sensor is left out" in note and loaded.models[0].links[0].sensors == ()


@pytest.mark.parametrize("part, words, value, expected", [
    ("<physics type='ode'><max_step_size>0</max_step_size></physics>",
     ("max_step_size is 0", "positive", "using 0.001"), lambda loaded: loaded.physics.max_step_size, 0.001),
    ("<physics type='ode'><ode><solver><iters>many</iters></solver></ode></physics>",
     ('iters is "many"', "using 50"), lambda loaded: loaded.physics.iters, 50),
    ("<gravity>0 0</gravity>", ("3 numbers", "using 0 0 -9.8"), lambda loaded: loaded.physics.gravity, (0, 0, -9.8)),
    ("<state world_name='w'><sim_time>12</sim_time></state>", ("seconds and nanoseconds", "using 0"),
     lambda loaded: loaded.state.sim_time_ns, 0),
    ("<state world_name='w'><sim_time>4294967296 5</sim_time></state>",
     ('sim_time is "4294967296 5"', "at most 2147483648 s", "using 0"), lambda loaded: loaded.state.sim_time_ns, 0),
    ("<state world_name='w'><sim_time>0 9000000000000000000000</sim_time></state>", ("at most 2147483648 s",),
     lambda loaded: loaded.state.sim_time_ns, 0),
    (static("m", LINK, "<pose>1 2 3</pose>"), ("six numbers", "using 0 for the missing ones"),
     lambda loaded: loaded.models[0].pose, ((1.0, 2.0, 3.0), IDENTITY[1])),
    (static("m", LINK, "<pose>1 2 3 0 0 0 7</pose>"), ("six numbers", "using the first 6"),
     lambda loaded: loaded.models[0].pose[0], (1.0, 2.0, 3.0)),
    (static("m", LINK, "<pose>1 b 3 0 0 0</pose>"), ('pose is "b"', "zero pose"),
     lambda loaded: loaded.models[0].pose, IDENTITY),
    (static("m", LINK.replace("</geometry>", "</geometry><surface><friction><ode><mu>slippery</mu></ode></friction>"
                              "</surface>")), ('mu is "slippery"', "using 1"),
     lambda loaded: loaded.models[0].links[0].collisions[0].surface, Surface())])
def test_invalid_value_uses_its_default_and_is_reported(part, words, value, expected):
    loaded, note = told(part)
    assert value(loaded) == expected
    assert note.startswith("a.world:") and "; expected " in note
    assert all(word in note for word in words)


def test_robot_with_a_skipped_part_is_spawned():
    found = model(LINK + "<joint name='j' type='fixed'><parent>link</parent><child>gone</child></joint>"
                  "<plugin name='p'/>")
    assert [link.name for link in found.links] == ["link"] and found.joints == found.plugins == ()
    assert ["left out" in note for note in found.notes] == [True, True]


@pytest.mark.parametrize("text, words", [
    ("<sdf version='1.6'>", "a.world:1: not well-formed"),
    ("<robot name='r'/>", "root element is <robot>.*expected <sdf>"),
    ("<sdf version='1.6'/>", "no <world>.*expected one"),
    ("<!DOCTYPE sdf [<!ENTITY a 'b'>]><sdf/>", "entity"),
])
def test_documents_that_are_no_world_are_rejected(text, words):
    with pytest.raises(WorldError, match=words):
        load_world(text, "a.world")


def test_missing_world_file_is_reported(tmp_path):
    with pytest.raises(WorldError, match="nowhere.world: cannot be read: No such file"):
        load_world(str(tmp_path / "nowhere.world"))


def test_models_for_spawning_are_rejected_as_models():
    with pytest.raises(ModelError, match="attribute name is missing"):
        load_sdf_models("<sdf version='1.6'><model/></sdf>")
    with pytest.raises(ModelError, match="no model is in it"):
        load_sdf_models("<sdf version='1.6'/>")


@pytest.mark.parametrize("shape", ["mesh", "heightmap", "image", "capsule"])
def test_unsupported_geometry_is_skipped_and_reported(shape):
    loaded = world(collision("<{0}><uri>model://x/y.dae</uri></{0}>".format(shape)), static("n"))
    assert [len(found.links[0].collisions) for found in loaded.models] == [0, 1]
    note, = loaded.notes
    assert shape in note and "model://x/y.dae" in note and "collision[c]" in note


def test_unsupported_element_is_reported_once_with_its_line():
    loaded = world("<road/><gui/><audio/><wind/><spherical_coordinates/><population name='a'/>",
                   static("m", LINK + "<gripper name='g'/>"), static("n", LINK + "<gripper name='g'/>"))
    assert [("<population>" in note, "<gripper>" in note, note.startswith("a.world:")) for note in loaded.notes] == [
        (False, True, True), (True, False, True)]
    remark, = loaded.remarks
    assert remark.startswith("a.world: without effect") and remark.count("(line 3)") == 5
    assert "<road> in <world> (line 3)" in remark


def test_blocks_that_gazebo_saves_by_default_are_not_reported():
    body = """<pose frame=''>0 0 0 0 0 0</pose><enable_wind>0</enable_wind><link name='l'><collision name='c'>{}
      <surface><contact><ode/></contact><bounce/><friction><torsional><ode/></torsional><ode/></friction></surface>
      <max_contacts>10</max_contacts></collision><self_collide>0</self_collide><enable_wind>0</enable_wind></link>"""
    assert model(body.format(BOX)).notes == ()
    patch = body.replace("<torsional>", "<torsional><patch_radius>0.1</patch_radius>")
    assert "<torsional>" in model(patch.format(BOX)).notes[0]


def test_newer_version_is_reported():
    assert "newer" in world(version="1.9").notes[0]


def test_three_hundred_models_do_not_take_long_to_load():
    parts = [static("m{}".format(index), pose="<pose>{} 0 0 0 0 0.1</pose>".format(index)) for index in range(300)]
    started = time.perf_counter()
    assert len(world(*parts).models) == 300
    assert time.perf_counter() - started < 30.0         # a hundredth of a second on an idle machine


def test_rotation_convention_of_poses():
    found = model('<pose>0 0 0 0.1 0.2 0.3</pose>' + LINK)
    assert found.pose[1] == pytest.approx(quaternion_from_rpy(0.1, 0.2, 0.3))
    turned = model("<pose>0 0 0 0 0 {}</pose>".format(QUARTER) + LINK).pose[1]
    assert rotate(turned, (1, 0, 0)) == pytest.approx((0, 1, 0))


def test_springs_of_joints_and_limits_the_wrong_way_round():
    found = model(TURNED + joint(
        "<axis><limit><lower>2</lower><upper>-1</upper></limit><dynamics><spring_stiffness>8</spring_stiffness>"
        "<spring_reference>0.5</spring_reference></dynamics></axis>"))
    axis = found.joints[0].axis
    assert (axis.lower, axis.upper, axis.spring_stiffness, axis.spring_reference) == (-1.0, 2.0, 8.0, 0.5)
    note, = found.notes
    assert "exchanged" in note and "m.sdf:" in note

# SPDX-License-Identifier: BSD-3-Clause
"""SDF worlds and models: values, versions, frames, includes, stored state, and what is refused or told."""
import math
import time

import pytest

from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.geometry import IDENTITY, quaternion_from_rpy, rotate, yaw_of
from m2wr_sim.model.model_folders import ModelFolders
from m2wr_sim.model.sdf.loader import load_sdf_models, load_world
from m2wr_sim.model.types import Box, Cylinder, Inertial, Physics, Plane, Sphere, Surface

QUARTER = "1.5707963267948966"
BOX = "<geometry><box><size>1 2 3</size></box></geometry>"
LINK = '<link name="link"><collision name="c">' + BOX + "</collision></link>"


def world(*parts, version="1.6", resolve_model=None):
    text = '<sdf version="{}">\n<world name="w">\n{}\n</world></sdf>'.format(version, "\n".join(parts))
    return load_world(text, "a.world", resolve_model)


def model(body, version="1.6", name="m"):
    text = '<sdf version="{}"><model name="{}">\n{}\n</model></sdf>'.format(version, name, body)
    found, = load_sdf_models(text, "m.sdf")
    return found


def refusal(*parts, **options):
    with pytest.raises(WorldError) as caught:
        world(*parts, **options)
    return str(caught.value)


GOOD = '<model name="good"><static>true</static><link name="link"/></model>'


def told(*parts, **options):
    """Return a world with bad parts and a good model behind them, and the one note about it; the good one must load."""
    loaded = world(*(parts + (GOOD,)), **options)
    assert loaded.models[-1].name == "good"
    note, = loaded.notes
    return loaded, note


def static(name, body=LINK, pose=""):
    return '<model name="{}"><static>true</static>{}{}</model>'.format(name, pose, body)


# -- values -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("text, expected", [
    ("<box><size>1 2 3</size></box>", Box((1.0, 2.0, 3.0))),
    ("<cylinder><radius>0.5</radius><length>2</length></cylinder>", Cylinder(0.5, 2.0)),
    ("<sphere><radius>0.5</radius></sphere>", Sphere(0.5)),
    ("<plane><normal>0 0 2</normal><size>5 6</size></plane>", Plane((0.0, 0.0, 1.0), (5.0, 6.0))),
    ("<plane/>", Plane((0.0, 0.0, 1.0), (1.0, 1.0))),
])
def test_geometries(text, expected):
    found = model('<link name="l"><collision name="c"><geometry>{}</geometry></collision></link>'.format(text))
    assert found.links[0].collisions[0].geometry == expected


def test_defaults_are_those_of_sdf():
    body = model(LINK).links[0]
    part = body.collisions[0]
    assert body.inertial == Inertial(1.0, IDENTITY, (1.0, 0.0, 0.0, 1.0, 0.0, 1.0))
    assert (body.gravity, body.self_collide, body.kinematic, body.linear_damping) == (True, False, False, 0.0)
    assert (part.surface, part.laser_retro, part.max_contacts) == (Surface(), 0.0, 10)
    assert world().physics == Physics() and world().name == "w" and world().state is None


def test_link_and_surface_values():
    body = model("""<self_collide>true</self_collide><allow_auto_disable>0</allow_auto_disable>
      <link name="l"><gravity>0</gravity><kinematic>1</kinematic>
        <velocity_decay><linear>0.1</linear><angular>0.2</angular></velocity_decay>
        <inertial><pose>0.1 0 0 0 0 0</pose><mass>2</mass><inertia><ixx>0.3</ixx><iyy>0.4</iyy><izz>0.5</izz>
          <ixy>0.01</ixy></inertia></inertial>
        <collision name="c"><pose>0 0 1 0 0 0</pose>""" + BOX + """<laser_retro>100</laser_retro>
          <max_contacts>3</max_contacts><surface>
            <friction><ode><mu>0.5</mu><mu2>0.6</mu2><fdir1>1 0 0</fdir1><slip1>0.1</slip1><slip2>0.2</slip2></ode>
            </friction><bounce><restitution_coefficient>0.7</restitution_coefficient><threshold>0.01</threshold></bounce>
            <contact><collide_bitmask>0x02</collide_bitmask><collide_without_contact>1</collide_without_contact>
              <ode><kp>1e5</kp><kd>2</kd><max_vel>0.3</max_vel><min_depth>0.004</min_depth></ode></contact>
          </surface></collision></link>""")
    link = body.links[0]
    assert not body.allow_auto_disable
    assert (link.gravity, link.self_collide, link.kinematic, link.linear_damping, link.angular_damping) == (
        False, True, True, 0.1, 0.2)
    assert link.inertial == Inertial(2.0, ((0.1, 0.0, 0.0), IDENTITY[1]), (0.3, 0.01, 0.0, 0.4, 0.0, 0.5))
    part = link.collisions[0]
    assert (part.pose[0], part.laser_retro, part.max_contacts) == ((0.0, 0.0, 1.0), 100.0, 3)
    assert part.surface == Surface(0.5, 0.6, (1.0, 0.0, 0.0), 0.1, 0.2, 0.7, 0.01, 1e5, 2.0, 0.3, 0.004, 2, True)


def test_physics_values_and_the_default_profile():
    loaded = world("""<physics type="ode" name="first"><max_step_size>0.01</max_step_size></physics>
      <physics type="ode" name="second" default="true"><max_step_size>0.002</max_step_size>
        <real_time_update_rate>500</real_time_update_rate><max_contacts>8</max_contacts>
        <ode><solver><type>world</type><iters>150</iters><precon_iters>2</precon_iters><sor>1.4</sor></solver>
          <constraints><cfm>1e-5</cfm><erp>0.3</erp><contact_max_correcting_vel>2000</contact_max_correcting_vel>
          <contact_surface_layer>0.01</contact_surface_layer></constraints></ode></physics>
      <gravity>0 0 -1.62</gravity>""")
    assert loaded.physics == Physics(0.002, 500.0, (0.0, 0.0, -1.62), 8, "world", 150, 2, 1.4, 1e-5, 0.3, 2000.0, 0.01)
    assert any("2 physics profiles" in note for note in loaded.notes)


def test_gravity_inside_physics_of_old_files():
    assert world("<physics type='ode'><gravity>0 0 -5</gravity></physics>", version="1.4").physics.gravity == (0, 0, -5)
    both = world("<physics type='ode'><gravity>0 0 -5</gravity></physics><gravity>0 0 -6</gravity>", version="1.5")
    assert both.physics.gravity == (0.0, 0.0, -6.0)


def test_lights_and_plugins_at_every_level():
    loaded = world('<light name="lamp" type="point"/><light name="lamp" type="spot"/>',
                   '<plugin name="pw" filename="libw.so"/>',
                   '<model name="m"><plugin name="pm" filename="libm.so"><a>1</a></plugin><link name="l">'
                   '<sensor name="s" type="ray"><pose>1 0 0 0 0 0</pose><plugin name="ps" filename="libs.so"/></sensor>'
                   '</link></model>')
    assert [light.name for light in loaded.lights] == ["lamp"]
    assert [plugin.name for plugin in loaded.plugins] == ["pw"]
    found = loaded.models[0]
    assert found.plugins[0].find("a") == "1"
    sensor = found.links[0].sensors[0]
    assert sensor.pose[0] == (1.0, 0.0, 0.0) and sensor.plugins[0].reference == "l"


# -- joints and versions ------------------------------------------------------------------------------------------

TURNED = '<link name="a"/><link name="b"><pose>0 0 0 0 0 {}</pose></link>'.format(QUARTER)


def joint(axis="", kind="revolute", more=""):
    return '<joint name="j" type="{}"><parent>a</parent><child>b</child>{}{}</joint>'.format(kind, axis, more)


@pytest.mark.parametrize("version, flag, expected", [
    ("1.4", "", (0.0, -1.0, 0.0)), ("1.5", "", (1.0, 0.0, 0.0)),
    ("1.6", "<use_parent_model_frame>1</use_parent_model_frame>", (0.0, -1.0, 0.0)),
    ("1.6", "<use_parent_model_frame>0</use_parent_model_frame>", (1.0, 0.0, 0.0)), ("1.7", "", (1.0, 0.0, 0.0))])
def test_axis_frames_of_the_versions(version, flag, expected):
    found = model(TURNED + joint("<axis><xyz>1 0 0</xyz>{}</axis>".format(flag)), version)
    assert found.joints[0].axis.xyz == pytest.approx(expected)


def test_axis_expressed_in_another_frame_and_joint_pose():
    found = model(TURNED + joint('<axis><xyz expressed_in="__model__">2 0 0</xyz></axis>',
                                 more="<pose>0 0 0.5 0 0 {}</pose>".format(QUARTER)), "1.7").joints[0]
    assert found.pose[0] == (0.0, 0.0, 0.5)
    assert found.axis.xyz == pytest.approx((-1.0, 0.0, 0.0))


def test_joint_values():
    found = model(TURNED + joint("""<axis><xyz>0 0 1</xyz>
        <dynamics><damping>0.1</damping><friction>0.2</friction></dynamics>
        <limit><lower>-inf</lower><upper>1</upper><effort>5</effort></limit></axis>
      <physics><ode><limit><erp>0.7</erp><cfm>0.01</cfm></limit></ode></physics>""")).joints[0]
    axis = found.axis
    assert (found.kind, found.parent, found.child) == ("revolute", "a", "b")
    assert (axis.damping, axis.friction, axis.lower, axis.upper, axis.effort, axis.velocity, axis.stop_erp,
            axis.stop_cfm) == (0.1, 0.2, -1e16, 1.0, 5.0, -1.0, 0.7, 0.01)


@pytest.mark.parametrize("kind", ["fixed", "ball", "prismatic", "universal"])
def test_joint_kinds(kind):
    found = model(TURNED + joint(kind=kind)).joints[0]
    assert found.kind == kind and (found.axis2 is not None) == (kind == "universal")


def test_joint_to_the_world_and_unsupported_kind():
    found = model('<link name="a"/><joint name="j" type="fixed"><parent>world</parent><child>a</child></joint>'
                  '<joint name="k" type="screw"><parent>world</parent><child>a</child></joint>')
    assert [item.parent for item in found.joints] == ["world"]
    assert any("screw" in note for note in found.notes)


# -- frames and nesting -------------------------------------------------------------------------------------------

def test_relative_to_links_frames_joints_and_models():
    found = model("""
      <link name="a"><pose>1 0 0 0 0 {0}</pose>
        <collision name="c"><pose relative_to="f">0 0 0 0 0 0</pose>{1}</collision></link>
      <link name="b"><pose relative_to="a">1 0 0 0 0 0</pose></link>
      <frame name="f" attached_to="b"><pose>0 0 1 0 0 0</pose></frame>
      <link name="c"><pose relative_to="f">0 1 0 0 0 0</pose></link>""".format(QUARTER, BOX), "1.7")
    positions = [link.pose[0] for link in found.links]
    assert positions[1] == pytest.approx((1.0, 1.0, 0.0))
    assert positions[2] == pytest.approx((0.0, 1.0, 1.0))
    assert found.links[0].collisions[0].pose[0] == pytest.approx((1.0, 0.0, 1.0))
    loaded = world(static("m", pose='<pose relative_to="n">1 0 0 0 0 0</pose>'),
                   static("n", pose="<pose>0 2 0 0 0 {}</pose>".format(QUARTER)), version="1.7")
    assert loaded.models[0].pose[0] == pytest.approx((0.0, 3.0, 0.0))


def test_unknown_frame_attribute_is_reported():
    loaded = world(static("m", pose="<pose frame=''>1 2 3 0 0 0</pose>"),
                   static("n", pose="<pose frame='nowhere'>1 2 3 0 0 0</pose>"))
    assert [found.pose[0] for found in loaded.models] == [(1.0, 2.0, 3.0)] * 2
    note, = loaded.notes
    assert '"nowhere"' in note and "a.world:4" in note


def test_cyclic_poses_are_reported():
    loaded, note = told(static("m", pose='<pose relative_to="n">1 0 0 0 0 0</pose>'),
                        static("n", pose='<pose relative_to="m">2 0 0 0 0 0</pose>'))
    assert "form a cycle (m -> n -> m)" in note and "a.world:3" in note and "the enclosing frame" in note
    assert [found.pose[0][0] for found in loaded.models] == [1.0, 3.0, 0.0]


def test_nested_models_are_flattened_with_scoped_names():
    found = model("""<link name="base"/>
      <model name="arm"><pose>1 0 0 0 0 {0}</pose><link name="upper"><pose>1 0 0 0 0 0</pose>
          <sensor name="s" type="imu"><plugin name="p" filename="libp.so"/></sensor></link><link name="lower"/>
        <joint name="elbow" type="revolute"><parent>upper</parent><child>lower</child></joint>
        <joint name="bolt" type="fixed"><parent>world</parent><child>upper</child></joint>
        <model name="hand"><pose>0 0 1 0 0 0</pose><link name="palm"/></model></model>
      <joint name="shoulder" type="revolute"><parent>base</parent><child>arm::upper</child></joint>
      <link name="tip"><pose relative_to="arm::upper">0 0 5 0 0 0</pose></link>""".format(QUARTER), "1.7")
    assert [link.name for link in found.links] == ["base", "tip", "arm::upper", "arm::lower", "arm::hand::palm"]
    assert found.nested == ("arm", "arm::hand")
    poses = {link.name: link.pose for link in found.links}
    assert poses["arm::upper"][0] == pytest.approx((1.0, 1.0, 0.0))
    assert yaw_of(poses["arm::upper"][1]) == pytest.approx(math.pi / 2)
    assert poses["arm::hand::palm"][0] == pytest.approx((1.0, 0.0, 1.0))
    assert poses["tip"][0] == pytest.approx((1.0, 1.0, 5.0))
    assert [(item.name, item.parent, item.child) for item in found.joints] == [
        ("arm::elbow", "arm::upper", "arm::lower"), ("arm::bolt", "world", "arm::upper"),
        ("shoulder", "base", "arm::upper")]
    assert found.links[2].sensors[0].plugins[0].reference == "arm::upper"


def test_models_nested_too_deep_are_skipped():
    loaded, note = told("".join('<model name="m">' + LINK for _ in range(40)) + "</model>" * 40)
    assert "nested deeper than 32" in note and "this model is left out" in note
    assert len(loaded.models[0].links) == 32


def test_repeated_names_are_skipped_and_reported():
    loaded = world(static("m", pose="<pose>1 0 0 0 0 0</pose>"), static("m"), static("n", LINK + LINK),
                   static("empty", ""))
    assert [found.name for found in loaded.models] == ["m", "n"] and loaded.models[0].pose[0] == (1.0, 0.0, 0.0)
    assert len(loaded.models[1].links) == 1
    told = " ".join(loaded.notes)
    assert 'a model "m"' in told and 'another link "link"' in told and '"empty" has no link' in told


# -- includes -----------------------------------------------------------------------------------------------------

@pytest.fixture
def folders(tmp_path):
    def add(name, sdf, config='<model><sdf version="1.6">model.sdf</sdf></model>', file="model.sdf"):
        (tmp_path / name).mkdir(exist_ok=True)
        (tmp_path / name / file).write_text(sdf)
        if config:
            (tmp_path / name / "model.config").write_text(config)

    finder = ModelFolders(["/nonexistent", str(tmp_path)])
    finder.add = add
    add("post", '<sdf version="1.6"><model name="post"><pose>9 9 9 0 0 0</pose>{}</model></sdf>'.format(LINK))
    return finder


def include(uri, body=""):
    return "<include><uri>{}</uri>{}</include>".format(uri, body)


def test_include_overrides_name_pose_static_and_adds_plugins(folders):
    own = "<name>p2</name><pose>1 2 3 0 0 0</pose><static>true</static><plugin name='x' filename='libx.so'/>"
    loaded = world(include("model://post"), include("model://post", own),
                   include("model://post", "<pose>5 5 5 0 0 0</pose>"), resolve_model=folders)
    first, second = loaded.models
    assert (first.name, first.pose[0], first.static) == ("post", (9.0, 9.0, 9.0), False)
    assert (second.name, second.pose[0], second.static) == ("p2", (1.0, 2.0, 3.0), True)
    assert [plugin.name for plugin in second.plugins] == ["x"] and first.plugins == ()
    note, = loaded.notes
    assert 'a model "post" is there already' in note


def test_newest_sdf_that_can_be_read_is_taken(folders):
    folders.add("v", '<sdf version="1.7"><model name="seven">{}</model></sdf>'.format(LINK), None, "seven.sdf")
    folders.add("v", '<sdf version="1.4"><model name="four">{}</model></sdf>'.format(LINK), """<model>
      <sdf version="1.4">four.sdf</sdf><sdf version="1.7">seven.sdf</sdf><sdf version="1.10">ten.sdf</sdf></model>""",
                "four.sdf")
    assert [found.name for found in world(include("model://v"), resolve_model=folders).models] == ["seven"]


def test_missing_model_is_reported_with_the_searched_folders(folders):
    loaded = world(include("model://nothing"), include("https://example.com/x"), static("m"), resolve_model=folders)
    assert [found.name for found in loaded.models] == ["m"]
    assert "model://nothing" in loaded.notes[0] and "/nonexistent" in loaded.notes[0] and "a.world:3" in loaded.notes[0]
    assert "https://example.com/x" in loaded.notes[1] and "nothing is downloaded" in loaded.notes[1]


@pytest.mark.parametrize("uri", ["model://../../etc", "model://post/../../x.sdf", "file:///tmp/../etc/x.sdf"])
def test_includes_outside_the_folder_are_skipped(folders, uri):
    loaded, note = told(include(uri), resolve_model=folders)
    assert '".."' in note and "this include is left out" in note and uri in note and len(loaded.models) == 1


def test_a_config_that_points_outside_costs_its_include(folders):
    folders.add("bad", "<sdf/>", '<model><sdf version="1.6">../post/model.sdf</sdf></model>')
    assert '".."' in told(include("model://bad"), resolve_model=folders)[1]


def test_cyclic_includes_are_skipped(folders):
    nested = '<sdf version="1.6"><model name="{0}">{1}<include><uri>model://{2}</uri></include></model></sdf>'
    folders.add("one", nested.format("one", LINK, "two"))
    folders.add("two", nested.format("two", LINK, "one"))
    loaded, note = told(include("model://one"), resolve_model=folders)
    assert "model://one includes itself" in note and "two/model.sdf" in note and "this include is left out" in note
    assert [link.name for link in loaded.models[0].links] == ["link", "two::link"]


def test_include_in_a_model_inherits_static(folders):
    folders.add("row", '<sdf version="1.6"><model name="row"><static>true</static>' + "".join(
        include("model://post", "<name>p{0}</name><pose>{0} 0 0 0 0 0</pose>".format(index)) for index in (1, 2)) +
        "</model></sdf>")
    found, = world(include("model://row", "<pose>0 0 1 0 0 0</pose>"), resolve_model=folders).models
    assert found.static and found.nested == ("p1", "p2")
    assert [(link.name, link.pose[0]) for link in found.links] == [("p1::link", (1.0, 0.0, 0.0)),
                                                                   ("p2::link", (2.0, 0.0, 0.0))]


@pytest.mark.parametrize("text, words", [
    ("<sdf>\n<model>", "broken/model.sdf:2: not well-formed"), ("<robot/>", "expected <sdf>"),
    ('<sdf version="1.6"><model name="m"><link name="l"><inertial><mass>-1</mass></inertial></link></model></sdf>',
     "mass is -1"), ('<sdf version="1.6"><model/></sdf>', "attribute name is missing")])
def test_unusable_included_file_is_reported_once(folders, text, words):
    folders.add("broken", text)
    twice = include("model://broken") + "\n" + include("model://broken", "<name>other</name>")
    loaded, note = told(twice, resolve_model=folders)
    assert words in note and "this include is left out" in note and len(loaded.models) == 1


def test_database_form_of_spawning(folders):
    text = '<sdf version="1.6"><world name="default">{}</world></sdf>'.format(include("model://post"))
    found, = load_sdf_models(text, "x", folders)
    assert found.name == "post"


# -- stored state -------------------------------------------------------------------------------------------------

def test_first_state_is_read():
    loaded = world(static("m"), static("gone"), """<state world_name="w"><sim_time>1183 639000000</sim_time>
        <real_time>1 2</real_time><wall_time>3 4</wall_time><iterations>5</iterations>
        <model name="m"><pose frame=''>1 2 3 0 0 {0}</pose><scale>1 1 1</scale>
          <link name="link"><pose>4 5 6 0 0 0</pose><velocity>1 2 3 4 5 6</velocity><wrench>0 0 0 0 0 0</wrench></link>
          <model name="inner"><link name="x"/></model></model>
        <light name="sun"><pose>0 0 10 0 0 0</pose></light>
        <deletions><name>gone</name></deletions><insertions>{1}</insertions></state>
        <state world_name="w"><sim_time>9 0</sim_time></state>""".format(QUARTER, static("new")))
    assert [found.name for found in loaded.models] == ["m", "new"]
    state = loaded.state
    assert state.sim_time_ns == 1183639000000
    entry, = state.models
    assert (entry.name, entry.pose[0]) == ("m", (1.0, 2.0, 3.0))
    assert yaw_of(entry.pose[1]) == pytest.approx(math.pi / 2)
    assert entry.links == (("link", ((4.0, 5.0, 6.0), IDENTITY[1]), ((1.0, 2.0, 3.0), (4.0, 5.0, 6.0))),
                           ("inner::x", None, None))
    note, = loaded.notes
    assert "2 states" in note
    assert loaded.models[0].pose == IDENTITY      # the state does not replace the pose that a reset returns to


# -- refusals and notes -------------------------------------------------------------------------------------------

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
    loaded = world("<scene/><gui/><audio/><wind/><spherical_coordinates/><actor name='a'/>",
                   static("m", LINK + "<gripper name='g'/>"), static("n", LINK + "<gripper name='g'/>"))
    assert [("<actor>" in note, "<gripper>" in note, note.startswith("a.world:")) for note in loaded.notes] == [
        (False, True, True), (True, False, True)]
    remark, = loaded.remarks
    assert remark.startswith("a.world: without effect") and remark.count("(line 3)") == 5
    assert "<scene> in <world> (line 3)" in remark


def test_blocks_that_gazebo_saves_by_default_are_not_reported():
    body = """<pose frame=''>0 0 0 0 0 0</pose><enable_wind>0</enable_wind><link name='l'><collision name='c'>{}
      <surface><contact><ode/></contact><bounce/><friction><torsional><ode/></torsional><ode/></friction></surface>
      <max_contacts>10</max_contacts></collision><self_collide>0</self_collide><enable_wind>0</enable_wind></link>"""
    assert model(body.format(BOX)).notes == ()
    patch = body.replace("<torsional>", "<torsional><patch_radius>0.1</patch_radius>")
    assert "<torsional>" in model(patch.format(BOX)).notes[0]


def test_newer_version_is_reported():
    assert "newer" in world(version="1.9").notes[0]


def test_three_hundred_models_load_in_a_second():
    parts = [static("m{}".format(index), pose="<pose>{} 0 0 0 0 0.1</pose>".format(index)) for index in range(300)]
    started = time.perf_counter()
    assert len(world(*parts).models) == 300
    assert time.perf_counter() - started < 1.0


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


def test_lights_with_three_and_four_colours_and_in_an_include(folders):
    folders.add("lamp", '<sdf version="1.6"><light name="lamp" type="spot"><attenuation><linear>0.5</linear>'
                '</attenuation><direction>1 0 0</direction></light></sdf>')
    loaded = world('<light name="a" type="directional"><cast_shadows>true</cast_shadows><pose>0 0 10 0 0 0</pose>'
                   '<diffuse>0.5 0.25 0</diffuse><specular>1 1 1 0.5</specular></light>',
                   include("model://lamp", "<name>b</name>"), static("m"), resolve_model=folders)
    first, second = loaded.lights
    assert (first.name, first.kind, first.cast_shadows, first.pose[0]) == ("a", "directional", True, (0.0, 0.0, 10.0))
    assert first.diffuse == (0.5, 0.25, 0.0, 1.0) and first.specular == (1.0, 1.0, 1.0, 0.5)
    assert (second.name, second.kind, second.attenuation, second.direction) == (
        "b", "spot", (1.0, 0.5, 0.0), (1.0, 0.0, 0.0))
    assert [found.name for found in loaded.models] == ["m"] and loaded.notes == ()

# SPDX-License-Identifier: BSD-3-Clause
"""SDF worlds and models: values, frames, nested models and the stored state."""
import math

import pytest

from m2wr_sim.api import Sim
from m2wr_sim.geometry import IDENTITY, yaw_of
from m2wr_sim.model.types import Box, Cylinder, Inertial, Physics, Plane, Sphere, Surface
from sdf_documents import BOX, LINK, QUARTER, model, static, told, world


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


def test_a_model_of_static_models_is_static():
    found = world('<model name="office">{}<model name="rooms">{}</model></model>'.format(
        static("wall"), static("door", "<link name='panel'><inertial><mass>0</mass></inertial></link>")))
    office, = found.models
    assert office.static and not found.notes
    assert [link.name for link in office.links] == ["wall::link", "rooms::door::panel"]


def test_a_static_model_inside_of_one_that_moves_stays():
    found = world('<model name="lift">{}<link name="cabin"/>{}</model>'.format(
        static("shaft", "<link name='wall'><inertial><mass>0</mass></inertial></link>"),
        '<model name="lamp"><link name="bulb"/></model>'))
    lift, = found.models
    assert not lift.static and not found.notes
    assert [(link.name, link.kinematic, link.gravity) for link in lift.links] == [
        ("cabin", False, True), ("shaft::wall", True, False), ("lamp::bulb", False, True)]
    with Sim(found) as sim:
        sim.step(None, 0.5)
        live, engine = sim.simulator.models["lift"], sim.simulator.engine
        heights = [engine.link_pose(live.handle.links[name])[0][2] for name in ("cabin", "shaft::wall", "lamp::bulb")]
    assert heights[1] == 0.0 and max(heights[0], heights[2]) < -1.0


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

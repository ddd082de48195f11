# SPDX-License-Identifier: BSD-3-Clause
"""``<gazebo>`` blocks: which tag reaches what, sensors and plugins, and what is told about the rest."""
import math

import pytest

from m2wr_sim.geometry import IDENTITY
from m2wr_sim.model.types import Noise, RayScan
from m2wr_sim.model.urdf.loader import load_urdf

INERTIAL = '<inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>'
SHAPE = '<{tag}{name}><geometry><sphere radius="0.1"/></geometry></{tag}>'


def link(name, *parts):
    return '<link name="{}">{}{}</link>'.format(name, INERTIAL, "".join(parts))


def collision(name=""):
    return SHAPE.format(tag="collision", name=' name="{}"'.format(name) if name else "")


def visual(name=""):
    return SHAPE.format(tag="visual", name=' name="{}"'.format(name) if name else "")


def fixed(parent, child, origin='<origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>', name="fix"):
    return '<joint name="{}" type="fixed"><parent link="{}"/><child link="{}"/>{}</joint>'.format(
        name, parent, child, origin)


def block(text, reference=None):
    return "<gazebo{}>{}</gazebo>".format(' reference="{}"'.format(reference) if reference else "", text)


def robot(*parts):
    return load_urdf('<robot name="r">\n{}\n</robot>'.format("\n".join(parts)), "r.urdf")


SURFACE = ("<mu1>0.5</mu1><mu2 value='0.25'/><kp>1e6</kp><kd>10</kd><minDepth>0.001</minDepth><maxVel>0.2</maxVel>"
           "<fdir1>0 1 0</fdir1><maxContacts>4</maxContacts><laserRetro>7</laserRetro>")


def check_surface(part, applied=True):
    surface = part.surface
    values = (surface.mu, surface.mu2, surface.kp, surface.kd, surface.min_depth, surface.max_vel, surface.fdir1,
              part.max_contacts, part.laser_retro)
    assert values == ((0.5, 0.25, 1e6, 10.0, 0.001, 0.2, (0.0, 1.0, 0.0), 4, 7.0) if applied else
                      (1.0, 1.0, 1e12, 1.0, 0.0, 0.01, (0.0, 0.0, 0.0), 10, 0.0))


@pytest.mark.parametrize("name, applied", [("", True), ("a_plate", True), ("plate", False)])
def test_surface_tags_apply_to_collisions_by_link_name(name, applied):
    model = robot(link("a", collision(name)), block(SURFACE, "a"))
    check_surface(model.links[0].collisions[0], applied)
    told = [note for note in model.notes if "does not reach" in note]
    assert len(told) == (0 if applied else 1)
    if told:
        assert 'a_fixed_joint_lump__plate_collision"' in told[0] and "r.urdf:3" in told[0]


def test_tags_of_a_lumped_link_reach_only_its_unnamed_collisions():
    model = robot(link("a", collision()), link("b", collision(), collision("lens")), fixed("a", "b"),
                  block(SURFACE, "b"))
    own, unnamed, named = model.links[0].collisions
    assert (own.name, unnamed.name, named.name) == (
        "a_collision", "a_fixed_joint_lump__b_collision_1", "a_fixed_joint_lump__lens_collision_2")
    check_surface(own, False)
    check_surface(unnamed, True)
    check_surface(named, False)


def test_tags_of_the_carrier_do_not_reach_lumped_collisions():
    model = robot(link("a", collision()), link("b", collision()), fixed("a", "b"), block(SURFACE, "a"))
    check_surface(model.links[0].collisions[0], True)
    check_surface(model.links[0].collisions[1], False)
    assert model.notes == ()


def test_wheel_reported_after_the_other_wheel_receives_nothing():
    named = collision("link_right_wheel_collision")
    joints = "".join('<joint name="j{0}" type="continuous"><parent link="base"/><child link="link_{0}_wheel"/></joint>'
                     .format(side) for side in ("left", "right"))
    model = robot(link("base"), link("link_left_wheel", named), link("link_right_wheel", named), joints,
                  block(SURFACE, "link_left_wheel"), block(SURFACE, "link_right_wheel"))
    left, right = (body.collisions[0] for body in model.links[1:])
    check_surface(left, False)
    check_surface(right, True)


def test_later_gazebo_tags_take_precedence():
    own = ('<collision><geometry><sphere radius="1"/></geometry><surface><friction><ode><mu>0.1</mu><slip1>0.3</slip1>'
           '</ode></friction></surface></collision>')
    model = robot(link("a", own), block("<mu1>0.7</mu1>", "a"), block("<mu1>0.8</mu1>", "a"))
    surface = model.links[0].collisions[0].surface
    assert (surface.mu, surface.slip1) == (0.8, 0.3)


def test_collision_blob_overrides_the_surface_it_names():
    model = robot(link("a", collision()), block(
        "<collision><surface><contact><ode><kd>5</kd></ode></contact></surface></collision>", "a"))
    assert (model.links[0].collisions[0].surface.kd, model.links[0].collisions[0].surface.kp) == (5.0, 1e12)


def test_link_switches_also_from_a_lumped_link():
    model = robot(link("a"), link("b"), fixed("a", "b"), block(
        "<turnGravityOff>true</turnGravityOff><dampingFactor>0.5</dampingFactor><selfCollide value='yes'/>", "b"))
    body = model.links[0]
    assert (body.gravity, body.linear_damping, body.angular_damping, body.self_collide) == (False, 0.5, 0.5, True)


def test_last_material_applies_to_visuals():
    model = robot(link("a", visual(), visual("plate")), link("b", visual()), fixed("a", "b"),
                  block("<material>Gazebo/Blue</material>", "a"), block("<material>Gazebo/Red</material>", "a"),
                  block("<material>Gazebo/Black</material>", "b"))
    assert [part.material for part in model.links[0].visuals] == ["Gazebo/Red", None, "Gazebo/Black"]


def test_joint_tags():
    model = robot(link("a"), link("b"), '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>',
                  block("<stopErp>0.9</stopErp><stopCfm>0.01</stopCfm><provideFeedback>true</provideFeedback>"
                        "<springStiffness>3</springStiffness><springReference>0.5</springReference>"
                        "<implicitSpringDamper>true</implicitSpringDamper><fudgeFactor>0.5</fudgeFactor>", "j"))
    axis = model.joints[0].axis
    assert (axis.stop_erp, axis.stop_cfm, axis.spring_stiffness, axis.spring_reference, axis.fudge_factor) == (
        0.9, 0.01, 3.0, 0.5, 0.5)
    remark, = model.remarks
    assert model.notes == () and "<provideFeedback>" in remark and "<implicitSpringDamper>" in remark


def test_blobs_for_viewers_are_reported_in_one_quiet_line():
    model = robot(link("a"), block("<visual><material/></visual><light name='l'/><projector/>", "a"),
                  block("<enable_wind>true</enable_wind>"))
    remark, = model.remarks
    assert model.notes == () and all("<%s> in a <gazebo> block (line " % tag in remark
                                     for tag in ("visual", "light", "projector", "enable_wind"))


def test_switches_that_keep_a_fixed_joint():
    disabled = robot(link("a"), link("b"), fixed("a", "b"), block(
        "<disableFixedJointLumping>true</disableFixedJointLumping>", "fix"))
    preserved = robot(link("a"), link("b"), fixed("a", "b"), block(
        "<disableFixedJointLumping>true</disableFixedJointLumping>"
        "<preserveFixedJoint>true</preserveFixedJoint>", "fix"))
    assert [body.name for body in disabled.links] == [body.name for body in preserved.links] == ["a", "b"]
    item, = disabled.joints
    assert (item.kind, item.axis.lower, item.axis.upper) == ("revolute", 0.0, 0.0)
    assert preserved.joints[0].kind == "fixed"


def test_self_collide_of_the_model_is_the_default_of_its_links():
    model = robot(link("a"), link("b"), '<joint name="j" type="continuous"><parent link="a"/><child link="b"/></joint>',
                  block("<self_collide>true</self_collide>"), block("<selfCollide>false</selfCollide>", "b"))
    assert [body.self_collide for body in model.links] == [True, False]


def test_model_level_tags():
    model = robot(link("a"), block("<static>true</static><allow_auto_disable>false</allow_auto_disable>"
                                   "<plugin name='p' filename='libp.so'/>"))
    assert model.static and not model.allow_auto_disable
    assert model.plugins[0].name == "p" and model.plugins[0].parameters == ()


SENSOR = '<sensor name="s" type="{kind}">{body}</sensor>'


def sensor_of(body, kind="ray", **options):
    model = robot(link("a"), link("b"), fixed("a", "b"), block(SENSOR.format(kind=kind, body=body), "b"))
    return model.links[0].sensors[0], model.notes


def test_sensor_of_a_lumped_link_is_moved_along():
    sensor, notes = sensor_of("<pose>0.5 0 0.2 0 0 0</pose>")
    assert sensor.pose[0] == pytest.approx((1.0, 0.5, 0.2))
    assert sensor.pose[1] == pytest.approx((0.0, 0.0, math.sqrt(0.5), math.sqrt(0.5)))
    assert notes == ()


def test_sensor_pose_with_relative_to_is_left_alone():
    sensor, notes = sensor_of('<pose relative_to="x">0.5 0 0 0 0 0</pose>')
    assert sensor.pose == ((0.5, 0.0, 0.0), IDENTITY[1]) and len(notes) == 1


def test_ray_sensor_defaults_are_those_of_sdf():
    sensor, _ = sensor_of("")
    assert sensor.ray == RayScan(640, 1.0, 0.0, 0.0, 1, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, Noise())
    assert (sensor.update_rate, sensor.always_on, sensor.visualize) == (0.0, False, False)


def test_ray_sensor_values():
    sensor, _ = sensor_of(
        "<always_on>1</always_on><update_rate>5</update_rate><visualize>true</visualize><ray><scan><horizontal>"
        "<samples>10</samples><resolution>0.5</resolution><min_angle>-1</min_angle><max_angle>2</max_angle>"
        "</horizontal>"
        "<vertical><samples>3</samples><min_angle>-0.1</min_angle><max_angle>0.1</max_angle></vertical></scan>"
        "<range><min>0.2</min><max>5</max><resolution>0.01</resolution></range>"
        "<noise><mean>0.1</mean><stddev>0.02</stddev><bias_mean>0.3</bias_mean><precision>0.5</precision></noise>"
        "</ray>",
        "gpu_ray")
    assert sensor.kind == "gpu_ray" and sensor.always_on and sensor.visualize and sensor.update_rate == 5.0
    assert sensor.ray == RayScan(10, 0.5, -1.0, 2.0, 3, 1.0, -0.1, 0.1, 0.2, 5.0, 0.01,
                                 Noise("gaussian", 0.1, 0.02, 0.3, 0.0, 0.5))


@pytest.mark.parametrize("text, kind", [("<type>none</type>", "none"), ("<type>custom</type>", "custom"),
                                        ("<type>gaussian_quantized</type>", "gaussian_quantized"), ("", "gaussian")])
def test_noise_kinds(text, kind):
    sensor, notes = sensor_of("<ray><noise>{}</noise></ray>".format(text))
    assert sensor.ray.noise.kind == kind and notes == ()


def test_unknown_noise_is_reported_and_skipped():
    sensor, notes = sensor_of("<ray><noise><type>pink</type><stddev>1</stddev></noise></ray>")
    assert sensor.ray.noise == Noise()
    assert '"pink"' in notes[0] and "gaussian" in notes[0]


@pytest.mark.parametrize("body, words, taken", [
    ("<ray><scan><horizontal><samples>0</samples></horizontal></scan></ray>", "at least 1", "using 640"),
    ("<ray><scan><horizontal><samples>1e9</samples></horizontal></scan></ray>", "at most 1000000", "one row of 640"),
    ("<ray><scan><vertical><resolution>0</resolution></vertical></scan></ray>", "a positive number", "using 1"),
    ("<ray><range><max>inf</max></range></ray>", "finite number", "using 0"),
    ("<ray><range><min>-1</min></range></ray>", "zero or a positive number", "using 0"),
    ("<update_rate>fast</update_rate>", "finite number", "using 0"),
    ("<plugin name='p'/>", "filename", "this plugin is left out"),
])
def test_invalid_sensor_values_are_reported_and_use_defaults(body, words, taken):
    sensor, (note,) = sensor_of(body)
    assert words in note and taken in note and "r.urdf:5" in note
    assert sensor.ray == RayScan() and sensor.update_rate == 0.0 and sensor.plugins == ()


def test_other_sensors_keep_name_rate_and_plugins():
    sensor, notes = sensor_of("<update_rate>50</update_rate><imu/><plugin name='p' filename='libimu.so'>"
                              "<frameName>b</frameName></plugin>", "imu")
    assert (sensor.kind, sensor.ray, sensor.update_rate) == ("imu", None, 50.0)
    assert sensor.plugins[0].reference == "a" and sensor.plugins[0].find("frameName") == "b"
    assert notes == ()


def test_plugin_parameters_keep_order_text_value_and_depth():
    model = robot(link("a"), block(
        "<plugin name='p' filename='libp.so'><rate> 20 </rate><name value='x'/><flag/><list><item>1</item>"
        "<item>2</item></list><rate>30</rate></plugin>"))
    plugin, = model.plugins
    assert plugin.parameters == (("rate", "20"), ("name", "x"), ("flag", ""), ("list/item", "1"), ("list/item", "2"),
                                 ("rate", "30"))
    assert plugin.find("rate") == "20" and plugin.find("missing") is None
    assert plugin.where.startswith("r.urdf:3") and "libp.so" in plugin.where


def test_unknown_reference_is_reported_with_the_names_there_are():
    model = robot(link("a"), block("<mu1>1</mu1>", "wheel"))
    note, = model.notes
    assert '"wheel"' in note and "links: a" in note


@pytest.mark.parametrize("tag, instead", [("mu", "<mu1>"), ("plugin", "<sensor>"), ("friction", "<mu1>"),
                                          ("slip1", "<surface>"), ("whatever", "ignored.")])
def test_unsupported_tags_are_reported_with_an_alternative(tag, instead):
    model = robot(link("a"), block("<{0}>1</{0}>".format(tag), "a"), block("<{0}>1</{0}>".format(tag), "a"))
    note, = model.notes
    assert "<{}>".format(tag) in note and instead in note and "r.urdf:3" in note


@pytest.mark.parametrize("text, words", [
    ("<mu1>slippery</mu1>", "mu1"), ("<turnGravityOff>perhaps</turnGravityOff>", "true or false"),
    ("<fdir1>1 0</fdir1>", "3 numbers"), ("<maxContacts>2.5</maxContacts>", "whole"),
    ("<dampingFactor>much</dampingFactor>", "dampingFactor"), ("<sensor type='ray'/>", "attribute name")])
def test_invalid_values_are_reported_and_use_defaults(text, words):
    model, plain = robot(link("a", collision()), block(text, "a")), robot(link("a", collision()))
    note, = model.notes
    assert words in note and "r.urdf:3" in note and ("using" in note or "left out" in note)
    assert model.links == plain.links


@pytest.mark.parametrize("text", ["<static>perhaps</static>", "<plugin name='p'/>"])
def test_bad_values_of_the_model_are_reported(text):
    model = robot(link("a"), block(text))
    assert len(model.notes) == 1 and not model.static and model.plugins == ()

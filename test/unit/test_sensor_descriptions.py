# SPDX-License-Identifier: BSD-3-Clause
"""The stand-ins of sensors' descriptions: each macro expands, and the simulator reads it and serves its sensor."""
import math
import os
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import workspace_tree as tree
from m2wr_sim.api import Sim
from m2wr_sim.geometry import compose, rotate
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.model.urdf.xacro_text import expand_xacro
from m2wr_sim.plugins.registry import find_plugin

DROPIN = os.path.join(tree.ROOT, "dropin")
LASER, CLOUD = "libgazebo_ros_laser.so", "libgazebo_ros_velodyne_laser.so"
CAMERA, STEREO = "libgazebo_ros_camera.so", "libgazebo_ros_multicamera.so"
ORIGIN = '<origin xyz="0 0 0.1" rpy="0 0 0"/>'
MOUNTED = 'parent="base_link" name="s"'
FLEA3 = ('frame="f" name="left/eye" camera_x="0.07" camera_y="0.03" camera_z="0.03" camera_mass="0.1" hfov="1.0" '
         'fps="60" width="640" height="512"')
TIM = 'name="s" ros_topic="scan_a"'
BUMBLEBEES = ["BB2-%sS2C-%s" % (size, lens) for size in ("03", "08") for lens in ("25", "38", "60")]
LMS = "lms1xx/urdf/sick_lms1xx.urdf.xacro"
TIMS = "sick_tim/urdf/sick_tim.urdf.xacro"
STEREOS = "pointgrey_camera_description/urdf/pointgrey_bumblebee2.urdf.xacro"
REALSENSE = "realsense2_description/urdf/_%s.urdf.xacro"
#: File below dropin/, macro, attributes, root link that needs a joint, plugin, topic, links it must have.
MACROS = [
    (LMS, "sick_lms1xx", 'frame="f" topic="a/scan" robot_namespace="/"', "f", LASER, "a/scan", ("f",)),
    (LMS, "sick_lms1xx", "", "laser", LASER, "scan", ("laser",)),
    (TIMS, "sick_tim310", TIM, "s_mount_link", LASER, "scan_a", ("s", "s_mount_link")),
    (TIMS, "sick_tim551", TIM, "s_mount_link", LASER, "scan_a", ("s", "s_mount_link")),
    ("velodyne_description/urdf/VLP-16.urdf.xacro", "VLP-16", MOUNTED + ' topic="p"', "", CLOUD, "p",
     ("s", "s_base_link")),
    ("velodyne_description/urdf/VLP-16.urdf.xacro", "VLP-16", "", "", CLOUD, "/velodyne_points",
     ("velodyne", "velodyne_base_link")),
    ("velodyne_description/urdf/VLP-16.urdf.xacro", "VLP-16", MOUNTED + ' gpu="true"', "",
     "libgazebo_ros_velodyne_gpu_laser.so", "/velodyne_points", ("s",)),
    ("velodyne_description/urdf/HDL-32E.urdf.xacro", "HDL-32E", MOUNTED, "", CLOUD, "/velodyne_points", ("s",)),
    ("flir_camera_description/urdf/flir_blackflys.urdf.xacro", "flir_blackflys", 'frame="f" name="eye"', "f", CAMERA,
     "eye/image_raw", ("f", "f_lens", "f_optical")),
    ("pointgrey_camera_description/urdf/pointgrey_flea3.urdf.xacro", "pointgrey_flea3", FLEA3, "f", CAMERA,
     "left/eye/image_raw", ("f", "f_optical")),
    ("fath_pivot_mount_description/urdf/lockmount.urdf.xacro", "fath_pivot_mount",
     'parent_link="base_link" prefix="s" angle="0.3"', "", None, None, ("s_base_link", "s_hinge_link", "s_mount")),
]
MACROS += [(STEREOS, name, 'frame="f" name="eyes"', "f", STEREO, "eyes/image_raw", ("f", "f_optical"))
           for name in BUMBLEBEES]
MACROS += [(REALSENSE % name, "sensor_" + name, MOUNTED, "", None, None, ("s_bottom_screw_frame", "s_link"))
           for name in ("d415", "d435", "d435i", "d455")]


def expanded(path, macro, attributes, root=""):
    """URDF of a base with one call of a macro; ``root`` is joined to the base, else the macro has an origin."""
    joint = ('<joint name="j" type="fixed">%s<parent link="base_link"/><child link="%s"/></joint>' % (ORIGIN, root)
             if root else "")
    text = """<robot name="r" xmlns:xacro="http://www.ros.org/wiki/xacro">
      <xacro:include filename="%s"/><link name="base_link"><inertial><mass value="9"/>
      <inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <xacro:%s %s>%s</xacro:%s>%s</robot>""" % (os.path.join(DROPIN, path), macro, attributes,
                                                 "" if root else ORIGIN, macro, joint)
    return expand_xacro(text, "r.xacro", lambda name: os.path.join(DROPIN, name))


def link_names(urdf):
    return {link.get("name") for link in ElementTree.fromstring(urdf).iter("link")}


def sensors_of(model):
    return [(link, sensor) for link in model.links for sensor in link.sensors]


@pytest.mark.parametrize("path, macro, attributes, root, library, topic, links", MACROS,
                         ids=["%s-%d" % (case[1], place) for place, case in enumerate(MACROS)])
def test_a_macro_expands_and_its_sensor_is_served(path, macro, attributes, root, library, topic, links):
    urdf = expanded(path, macro, attributes, root)
    assert set(links) < link_names(urdf)
    model = load_urdf(urdf, "r.urdf")
    assert model.notes == ()
    plugins = [(sensor, plugin) for _, sensor in sensors_of(model) for plugin in sensor.plugins]
    assert [plugin.filename for _, plugin in plugins] == ([library] if library else [])
    for sensor, plugin in plugins:
        assert find_plugin(plugin.filename) is not None
        assert plugin.find("frameName") in link_names(urdf)
        named = plugin.find("topicName") or "%s/%s" % (plugin.find("cameraName"), plugin.find("imageTopicName"))
        assert named == topic and sensor.update_rate > 0.0


@pytest.mark.parametrize("path, macro, attributes", [
    ("flir_camera_description/urdf/flir_blackflys.urdf.xacro", "flir_blackflys", 'frame="f"'),
    ("pointgrey_camera_description/urdf/pointgrey_flea3.urdf.xacro", "pointgrey_flea3", FLEA3),
    (STEREOS, "BB2-03S2C-38", 'frame="f"')])
def test_a_camera_looks_along_the_z_axis_of_its_optical_frame(path, macro, attributes):
    urdf = expanded(path, macro, attributes, "f")
    joints = {joint.find("child").get("link"): joint for joint in ElementTree.fromstring(urdf).iter("joint")}
    roll, pitch, yaw = map(float, joints["f_optical"].find("origin").get("rpy").split())
    turn = (np.array([[math.cos(yaw), -math.sin(yaw), 0], [math.sin(yaw), math.cos(yaw), 0], [0, 0, 1]])
            @ np.array([[math.cos(pitch), 0, math.sin(pitch)], [0, 1, 0], [-math.sin(pitch), 0, math.cos(pitch)]])
            @ np.array([[1, 0, 0], [0, math.cos(roll), -math.sin(roll)], [0, math.sin(roll), math.cos(roll)]]))
    (link, sensor), = sensors_of(load_urdf(urdf, "r.urdf"))
    for camera in sensor.cameras:
        _, seen = compose(compose(link.pose, sensor.pose), camera.pose)
        assert rotate(seen, (1.0, 0.0, 0.0)) == pytest.approx(turn @ (0.0, 0.0, 1.0), abs=1e-6)


def test_the_right_camera_of_a_stereo_pair_is_to_the_right():
    (_, sensor), = sensors_of(load_urdf(expanded(STEREOS, "BB2-08S2C-38", "", "bumblebee"), "r.urdf"))
    left, right = sensor.cameras
    assert (left.name, right.name) == ("left", "right") and (left.width, left.height) == (1024, 768)
    assert right.pose[0][1] - left.pose[0][1] == pytest.approx(-0.12)


def test_the_layers_of_a_velodyne_are_those_of_its_data_sheet():
    for model, low, high, layers in (("VLP-16", -15.0, 15.0, 16), ("HDL-32E", -30.67, 10.67, 32)):
        urdf = expanded("velodyne_description/urdf/%s.urdf.xacro" % model, model, MOUNTED + ' samples="360"')
        (_, sensor), = sensors_of(load_urdf(urdf, "r.urdf"))
        ray = sensor.ray
        assert (ray.samples, ray.vertical_samples) == (360, layers)
        assert np.degrees((ray.vertical_min_angle, ray.vertical_max_angle)) == pytest.approx((low, high))


def test_a_pivot_mount_is_tilted_by_its_angle_about_the_hinge():
    urdf = expanded("fath_pivot_mount_description/urdf/lockmount.urdf.xacro", "fath_pivot_mount",
                    'parent_link="base_link" prefix="s" angle="0.3"')
    joints = {joint.find("child").get("link"): joint for joint in ElementTree.fromstring(urdf).iter("joint")}
    assert [joints["s_hinge_link"].find("origin").get("rpy").split()[place] for place in (0, 1, 2)] == ["0", "0.3", "0"]
    assert joints["s_mount"].find("parent").get("link") == "s_hinge_link"


@pytest.mark.parametrize("name, parts", [
    ("d415", ("depth", "infra1", "infra2", "color")), ("d435", ("depth", "infra1", "infra2", "color")),
    ("d435i", ("depth", "infra1", "infra2", "color", "accel", "gyro")),
    ("d455", ("depth", "infra1", "infra2", "color", "accel", "gyro"))])
def test_a_realsense_has_nominal_frames_when_asked_for(name, parts):
    wanted = {"s_%s%s_frame" % (part, kind) for part in parts for kind in ("", "_optical")}
    with_them = expanded(REALSENSE % name, "sensor_" + name, MOUNTED + ' use_nominal_extrinsics="true"')
    assert wanted <= link_names(with_them)
    assert not wanted & link_names(expanded(REALSENSE % name, "sensor_" + name, MOUNTED))
    assert load_urdf(with_them, "r.urdf").notes == ()


@pytest.mark.parametrize("path, macro, attributes, root, height", [
    (LMS, "sick_lms1xx", "", "laser", 0.1), (TIMS, "sick_tim310", TIM, "s_mount_link", 0.15595),
    (TIMS, "sick_tim551", TIM, "s_mount_link", 0.16296)])
def test_a_laser_looks_forward_from_its_frame(path, macro, attributes, root, height):
    model = load_urdf(expanded(path, macro, attributes, root), "r.urdf")
    turn = (0.0, math.sin(0.25), 0.0, math.cos(0.25))           # 0.5 rad downwards
    with Sim("empty", model, ((0.0, 0.0, 0.5), turn), sensing="now") as sim:
        laser, = sim.lasers()
        middle = laser.scan.ranges[np.argmin(np.abs(laser.angles))]
    assert middle == pytest.approx((0.5 + height * math.cos(0.5)) / math.sin(0.5), abs=0.03)


@pytest.mark.parametrize("path, macro, attributes, size, height", [
    ("flir_camera_description/urdf/flir_blackflys.urdf.xacro", "flir_blackflys", 'frame="f"', (540, 720), 0.11425),
    ("pointgrey_camera_description/urdf/pointgrey_flea3.urdf.xacro", "pointgrey_flea3", FLEA3, (512, 640), 0.1)])
def test_a_camera_sees_the_floor_from_the_height_of_its_lens(path, macro, attributes, size, height):
    model = load_urdf(expanded(path, macro, attributes, "f"), "r.urdf")
    with Sim("empty", model, (0.0, 0.0, 0.5, 0.0)) as sim:
        picture = sim.picture()
    assert picture.colour.shape == size + (3,)
    assert np.all(np.isinf(picture.depth[: size[0] // 2]))
    below_axis = (size[0] - 1) / 2.0                        # px, of the lowest row
    assert picture.depth[-1] == pytest.approx((0.5 + height) * picture.focal / below_axis, rel=1e-3)

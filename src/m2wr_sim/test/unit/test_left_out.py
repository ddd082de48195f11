# SPDX-License-Identifier: BSD-3-Clause
"""What is said of plugins that are not here: reason, topics, consequence, what to do; once for a description."""
import logging
import re

import pytest

from conftest import at, box
from m2wr_sim.model.types import PluginSpec, World
from m2wr_sim.plugins.left_out import LEFT_OUT, NOT_NEEDED, explain
from m2wr_sim.plugins.registry import PLUGINS, library_name

#: Plugins that the reference of Gazebo's plugins names, by the part of the name that is always the same.
FAMILIES = ("block_laser", "velodyne_laser", "velodyne_gpu", "hector_gazebo_ros_imu", "hector_gazebo_ros_gps",
            "hector_gazebo_ros_sonar", "hector_gazebo_ros_magnetic", "kobuki", "tricycle", "mimic_joint", "ros_control",
            "ros_camera", "depth_camera", "openni_kinect", "multicamera", "triggered_camera", "prosilica", "realsense",
            "force_based_move", "contact", "vacuum_gripper", "grasp_fix", "wheel_slip", "harness", "video", "actor",
            "elevator", "hand_of_god", "joint_pose_trajectory", "f3d", "projector")


def spec(library, *parameters, name="p"):
    where = 'robot.urdf:7: plugin "p" (%s)' % library
    return PluginSpec(name=name, filename=library, parameters=parameters, where=where)


@pytest.mark.parametrize("library", sorted(LEFT_OUT))
def test_every_known_plugin_is_explained(library):
    text, missing = explain(spec(library), "rover")
    assert missing and text.startswith("rover: no plugin %s here; robot.urdf:7: plugin" % library)
    assert "is left out. It %s" % LEFT_OUT[library].does.split("{")[0] in text and LEFT_OUT[library].follows in text
    assert "{" not in text and "None" not in text and "//" not in text and not re.search(r"  |\.\.|: \.", text)


@pytest.mark.parametrize("family", FAMILIES)
def test_the_reference_plugins_are_known(family):
    assert any(family in library for library in LEFT_OUT)


def test_no_plugin_is_in_two_tables_and_all_names_are_full():
    assert not set(LEFT_OUT) & set(PLUGINS) and not set(NOT_NEEDED) & (set(PLUGINS) | set(LEFT_OUT))
    assert all(library_name(library) == library for library in list(LEFT_OUT) + list(NOT_NEEDED))


@pytest.mark.parametrize("library", sorted(library for library in LEFT_OUT if LEFT_OUT[library].instead))
def test_what_is_offered_instead_is_here(library):
    for offered in re.findall(r"lib\w+\.so", LEFT_OUT[library].instead):
        assert offered in PLUGINS


@pytest.mark.parametrize("library, parameters, namespace, words", [
    ("libgazebo_ros_tricycle_drive.so", (), None,
     ("It drives this robot: it will not move.", "published /rover/odom.", "read /rover/cmd_vel.")),
    ("gazebo_ros_tricycle_drive", (("commandTopic", "drive"), ("robotNamespace", "a")), "b",
     ("no plugin libgazebo_ros_tricycle_drive.so here", "published /a/odom.", "read /a/drive.")),
    ("libgazebo_ros_kobuki.so", (), "b", ("read /b/mobile_base/commands/velocity.",)),
    ("libgazebo_ros_block_laser.so", (("topicName", "blocks"),), "/", ("no cloud", "published /blocks.")),
    ("libgazebo_ros_camera.so", (("cameraName", "front"), ("imageTopicName", "raw")), None,
     ("no pictures", "published /front/raw and /front/camera_info.", "renderer")),
    ("libgazebo_ros_openni_kinect.so", (), "r", ("published /r/ir/image_raw and /r/depth/image_raw and /r/points.",)),
    ("libroboticsgroup_gazebo_mimic_joint_plugin.so", (("joint", "left"), ("mimicJoint", "right")), None,
     ("It lets joint right follow joint left: it swings freely.",)),
    ("libgazebo_ros_vacuum_gripper.so", (), None, ("nothing is drawn.",)),
])
def test_topics_come_from_the_tags_and_the_namespace(library, parameters, namespace, words):
    text, _ = explain(spec(library, *parameters), "rover", namespace)
    for word in words:
        assert word in text


def test_of_an_unknown_plugin_the_topics_of_its_tags_are_named():
    tags = (("cmdTopic", "go"), ("odom_topic_name", "/where"), ("rate", "5"), ("ros/topicName", "deep"), ("topic", ""))
    text, missing = explain(spec("libsomething_own.so", *tags), "rover")
    assert missing and "What it does is missing." in text
    assert text.endswith("what its tags name: go (<cmdTopic>), /where (<odom_topic_name>), deep (<ros/topicName>).")
    assert explain(spec("libsomething_own.so"), "rover")[0].endswith("What it does is missing.")


def test_a_sentence_stays_short_whatever_the_tags_hold():
    tags = [("a%dTopic" % index, "x" * 100000) for index in range(1000)]
    assert len(explain(spec("libsomething_own.so", *tags), "rover")[0]) < 3000
    assert len(explain(spec("libgazebo_ros_camera.so", ("cameraName", "x" * 100000)), "rover")[0]) < 3000


def told(caplog, words):
    return [(record.levelno, record.getMessage()) for record in caplog.records if words in record.getMessage()]


def test_it_is_said_once_for_all_models_of_a_description(make_rig, caplog):
    rig = make_rig()
    from dataclasses import replace
    model = replace(box("crate", 0.0, 0.0, 0.5, (1.0, 1.0, 1.0)), plugins=(spec("libgazebo_ros_tricycle_drive.so"),))
    for index in range(3):
        rig.simulator.spawn(model, at(3.0 * index), "robot%d" % index)
    (level, text), = told(caplog, "tricycle")
    assert level == logging.WARNING and text.startswith("robot0: ")
    other = replace(model, plugins=(spec("libgazebo_ros_tricycle_drive.so", ("commandTopic", "go")),))
    rig.simulator.spawn(other, at(9.0), "robot9")
    assert len(told(caplog, "tricycle")) == 2


def test_plugins_of_a_world_are_explained_too_and_what_is_not_needed_is_no_warning(make_rig, caplog):
    caplog.set_level(logging.INFO)
    plugins = (spec("libgazebo_ros_api_plugin.so"), spec("libWindPlugin.so"))
    make_rig().simulator.load_world(World(name="w", plugins=plugins))
    (quiet, _), = told(caplog, "none is needed: this simulation has Gazebo's services")
    (loud, text), = told(caplog, "libWindPlugin.so")
    assert (quiet, loud) == (logging.INFO, logging.WARNING) and text.startswith("the world: ") and "no wind" in text

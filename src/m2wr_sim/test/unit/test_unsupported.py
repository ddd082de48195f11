# SPDX-License-Identifier: BSD-3-Clause
"""Messages about unsupported plugins: reason, topics, consequence, alternative; once for a description."""
import logging
import re

import pytest

from conftest import at, box
from m2wr_sim.model.types import PluginSpec, World
from m2wr_sim.plugins.registry import PLUGINS, library_name
from m2wr_sim.plugins.unsupported import NOT_NEEDED, UNSUPPORTED, explain

#: Plugins that the reference of Gazebo's plugins names, by the part of the name that is always the same.
FAMILIES = ("ackermann_drive", "prosilica", "realsense", "force_based_move",
            "contact", "vacuum_gripper", "grasp_fix", "video", "actor", "elevator",
            "hand_of_god", "joint_pose_trajectory", "f3d", "projector")


def spec(library, *parameters, name="p"):
    where = 'robot.urdf:7: plugin "p" (%s)' % library
    return PluginSpec(name=name, filename=library, parameters=parameters, where=where)


@pytest.mark.parametrize("library", sorted(UNSUPPORTED))
def test_message_names_plugin_function_and_consequence(library):
    text, missing = explain(spec(library), "rover")
    assert missing and text.startswith("rover: plugin %s is not supported; robot.urdf:7: plugin" % library)
    entry = UNSUPPORTED[library]
    assert "is ignored. It %s" % entry.does.split("{")[0] in text and entry.follows in text
    assert "{" not in text and "None" not in text and "//" not in text and not re.search(r"  |\.\.|: \.", text)


@pytest.mark.parametrize("family", FAMILIES)
def test_plugins_of_the_reference_are_known(family):
    assert any(family in library for library in UNSUPPORTED)


def test_each_plugin_is_in_one_table_with_its_full_name():
    assert not set(UNSUPPORTED) & set(PLUGINS) and not set(NOT_NEEDED) & (set(PLUGINS) | set(UNSUPPORTED))
    assert all(library_name(library) == library for library in list(UNSUPPORTED) + list(NOT_NEEDED))


@pytest.mark.parametrize("library", sorted(library for library in UNSUPPORTED if UNSUPPORTED[library].instead))
def test_alternatives_are_supported(library):
    for offered in re.findall(r"lib\w+\.so", UNSUPPORTED[library].instead):
        assert offered in PLUGINS


@pytest.mark.parametrize("library, parameters, namespace, words", [
    ("libgazebo_ros_ackermann_drive.so", (), None,
     ("It drives this robot; without it: it will not move.", "Not published: /odom.",
      "Not subscribed: /cmd_vel.")),
    ("gazebo_ros_ackermann_drive", (("commandTopic", "drive"), ("robotNamespace", "a")), "b",
     ("plugin libgazebo_ros_ackermann_drive.so is not supported", "Not published: /a/odom.",
      "Not subscribed: /a/drive.")),
    ("libgazebo_ros_ouster_laser.so", (("topicName", "blocks"),), "/", ("no point cloud", "Not published: /blocks.")),
    ("libgazebo_ros_prosilica.so", (("cameraName", "front"), ("imageTopicName", "raw")), None,
     ("no images", "Not published: /front/raw, /front/camera_info.", "libgazebo_ros_camera.so")),
    ("libroboticsgroup_gazebo_disable_link_plugin.so", (("link", "finger"),), None,
     ("It disables link finger; without it: it stays enabled.",)),
    ("libgazebo_ros_vacuum_gripper.so", (), None, ("no suction.",)),
])
def test_topics_follow_tags_and_namespace(library, parameters, namespace, words):
    text, _ = explain(spec(library, *parameters), "rover", namespace)
    for word in words:
        assert word in text


def test_unknown_plugin_lists_topics_of_its_tags():
    tags = (("cmdTopic", "go"), ("odom_topic_name", "/where"), ("rate", "5"), ("ros/topicName", "deep"), ("topic", ""))
    text, missing = explain(spec("libsomething_own.so", *tags), "rover")
    assert missing and "Its function is missing." in text
    assert text.endswith("The topics of its tags do not exist: go (<cmdTopic>), /where (<odom_topic_name>), "
                         "deep (<ros/topicName>).")
    assert explain(spec("libsomething_own.so"), "rover")[0].endswith("Its function is missing.")


def test_message_length_is_bounded():
    tags = [("a%dTopic" % index, "x" * 100000) for index in range(1000)]
    assert len(explain(spec("libsomething_own.so", *tags), "rover")[0]) < 3000
    assert len(explain(spec("libgazebo_ros_prosilica.so", ("cameraName", "x" * 100000)), "rover")[0]) < 3000


def logged(caplog, words):
    return [(record.levelno, record.getMessage()) for record in caplog.records if words in record.getMessage()]


def test_message_is_logged_once_per_description(make_rig, caplog):
    rig = make_rig()
    from dataclasses import replace
    model = replace(box("crate", 0.0, 0.0, 0.5, (1.0, 1.0, 1.0)), plugins=(spec("libgazebo_ros_ackermann_drive.so"),))
    for index in range(3):
        rig.simulator.spawn(model, at(3.0 * index), "robot%d" % index)
    (level, text), = logged(caplog, "ackermann")
    assert level == logging.WARNING and text.startswith("robot0: ")
    other = replace(model, plugins=(spec("libgazebo_ros_ackermann_drive.so", ("commandTopic", "go")),))
    rig.simulator.spawn(other, at(9.0), "robot9")
    assert len(logged(caplog, "ackermann")) == 2


def test_world_plugins_are_reported_by_level(make_rig, caplog):
    caplog.set_level(logging.INFO)
    plugins = (spec("libgazebo_ros_api_plugin.so"), spec("libWindPlugin.so"))
    make_rig().simulator.load_world(World(name="w", plugins=plugins))
    (quiet, _), = logged(caplog, "is not needed: Gazebo's services")
    (loud, text), = logged(caplog, "libWindPlugin.so")
    assert (quiet, loud) == (logging.INFO, logging.WARNING) and text.startswith("the world: ") and "no wind" in text

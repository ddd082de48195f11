# SPDX-License-Identifier: BSD-3-Clause
"""What every registered plugin must do: start, keep its rate, reset, close, and report unsupported elements."""
import logging
import re
from dataclasses import replace
from pathlib import Path

import pytest

from conftest import at
from m2wr_sim.model.types import CameraView, PluginSpec
from m2wr_sim.plugins.base import Plugin, PluginReader
from m2wr_sim.plugins.registry import PLUGINS, find_plugin
from m2wr_sim.runtime import plugin_host

RATE = 20.0
HERE = ("updateRate", str(RATE))
WHEELS = (("leftFrontJoint", "joint_left_wheel"), ("leftRearJoint", "joint_left_wheel"),
          ("rightFrontJoint", "joint_right_wheel"), ("rightRearJoint", "joint_right_wheel"))
BODY = (("bodyName", "link_chassis"), ("topicName", "/out"), HERE)
# tags that a plugin needs on m2wr to start, its topic, and the type of its sensor
SUITABLE = {
    "libgazebo_ros_diff_drive.so": (
        (("leftJoint", "joint_left_wheel"), ("rightJoint", "joint_right_wheel"), HERE), "/odom", None),
    "libgazebo_ros_laser.so": ((("topicName", "/scan"),), "/scan", "ray"),
    "libgazebo_ros_gpu_laser.so": ((("topicName", "/scan"),), "/scan", "ray"),
    "libgazebo_ros_joint_state_publisher.so": ((("jointName", "joint_left_wheel"), HERE), "/joint_states", None),
    "libgazebo_ros_skid_steer_drive.so": (WHEELS + (HERE,), "/odom", None),
    "libgazebo_ros_planar_move.so": ((("odometryRate", str(RATE)),), "/odom", None),
    "libgazebo_ros_p3d.so": (BODY, "/out", None),
    "libgazebo_ros_imu.so": (BODY, "/out", None),
    "libgazebo_ros_imu_sensor.so": ((("frameName", "imu"), ("updateRateHZ", str(RATE))), "/imu_data", "imu"),
    "libgazebo_ros_range.so": ((("topicName", "/range"),), "/range", "ray"),
    "libgazebo_ros_bumper.so": ((), "/bumper_states", "contact"),
    "libgazebo_ros_camera.so": ((("cameraName", "cam"),), "/cam/image_raw", "camera"),
    "libgazebo_ros_triggered_camera.so": ((("cameraName", "cam"),), "/cam/image_raw", "camera"),
    "libgazebo_ros_depth_camera.so": ((("cameraName", "cam"),), "/cam/depth/image_raw", "depth"),
    "libgazebo_ros_openni_kinect.so": ((("cameraName", "cam"),), "/cam/points", "depth"),
    "libgazebo_ros_multicamera.so": ((("cameraName", "cam"),), "/cam/left/image_raw", "multicamera"),
    "libgazebo_ros_velodyne_laser.so": ((("topicName", "/points"),), "/points", "ray"),
    "libgazebo_ros_velodyne_gpu_laser.so": ((("topicName", "/points"),), "/points", "ray"),
    "libgazebo_ros_block_laser.so": ((("topicName", "/blocks"),), "/blocks", "ray"),
    "libhector_gazebo_ros_imu.so": (BODY, "/out", None),
    "libhector_gazebo_ros_gps.so": (BODY, "/out", None),
    "libhector_gazebo_ros_magnetic.so": (BODY, "/out", None),
    "libhector_gazebo_ros_sonar.so": ((("topicName", "/sonar"), HERE), "/sonar", "ray"),
    "libgazebo_ros_ft_sensor.so": ((("jointName", "joint_left_wheel"), ("topicName", "/out"), HERE), "/out", None),
}
SILENT = {"libgazebo_ros_force.so", "libm2wr_way_points.so", "libTrajectoryActorPlugin.so",
          "libm2wr_actor_script.so", "libgazebo_ros_control.so", "libm2wr_mimic.so", "libmimic_joint_plugin.so",
          "libroboticsgroup_gazebo_mimic_joint_plugin.so", "libroboticsgroup_upatras_gazebo_mimic_joint_plugin.so",
          "libgazebo_mimic_joint_plugin.so", "libm2wr_gear.so", "libm2wr_screw.so",
          "libgazebo_ros_wheel_slip.so", "libWheelSlipPlugin.so", "libgazebo_ros_harness.so", "libHarnessPlugin.so",
          "libgazebo_ros_kobuki.so", "libgazebo_ros_tricycle_drive.so"}
# publish nothing, or only what controllers do, or need a robot of their own, see the tests named after them
TRIGGERED = {"libgazebo_ros_triggered_camera.so"}       # publish when they are asked to
VIEWS = {"camera": (CameraView("left", width=16, height=12),), "depth": (CameraView("c", width=16, height=12),),
         "multicamera": (CameraView("left", width=16, height=12), CameraView("right", width=16, height=12))}
PERIODS_MS = {"libgazebo_ros_planar_move.so": 51.0}     # more than a period since it last did: 50 + 1, again and again
ALL = sorted(set(PLUGINS) - SILENT - TRIGGERED)


def robot_with(robot, library, extra=()):
    """Return m2wr with one plugin only."""
    parameters, _, kind = SUITABLE[library]
    spec = PluginSpec("the plugin", library, parameters + extra, where="here")
    chassis = robot.links[0]
    sensor = replace(chassis.sensors[0], kind=kind or "ray", cameras=VIEWS.get(kind, ()),
                     plugins=(spec,) if kind else (),
                     contact_collisions=(chassis.collisions[0].name,) if kind == "contact" else ())
    return replace(robot, plugins=() if kind else (spec,),
                   links=(replace(chassis, sensors=(sensor,)),) + robot.links[1:])


@pytest.fixture(params=ALL)
def library(request):
    return request.param


@pytest.fixture
def make(make_rig, m2wr):
    def make_with(library, extra=()):
        rig = make_rig(joint_states=False)
        rig.simulator.spawn(robot_with(m2wr, library, extra), at(z=0.1), namespace="/")
        return rig, SUITABLE[library][1]
    return make_with


def test_every_plugin_is_tested():
    assert set(SUITABLE) | SILENT == set(PLUGINS)


def test_registry_accepts_all_forms_of_a_name(library):
    found = find_plugin(library)
    assert issubclass(found, Plugin)
    bare = library[len("lib"):-len(".so")]
    for name in (bare, "lib" + bare, bare + ".so", "/opt/ros/noetic/lib/" + library, "  %s\n" % library):
        assert find_plugin(name) is found


@pytest.mark.parametrize("name", ["", "libgazebo_ros_unknown.so", ".so", "diff_drive"])
def test_registry_rejects_other_names(name):
    assert find_plugin(name) is None


def test_reference_lists_tags_and_defaults(make, library, monkeypatch):
    readers = []
    monkeypatch.setattr(plugin_host, "PluginReader", lambda spec: readers.append(PluginReader(spec)) or readers[-1])
    make(library)
    page = (Path(__file__).resolve().parents[4] / "docs" / "reference" / "plugins.md").read_text(encoding="utf-8")
    row, = [line.split(" | ")[1] for line in page.splitlines()
            if line.startswith("| `lib") and "`%s`" % library in line.split(" | ")[0]]
    told = dict(re.findall(r"`(\w+)`(?: = ([^,;|]+))?", row.split(", and ")[0]))
    assert set(told) == readers[0].known() - {"robotNamespace", "alwaysOn", "rosDebugLevel"}
    for tag, default in readers[0].defaults:
        assert told[tag] in ("%g" % default if isinstance(default, float) else default, "the body"), tag


def test_plugin_starts_and_keeps_its_rate(make, library, caplog):
    rig, topic = make(library)
    stamps = rig.run(3.0).stamps_ms(topic)
    assert len(rig.simulator.models["m2wr"].plugins) == 1
    period = PERIODS_MS.get(library, 50.0)
    assert 0 <= 3000.0 / period - len(stamps) <= 1 and {b - a for a, b in zip(stamps, stamps[1:])} == {period}
    assert not [record for record in caplog.records if record.levelname in ("ERROR", "CRITICAL")]


def test_stamps_increase_and_are_not_in_the_future(make, library):
    rig, topic = make(library)
    for _ in range(200):
        rig.run(0.001)
        stamps = [message.header.stamp for message in rig.messages(topic)]
        assert len(set(stamps)) == len(stamps) and all(stamp <= rig.simulator.now_ns for stamp in stamps)


def test_plugin_publishes_after_each_reset(make, library):
    rig, topic = make(library)
    rig.run(1.0)
    for reset, since in ((rig.simulator.reset_world, 1000), (rig.simulator.reset_simulation, 0)):
        before = len(rig.messages(topic))
        reset()
        rig.run(1.0)
        stamps = rig.stamps_ms(topic)[before:]
        assert len(stamps) in (19, 20) and all(since < stamp <= since + 1000 for stamp in stamps)


def test_deleting_the_model_releases_resources(make, library, m2wr):
    rig, topic = make(library)
    rig.run(0.2)
    old = rig.ports.topics[topic]
    rig.simulator.delete("m2wr")
    count = len(old.messages)
    rig.run(0.2)
    assert not old.listening and len(old.messages) == count
    assert not any(subscription.open for subscription in rig.ports.subscriptions.values())
    rig.simulator.spawn(robot_with(m2wr, library), at(z=0.1), namespace="/")
    rig.run(0.2)
    assert rig.ports.topics[topic] is not old and len(rig.messages(topic)) in (3, 4)


def test_unsupported_tags_are_logged(make, library, caplog):
    caplog.set_level(logging.INFO)
    make(library, (("colour", "red"), ("alwaysOn", "true"), ("colour", "blue")))
    messages = [record.getMessage() for record in caplog.records]
    sentence, = [message for message in messages if "unsupported elements ignored" in message]
    assert sentence.count("<colour>") == 1 and "alwaysOn" not in sentence and library in sentence


def test_output_does_not_depend_on_batches(make, library):
    results = []
    for chunk_ns in (10 ** 6, 7 * 10 ** 6, 10 ** 15):
        rig, topic = make(library)
        rig.run(1.0, chunk_ns)
        results.append([str(message) for message in rig.messages(topic)])
    assert results[0] == results[1] == results[2] and len(results[0]) > 15


# -- reading tags -------------------------------------------------------------------------------------------------

def reader(**tags):
    return PluginReader(PluginSpec("p", "p.so", tuple(tags.items()), where="a.urdf:3: plugin \"p\""))


def test_text_number_flag_and_choice():
    tags = reader(text="abc", number=" 2.5 ", yes="TRUE", no="0", odd="maybe", choice="b", other="z")
    assert tags.text("text") == "abc" and tags.number("number") == 2.5
    assert tags.flag("yes", False) is True and tags.flag("no", True) is False and tags.flag("odd", True) is True
    assert tags.choice("choice", ("a", "b"), "a") == "b" and tags.choice("other", ("a", "b"), "a") == "a"
    assert tags.unread() == [] and tags.defaults == []


def test_defaults_are_recorded():
    tags = reader(empty="")
    assert tags.number("rate", 5.0) == 5.0 and tags.text("empty", "x") == "x" and tags.flag("on", True) is True
    assert tags.defaults == [("rate", 5.0), ("empty", "x"), ("on", "true")]


@pytest.mark.parametrize("text, words", [("abc", "holds \"abc\""), ("nan", "holds \"nan\""), ("inf", "finite"),
                                         ("-2", "at least 0")])
def test_invalid_numbers_are_rejected(text, words):
    from m2wr_sim.errors import PluginError
    with pytest.raises(PluginError) as caught:
        reader(rate=text).number("rate", 1.0, minimum=0.0)
    assert words in str(caught.value) and "a.urdf:3" in str(caught.value) and "<rate>" in str(caught.value)


def test_missing_required_tag_is_rejected():
    from m2wr_sim.errors import PluginError
    with pytest.raises(PluginError) as caught:
        reader().text("jointName")
    assert str(caught.value) == "a.urdf:3: plugin \"p\": needs a <jointName> element"

# SPDX-License-Identifier: BSD-3-Clause
"""The laser plugin in a simulation: when it measures, and content, frame and topic of its messages."""
import copy
import math
from dataclasses import replace

import numpy as np
import pytest
from sensor_msgs.msg import LaserScan

from conftest import at
from m2wr_sim.model.types import Noise, PluginSpec
from m2wr_sim.ros.convert import stamp_of
from m2wr_sim.ros.serialise import serialiser_of
from m2wr_sim.sensors.laser import LaserSensor

SCAN = "/m2wr/laser/scan"
LASER_X = 0.15                      # where the laser stands on the chassis [m]


def with_laser(robot, tags=None, sensor=None, ray=None):
    """Return the robot with tags of its laser plugin set (None: taken out), and values of its sensor changed."""
    chassis = robot.links[0]
    old, = chassis.sensors
    spec, = old.plugins
    kept = tuple(pair for pair in spec.parameters if pair[0] not in (tags or {}))
    spec = replace(spec, parameters=kept + tuple((tag, text) for tag, text in (tags or {}).items() if text is not None))
    changed = replace(old, plugins=(spec,), ray=replace(old.ray, **(ray or {})), **(sensor or {}))
    return replace(robot, links=(replace(chassis, sensors=(changed,)),) + robot.links[1:])


@pytest.fixture
def make(m2wr_rig, m2wr, build):
    """Return a function that makes a rig: m2wr, and a wall whose face is 3 m ahead of the origin."""
    def make_with(tags=None, sensor=None, ray=None, **options):
        wall = build.box("wall", 3.1, 0.0, 0.5, size=(0.2, 12.0, 1.0))
        return m2wr_rig(wall, robot=with_laser(m2wr, tags, sensor, ray), **options)
    return make_with


QUIET = {"noise": Noise()}


# -- when ---------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("step_ms, times", [(1, [1, 51, 101, 151]), (5, [5, 55, 105, 155]), (10, [10, 60, 110, 160])])
def test_twenty_scans_a_second(make, step_ms, times):
    assert make(step_ms=step_ms).run(0.2).stamps_ms(SCAN) == times


def test_thirty_hertz_at_five_milliseconds_keep_the_rate(make):
    stamps = make(sensor={"update_rate": 30.0}, step_ms=5).run(5.0).stamps_ms(SCAN)
    assert len(stamps) == 150 and {b - a for a, b in zip(stamps, stamps[1:])} == {30, 35}


def test_without_rate_measures_in_every_step(make):
    assert make(sensor={"update_rate": 0.0}).run(0.004).stamps_ms(SCAN) == [1, 2, 3, 4]


def test_no_rays_without_subscribers(make, monkeypatch):
    casts, cast = [], LaserSensor.cast
    monkeypatch.setattr(LaserSensor, "cast", lambda *arguments: casts.append(1) or cast(*arguments))
    rig = make()
    port = rig.ports.topics[SCAN]
    port.listening = False
    rig.run(0.313)
    assert casts == [] and port.messages == []
    port.listening = True
    rig.run(0.1)                                # the first scan comes with the next step, not a period later
    assert rig.stamps_ms(SCAN) == [314, 364] and len(casts) == 2
    port.listening = False
    rig.run(0.2)
    port.listening = True
    rig.run(0.06)
    assert rig.stamps_ms(SCAN)[2:] == [614, 664] and len(casts) == 4


def test_always_on_does_not_cast_without_subscribers(make):
    rig = make(sensor={"always_on": True})
    rig.ports.topics[SCAN].listening = False
    assert rig.run(0.2).messages(SCAN) == []


# -- what ---------------------------------------------------------------------------------------------------------

def test_fields_are_those_of_gazebo(make):
    message = make().run(0.01).messages(SCAN)[0]
    assert message.header.frame_id == "sensor_laser"
    assert (message.angle_min, message.angle_max) == (-1.570796, 1.570796)
    assert message.angle_increment == pytest.approx(3.141592 / 719)
    assert (message.range_min, message.range_max) == (0.1, 10.0)
    assert (message.scan_time, message.time_increment) == (0.0, 0.0)
    assert len(message.ranges) == len(message.intensities) == 720 and set(message.intensities) == {0.0}


@pytest.mark.parametrize("most, told", [(1e300, math.inf), (1.7e308, math.inf), (30.0, 30.0)])
def test_range_limit_above_float32_is_infinite(make, caplog, most, told):
    rig = make(ray={"range_max": most}).run(0.2)
    message = copy.deepcopy(rig.messages(SCAN)[-1])
    message.header.stamp = stamp_of(message.header.stamp)
    sent = LaserScan().deserialize(serialiser_of(LaserScan)(1, message)[4:])
    assert len(rig.messages(SCAN)) == 4 and sent.range_max == told and sent.range_min == np.float32(0.1)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_wall_is_measured_at_its_distance(make):
    message = make(ray=QUIET).run(0.5).messages(SCAN)[-1]
    angles = message.angle_min + message.angle_increment * np.arange(720)
    expected = (3.0 - LASER_X) / np.cos(angles)
    seen = (np.abs(expected * np.sin(angles)) < 6.0) & (expected < 10.0)
    assert np.asarray(message.ranges)[seen] == pytest.approx(expected[seen], abs=1e-4)
    assert np.isinf(np.asarray(message.ranges)[~seen]).all() and seen.sum() > 400


def test_beams_run_from_the_right_to_the_left(make_rig, m2wr, build):
    rig = make_rig(build.box("left", 1.5, 1.5, 0.5, size=(0.5, 0.5, 1.0)))
    rig.simulator.spawn(with_laser(m2wr), at(z=0.1), namespace="/")
    ranges = rig.run(0.01).messages(SCAN)[0].ranges
    hit = [index for index, value in enumerate(ranges) if not math.isinf(value)]
    assert 360 < min(hit) and max(hit) < 719


def test_moved_obstacle_is_measured_at_its_new_pose(make):
    rig = make(ray=QUIET, wheel_convention="kinetic").run(0.5).send(0.5, 0.0).run(2.0)
    message, x = rig.messages(SCAN)[-1], rig.pose()[0][0]
    age = (rig.simulator.now_ns - message.header.stamp) * 1e-9
    assert message.ranges[360] == pytest.approx(3.0 - LASER_X - (x - 0.5 * age), abs=2e-3)
    rig.simulator.set_model_state("wall", at(5.1, 0.0, 0.5), (0, 0, 0), (0, 0, 0))
    rig.run(0.05)
    assert rig.messages(SCAN)[-1].ranges[360] == pytest.approx(message.ranges[360] + 2.0, abs=0.06)


def test_movable_models_and_other_robots_are_measured(make, m2wr, build):
    rig = make(ray=QUIET)
    rig.simulator.spawn(build.box("crate", 1.5, 0.0, 0.3, static=False), at(1.5, 0.0, 0.25))
    assert rig.run(0.2).messages(SCAN)[-1].ranges[360] == pytest.approx(1.25 - LASER_X, abs=2e-3)
    rig.simulator.delete("crate")
    assert rig.run(0.05).messages(SCAN)[-1].ranges[360] == pytest.approx(3.0 - LASER_X, abs=2e-3)
    silent = replace(m2wr, links=(replace(m2wr.links[0], sensors=()),) + m2wr.links[1:])
    rig.simulator.spawn(silent, at(1.5, 0.0, 0.1, math.pi), "other")    # its laser's housing faces us
    assert rig.run(0.1).messages(SCAN)[-1].ranges[360] == pytest.approx(1.5 - 2 * LASER_X - 0.05, abs=5e-3)


def test_level_laser_does_not_hit_its_own_robot(m2wr_rig):
    assert all(math.isinf(value) for value in m2wr_rig().run(1.0).messages(SCAN)[-1].ranges)


# -- noise --------------------------------------------------------------------------------------------------------

def ranges_of(rig):
    return [tuple(message.ranges) for message in rig.run(0.5).messages(SCAN)]


def test_noise_depends_on_model_and_seed(make):
    first, again, other = (ranges_of(make(seed=seed)) for seed in (5, 5, 6))
    assert first == again and first != other
    errors = np.array([scan[300:420] for scan in first[2:]]) - np.array(ranges_of(make(ray=QUIET))[-1][300:420])
    assert errors.std() == pytest.approx(0.01, rel=0.1) and errors.mean() == pytest.approx(0.0, abs=0.002)
    assert first[2] != first[3]


def test_another_model_does_not_change_a_robots_noise(make_rig, m2wr, build):
    scans = []
    for names in (["a"], ["b", "a"]):
        rig = make_rig(build.box("wall", 3.1, 0.0, 0.5, size=(0.2, 12.0, 1.0)), seed=3)
        for name in names:
            rig.simulator.spawn(with_laser(m2wr, {"topicName": "scan", "robotNamespace": name}),
                                at(0.0, 0.0 if name == "a" else -30.0, 0.1), name)
        rig.run(0.2)
        scans.append([tuple(message.ranges[300:420]) for message in rig.messages("/a/scan")])
        if len(names) > 1:
            assert tuple(rig.messages("/b/scan")[0].ranges[300:420]) != scans[-1][0]
    assert scans[0] == scans[1]


def test_two_lasers_have_independent_noise(m2wr_rig, m2wr, build):
    chassis = m2wr.links[0]
    sensor, = chassis.sensors
    twin = replace(sensor, name="twin", plugins=(replace(
        sensor.plugins[0], name="twin", parameters=(("topicName", "/twin"), ("frameName", "sensor_laser"))),))
    robot = replace(m2wr, links=(replace(chassis, sensors=(sensor, twin)),) + m2wr.links[1:])
    rig = m2wr_rig(build.box("wall", 3.1, 0.0, 0.5, size=(0.2, 12.0, 1.0)), robot=robot).run(0.1)
    assert rig.stamps_ms(SCAN) == rig.stamps_ms("/twin") == [1, 51]
    one, two = rig.messages(SCAN)[0].ranges[360], rig.messages("/twin")[0].ranges[360]
    assert one != two and one == pytest.approx(two, abs=0.1)


def test_reset_simulation_repeats_noise_but_reset_world_does_not(make):
    rig = make(seed=9)
    first = ranges_of(rig)
    rig.simulator.reset_world()
    assert ranges_of(rig)[len(first):] != first
    before = len(rig.messages(SCAN))
    rig.simulator.reset_simulation()
    assert ranges_of(rig)[before:] == first
    assert rig.stamps_ms(SCAN)[before:][:3] == [1, 51, 101]


# -- where --------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("tags, topic", [
    ({"topicName": None}, "/world"), ({"topicName": "scan"}, "/scan"),
    ({"topicName": "scan", "robotNamespace": ""}, "/m2wr/scan"),
    ({"topicName": "scan", "robotNamespace": "robot1"}, "/robot1/scan"),
    ({"topicName": "/scan", "robotNamespace": "r"}, "/scan")])
def test_the_topic(make, tags, topic):
    rig = make(tags, namespace=None).run(0.06)
    assert len(rig.messages(topic)) == 2


def test_a_namespace_from_spawning_reaches_the_laser(make):
    assert len(make({"topicName": "scan"}, namespace="/robot1").run(0.06).messages("/robot1/scan")) == 2


def test_an_empty_topic_name_means_no_topic(make):
    rig = make({"topicName": ""}).run(0.06)
    assert set(rig.ports.topics) == {"/odom", "/joint_states"}


@pytest.mark.parametrize("name, frame", [(None, "world"), ("/laser", "laser"), ("laser", "laser")])
def test_the_frame(make, name, frame):
    assert make({"frameName": name}).run(0.01).messages(SCAN)[0].header.frame_id == frame


def test_gpu_plugin_publishes_the_same(make, m2wr_rig, m2wr, build):
    robot = with_laser(m2wr, sensor={"kind": "gpu_ray"})
    sensor, = robot.links[0].sensors
    sensor = replace(sensor, plugins=(replace(sensor.plugins[0], filename="libgazebo_ros_gpu_laser.so"),))
    robot = replace(robot, links=(replace(robot.links[0], sensors=(sensor,)),) + robot.links[1:])
    wall = build.box("wall", 3.1, 0.0, 0.5, size=(0.2, 12.0, 1.0))
    assert ranges_of(m2wr_rig(wall, robot=robot)) == ranges_of(make())


def error_of(caplog):
    error, = [record.getMessage() for record in caplog.records if record.levelname == "ERROR"]
    return error


def test_plugin_outside_a_ray_sensor_is_rejected(m2wr_rig, m2wr, caplog):
    stray = PluginSpec("stray", "libgazebo_ros_laser.so", (("topicName", "/stray"),), where="m2wr: plugin \"stray\"")
    rig = m2wr_rig(robot=replace(m2wr, plugins=m2wr.plugins + (stray,))).run(0.06)
    assert "must be in a <sensor type=\"ray\">" in error_of(caplog) and "m2wr: plugin \"stray\"" in error_of(caplog)
    assert "/stray" not in rig.ports.topics and len(rig.messages(SCAN)) == 2


@pytest.mark.parametrize("ray", [{"samples": 0}, {"resolution": 1e-4}])
def test_invalid_sensor_is_logged(make, caplog, ray):
    rig = make(ray=ray).run(0.06)
    assert "head_hokuyo_sensor" in error_of(caplog) and "will not run" in error_of(caplog)
    assert SCAN not in rig.ports.topics and len(rig.messages("/odom")) == 1


def test_single_beam_points_forward(make):
    message = make(ray=dict(QUIET, samples=1)).run(0.2).messages(SCAN)[-1]
    assert list(message.ranges) == pytest.approx([3.0 - LASER_X], abs=2e-3)

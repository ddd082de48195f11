# SPDX-License-Identifier: BSD-3-Clause
"""Lasers of several layers: places, rings, order, limits and bytes of their point clouds."""
import math
from dataclasses import replace

import numpy as np
import pytest
from genpy import Time
from sensor_msgs.msg import PointCloud

from conftest import at, box
from m2wr_sim.model.types import Noise, PluginSpec, RayScan, Sensor
from m2wr_sim.plugins.cloud_laser import POINT
from m2wr_sim.ros.serialise import serialise_by_genpy, serialiser_of

LAYERS = RayScan(samples=9, min_angle=-0.4, max_angle=0.4, vertical_samples=4, vertical_min_angle=-0.15,
                 vertical_max_angle=0.15, range_min=0.3, range_max=10.0)


def laser(library="libgazebo_ros_velodyne_laser.so", ray=LAYERS, **tags):
    """A static post with a laser in 0.5 m height that looks along x."""
    tags = dict({"topicName": "/points", "frameName": "velo"}, **tags)
    spec = PluginSpec("p", library, tuple(tags.items()), where="post: plugin")
    sensor = Sensor("s", "ray", pose=at(z=0.0), update_rate=10.0, ray=ray, plugins=(spec,))
    model = box("post", 0, 0, 0.5, (0.1, 0.1, 1.0))
    return replace(model, links=(replace(model.links[0], sensors=(sensor,), collisions=()),))


@pytest.fixture
def make(make_rig):
    def make_with(*models, **options):
        rig = make_rig(*(models or (box("wall", 2.1, 0.0, 0.5, (0.2, 8.0, 8.0)),)), joint_states=False)
        rig.simulator.spawn(laser(**options), at(z=0.5))
        return rig
    return make_with


def points(message):
    return np.asarray(message.data).view(POINT).reshape(message.height, message.width)


def test_points_lie_on_the_wall_from_the_lowest_ring_on(make):
    message = make().run(0.05).messages("/points")[-1]
    assert (message.point_step, message.height, message.width, message.is_dense) == (22, 1, 36, True)
    assert [(field.name, field.offset, field.datatype) for field in message.fields] == [
        ("x", 0, 7), ("y", 4, 7), ("z", 8, 7), ("intensity", 12, 7), ("ring", 16, 4), ("time", 18, 7)]
    found = points(message)[0]
    np.testing.assert_allclose(found["x"], 2.0, atol=1e-5)
    assert list(found["ring"]) == [0, 1, 2, 3] * 9 and np.all(found["time"] == 0)
    azimuths, heights = np.repeat(np.linspace(-0.4, 0.4, 9), 4), np.tile(np.linspace(-0.15, 0.15, 4), 9)
    np.testing.assert_allclose(found["y"], 2.0 * np.tan(azimuths), atol=1e-5)
    np.testing.assert_allclose(found["z"], 2.0 * np.tan(heights) / np.cos(azimuths), atol=1e-5)


def test_organised_cloud_has_a_column_for_each_ring(make):
    rig = make(box("post2", 2.1, 0.0, 0.5, (0.2, 0.2, 8.0)), organize_cloud="true").run(0.05)
    message = rig.messages("/points")[-1]
    assert (message.height, message.width, message.is_dense) == (9, 4, False)
    found = points(message)
    assert np.all(np.isfinite(found["x"][4])) and np.all(np.isnan(found["x"][0][1:]))
    assert np.all(found["ring"] == range(4))


@pytest.mark.parametrize("tags, count", [({"min_range": "2.05"}, 26), ({"max_range": "2.05"}, 10),
                                         ({"max_range": "inf"}, 36), ({"min_intensity": "1"}, 0)])
def test_only_readings_within_the_limits_are_points(make, tags, count):
    message = make(**tags).run(0.05).messages("/points")[-1]
    azimuths, heights = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.15, 0.15, 4))
    ranges = 2.0 / np.cos(azimuths) / np.cos(heights)
    low, high = float(tags.get("min_range", 0.0)), float(tags.get("max_range", 10.0))
    expected = int(((ranges > low) & (ranges < high)).sum()) if "min_intensity" not in tags else 0
    assert message.width == expected == len(points(message)[0]) and (count > 0) == (expected > 0)


def test_noise_of_the_plugin_is_repeated_after_a_reset(make):
    rig = make(gaussianNoise="0.02", ray=replace(LAYERS, samples=400))
    first = points(rig.run(0.05).messages("/points")[0]).copy()
    distances = np.sqrt(first["x"] ** 2 + first["y"] ** 2 + first["z"] ** 2)
    exact = 2.0 * distances / first["x"]
    assert np.std(distances - exact) == pytest.approx(0.02, rel=0.1)
    rig.messages("/points").clear()
    rig.simulator.reset_simulation()
    assert np.array_equal(points(rig.run(0.05).messages("/points")[0]), first)


def test_namespace_stands_for_a_missing_prefix_of_frames(make):
    assert make(robotNamespace="/rob").run(0.05).messages("/points")[-1].header.frame_id == "rob/velo"
    assert make(robotNamespace="/").run(0.05).messages("/points")[-1].header.frame_id == "velo"


def test_block_laser_has_all_points_row_by_row(make):
    post = box("post2", 2.1, 0.0, 0.5, (0.2, 0.2, 8.0))
    cloud = make(post, library="libgazebo_ros_block_laser.so").run(0.05).messages("/points")[-1]
    assert cloud.points.shape == (36, 3) and cloud.intensities.shape == (36,)
    grid = cloud.points.reshape(4, 9, 3)
    assert np.all(np.isinf(grid[1:, 0, 0])) and grid[0, 4, 0] == pytest.approx(2.0, abs=1e-5)
    assert grid[0, 4, 2] < 0 < grid[3, 4, 2] and not np.any(np.isnan(grid))


def test_block_laser_is_serialised_as_genpy_does(make):
    cloud = make(library="libgazebo_ros_block_laser.so").run(0.05).messages("/points")[-1]
    cloud.header.stamp = Time(1, 2)
    fast = serialiser_of(PointCloud)(5, cloud)
    assert fast == serialise_by_genpy(5, cloud.message(PointCloud))


@pytest.mark.parametrize("ray, message", [(replace(LAYERS, vertical_samples=0), "vertical samples 0"),
                                          (replace(LAYERS, vertical_max_angle=math.inf), "vertical_max_angle inf"),
                                          (replace(LAYERS, noise=Noise("gaussian", stddev=-1.0)), "stddev -1.0")])
def test_impossible_laser_is_refused(make, caplog, ray, message):
    rig = make(ray=ray).run(0.05)
    assert message in caplog.text and "/points" not in rig.ports.topics

# SPDX-License-Identifier: BSD-3-Clause
"""The range plugin: the nearest of a cone, the longest range in the empty, noise, names."""
import math
from dataclasses import replace
from io import BytesIO

import numpy as np
import pytest
from genpy import Time
from sensor_msgs.msg import Range

from conftest import at, box
from m2wr_sim.model.types import Noise, PluginSpec, RayScan, Sensor
from m2wr_sim.plugins.laser import float32_or_inf

TOPIC = "/sonar"
CONE = RayScan(samples=5, min_angle=-0.2, max_angle=0.2, vertical_samples=5, vertical_min_angle=-0.2,
               vertical_max_angle=0.2, range_min=0.05, range_max=4.0, noise=Noise("gaussian", mean=1.0, stddev=0.5))


def finder(ray=CONE, rate=20.0, **tags):
    """Return a static post with a range finder in 1 m height that looks along x."""
    tags = dict({"topicName": "sonar", "frameName": "sonar_link"}, **tags)
    spec = PluginSpec("sonar", "libgazebo_ros_range.so", tuple(tags.items()), where="post: plugin \"sonar\"")
    sensor = Sensor("sonar", "ray", pose=at(x=0.1, z=0.5), update_rate=rate, ray=ray, plugins=(spec,))
    model = box("post", 0, 0, 0.5, (0.1, 0.1, 1.0))
    return replace(model, links=(replace(model.links[0], sensors=(sensor,)),))


@pytest.fixture
def make(make_rig):
    def make_with(*models, **options):
        rig = make_rig(*models, joint_states=False)
        rig.simulator.spawn(finder(**options), at(z=0.5))
        return rig
    return make_with


def test_no_hit_gives_the_longest_range(make):
    message = make().run(0.1).messages(TOPIC)[-1]
    assert message.range == pytest.approx(4.0)
    assert (message.min_range, message.max_range) == (pytest.approx(0.05), pytest.approx(4.0))
    assert message.header.frame_id == "sonar_link" and message.radiation_type == Range.ULTRASOUND
    assert message.field_of_view == pytest.approx(0.05)


def test_longest_range_above_float32_is_infinite(make):
    upwards = replace(CONE, range_max=1e300, vertical_min_angle=0.1)
    message = make(ray=upwards).run(0.1).messages(TOPIC)[-1]
    assert message.range == message.max_range == math.inf
    message.header.stamp = Time()
    message.serialize(BytesIO())


def test_range_is_the_shortest_ray_without_sensor_noise(make):
    # the corner of a small box below and left of the axis, and a wall behind it
    rig = make(box("wall", 3.05, 0.0, 1.0, (0.1, 4.0, 4.0)), box("crumb", 1.35, 0.27, 0.73, (0.5, 0.14, 0.14))).run(0.1)
    nearest = rig.messages(TOPIC)[-1].range
    # the ray at 0.2, -0.2 goes through (1, 0.2027, -0.2068): it meets the front of the crumb at x = 1.1
    assert nearest == pytest.approx(np.linalg.norm((1.0, 0.20271, 0.20684)), abs=0.01)


def test_the_rate_is_that_of_sensor_and_plugin_together(make):
    assert make(rate=20.0, updateRate="10").run(0.35).stamps_ms(TOPIC) == [101, 201, 301]
    assert make(rate=0.0, updateRate="100").run(0.035).stamps_ms(TOPIC) == [10, 20, 30]
    assert make(rate=0.0).run(0.003).stamps_ms(TOPIC) == [1, 2, 3]


def test_noise_affects_hits_below_the_longest_range(make):
    rig = make(box("wall", 3.95, 0.0, 1.0, (0.1, 4.0, 4.0)), rate=0.0, gaussianNoise="0.1",
               radiation="infrared", fov="0.4").run(1.0)
    ranges = np.array([message.range for message in rig.messages(TOPIC)])
    assert ranges.max() <= 4.0
    assert ranges.std() == pytest.approx(0.1, rel=0.15) and ranges.mean() == pytest.approx(3.8, abs=0.02)
    assert rig.messages(TOPIC)[-1].radiation_type == Range.INFRARED
    assert rig.messages(TOPIC)[-1].field_of_view == pytest.approx(0.4)


def test_names_by_default(make_rig):
    rig = make_rig(joint_states=False)
    model = finder()
    sensor = model.links[0].sensors[0]
    bare = replace(sensor, plugins=(PluginSpec("sonar", "libgazebo_ros_range.so", (), where="x"),))
    rig.simulator.spawn(replace(model, links=(replace(model.links[0], sensors=(bare,)),)), at(z=0.5))
    assert rig.run(0.1).messages("/range")[-1].header.frame_id == "world"


def test_no_rays_are_cast_without_subscribers(make):
    rig = make()
    rig.ports.topics[TOPIC].listening = False
    plugin = rig.simulator.models["post"].plugins[0][0]
    plugin._rays = None                     # a cast would fail and switch the plugin off
    rig.run(0.5)
    assert len(rig.simulator.models["post"].plugins) == 1 and rig.messages(TOPIC) == []


def test_outside_a_ray_sensor_is_rejected(make, caplog):
    assert TOPIC not in make(ray=None).ports.topics and "must be in a <sensor type=\"ray\">" in caplog.text


def test_noise_above_float32_is_infinite():
    assert float32_or_inf(1e300) == math.inf and float32_or_inf(-1e300) == -math.inf and float32_or_inf(-3.0) == -3.0

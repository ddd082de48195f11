# SPDX-License-Identifier: BSD-3-Clause
"""Processor time of cameras and of lasers with several layers, their messages included.

A camera, or a laser, stands in a square with boxes and cylinders of the density of 60 in 16 m by 16 m, and turns by
0.1 rad from one picture to the next.  The time is that of the plugin and of its messages' bytes, as they are sent; the
share of a core is that time times the rate of the sensor.
"""
from __future__ import annotations

import math
import random
import time
from typing import Any, List, NamedTuple, Tuple

from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.model.sdf.loader import load_sdf_models
from m2wr_sim.model.types import Box, Collision, Cylinder, Light, Link, Model, Plane, Visual, World
from m2wr_sim.physics.engine import EngineSettings
from m2wr_sim.physics.factory import make_engine
from m2wr_sim.ros.serialise import serialiser_of
from m2wr_sim.runtime.ports import LocalPorts
from m2wr_sim.runtime.simulator import SimConfig, Simulator
from m2wr_sim.sensors.ray_scene import RayScene

PICTURES = 40
_SQUARE, _AREA = 16.0, 60       # m, obstacles in it
_SUN = Light("sun", "directional", diffuse=(0.8, 0.8, 0.8, 1.0), direction=(-0.5, 0.1, -0.9), cast_shadows=True)
_CAMERA = """<camera><horizontal_fov>1.047</horizontal_fov><image><width>%d</width><height>%d</height></image>
<clip><near>0.1</near><far>100</far></clip></camera>"""
_LAYERS = """<ray><scan><horizontal><samples>%d</samples><min_angle>-3.14159</min_angle><max_angle>3.14159</max_angle>
</horizontal><vertical><samples>%d</samples><min_angle>-0.2618</min_angle><max_angle>0.2618</max_angle></vertical></scan>
<range><min>0.1</min><max>100</max></range></ray>"""


class Sensor(NamedTuple):
    """A row: name, rate [Hz], kind, library, inside of the sensor, topics with subscribers (all if empty)."""

    name: str
    rate: float
    kind: str
    library: str
    inside: str
    topics: Tuple[str, ...] = ()


_DEPTH = "libgazebo_ros_openni_kinect.so"
SENSORS = (
    Sensor("camera 320 x 240", 20.0, "camera", "libgazebo_ros_camera.so", _CAMERA % (320, 240)),
    Sensor("camera 640 x 480", 30.0, "camera", "libgazebo_ros_camera.so", _CAMERA % (640, 480)),
    Sensor("colour and depth 640 x 480", 30.0, "depth", _DEPTH, _CAMERA % (640, 480),
           ("/cam/ir/image_raw", "/cam/depth/image_raw")),
    Sensor("depth alone 640 x 480", 30.0, "depth", _DEPTH, _CAMERA % (640, 480), ("/cam/depth/image_raw",)),
    Sensor("colour, depth and cloud 640 x 480", 30.0, "depth", _DEPTH, _CAMERA % (640, 480)),
    Sensor("velodyne 16 x 1800", 10.0, "ray", "libgazebo_ros_velodyne_laser.so", _LAYERS % (1800, 16)),
)


def world_of(obstacles: int, seed: int = 1) -> World:
    """Return a floor with boxes and cylinders, two metres apart from the middle, each with a visual and a collision.

    Parameters
    ----------
    obstacles : int
    seed : int
        Of the places and sizes.
    """
    draw, half = random.Random(seed), 0.5 * _SQUARE * math.sqrt(max(obstacles, 1) / _AREA)
    models = [_model("floor", Plane(size=(4.0 * half + 100.0,) * 2), 0.0, 0.0, 0.0, 0.0, 0.6)]
    while len(models) <= obstacles:
        x, y = draw.uniform(-half, half), draw.uniform(-half, half)
        if math.hypot(x, y) > 2.0:
            width = draw.uniform(0.2, 0.8)
            shape = Cylinder(0.5 * width, 1.0) if len(models) % 2 else Box((width, 0.5, 1.0))
            models.append(_model("o%d" % len(models), shape, x, y, 0.5, draw.uniform(-3.0, 3.0), draw.random()))
    return World(models=tuple(models), lights=(_SUN,))


def _model(name: str, shape: Any, x: float, y: float, z: float, yaw: float, red: float) -> Model:
    link = Link("link", collisions=(Collision("c", shape),), visuals=(Visual("v", shape, rgba=(red, 0.5, 0.6, 1.0)),))
    return Model(name, (link,), pose=((x, y, z), quaternion_from_rpy(0.0, 0.0, yaw)), static=True)


class _Sink:
    """Takes the messages of a topic and makes their bytes."""

    def __init__(self, message_class: Any, wanted: bool) -> None:
        self._serialise, self._wanted, self.count = serialiser_of(message_class), wanted, 0

    def wanted(self) -> bool:
        return self._wanted

    def publish(self, message: Any) -> None:
        self.count += 1
        self._serialise(self.count, message)

    def close(self) -> None:
        self._wanted = False


class _Ports(LocalPorts):
    def __init__(self, topics: Tuple[str, ...]) -> None:
        super().__init__()
        self._topics = topics

    def advertise(self, topic: str, message_class: Any, queue_size: int, namespace: str) -> Any:
        name = self.resolve(topic, namespace)
        return _Sink(message_class, not self._topics or name in self._topics)

    def moment(self, now_ns: int) -> Any:
        import genpy
        return genpy.Time(now_ns // 1000000000, now_ns % 1000000000)


def time_of(sensor: Sensor, obstacles: int, pictures: int = PICTURES) -> float:
    """Return the processor time [s] of one picture or scan with its messages.

    Parameters
    ----------
    sensor : Sensor
    obstacles : int
    pictures : int
        How many are measured; the median counts.
    """
    ports = _Ports(sensor.topics)
    simulator = Simulator(make_engine("auto", EngineSettings(step_ns=10000000)), RayScene(), ports,
                          SimConfig(joint_states=False))
    try:
        simulator.load_world(world_of(obstacles))
        text = """<sdf version="1.6"><model name="eye"><static>1</static><link name="l"><sensor name="s" type="%s">
            <update_rate>0</update_rate>%s<plugin name="p" filename="%s"><cameraName>cam</cameraName></plugin></sensor>
            </link></model></sdf>""" % (sensor.kind, sensor.inside, sensor.library)
        simulator.spawn(load_sdf_models(text)[0], ((0.0, 0.0, 0.5), (0.0, 0.0, 0.0, 1.0)))
        plugin = simulator.models["eye"].plugins[0][0]
        plugin.next_after(0)                # there are subscribers
        times: List[float] = []
        for index in range(pictures + 1):
            turn = quaternion_from_rpy(0.0, 0.0, 0.1 * index)
            simulator.set_model_state("eye", ((0.0, 0.0, 0.5), turn), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
            begun = time.thread_time()
            plugin.after_step((index + 1) * simulator.step_ns)
            times.append(time.thread_time() - begun)
        return sorted(times[1:])[pictures // 2]         # the first reads and sorts all shapes
    finally:
        simulator.close()


def report(counts: Tuple[int, ...] = (60, 600, 6000)) -> str:
    """Return a table: for each sensor the time of a picture with its messages [ms] and the share of a core."""
    lines = ["| sensor | rate [Hz] | %s | share of a core, %d obstacles |" % (
        " | ".join("%d obstacles [ms]" % count for count in counts), counts[0]), "|---|---|%s---|" % (
            "---|" * len(counts))]
    for sensor in SENSORS:
        times = [time_of(sensor, count) for count in counts]
        lines.append("| %s | %g | %s | %.3f |" % (sensor.name, sensor.rate, " | ".join(
            "%.1f" % (1e3 * seconds) for seconds in times), times[0] * sensor.rate))
    return "\n".join(lines) + "\n"

# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_range.so: shortest range of all rays of a ray sensor, as sensor_msgs/Range."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import compose
from m2wr_sim.messages import Range
from m2wr_sim.model.types import Noise
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.plugins.laser import float32_or_inf
from m2wr_sim.runtime.schedule import GapSchedule, SensorSchedule
from m2wr_sim.sensors.laser import LaserSensor


class RangeFinder(LazySensor):
    """Casts rays only while there are subscribers; as in Gazebo it uses the noise of the plugin, not of the sensor."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.ray is None:
            raise PluginError("%s: a range plugin must be in a <sensor type=\"ray\"> with a <ray> element"
                              % spec.spec.where)
        self._ctx = ctx
        namespace = spec.spec.find("robotNamespace") or ""
        named = spec.text("topicName", "/range")
        topic = "" if spec.spec.find("topicName") == "" else named     # an empty element disables the topic
        self._message = Range(field_of_view=float32_or_inf(spec.number("fov", 0.05)))
        ultrasound = spec.text("radiation", "ultrasound") == "ultrasound"
        self._message.radiation_type = Range.ULTRASOUND if ultrasound else Range.INFRARED
        self._message.header.frame_id = ctx.frame(spec.text("frameName", "/world"), namespace)
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        self._rng = ctx.rng("noise")
        self._sensed = SensorSchedule(ctx.sensor.update_rate)
        self._sent = GapSchedule(spec.number("updateRate", 0.0), ctx.now_ns)
        try:
            rays = replace(ctx.sensor.ray, noise=Noise(), resolution=1.0, vertical_resolution=1.0)
            self._rays = LaserSensor(rays, ctx.rng("no noise"))
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        self._message.min_range = float32_or_inf(self._rays.range_min)
        self._message.max_range = float32_or_inf(self._rays.range_max)
        self._port: Any = ctx.advertise(topic, Range, namespace=namespace) if topic else None

    def wanted(self) -> bool:
        return self._port is not None and self._port.wanted()

    def wake(self, now_ns: int) -> None:
        self._sensed.restart()

    def next_reading(self, now_ns: int) -> int:
        step_ns = self._ctx.step_ns
        if not self._sensed.period_ns:
            return max(now_ns + step_ns, self._sent.next_due(now_ns, step_ns))
        return self._sensed.next_due(now_ns, step_ns)

    def after_step(self, now_ns: int) -> None:
        if not self.awake or not self._sensed.due(now_ns) or not self._sent.due(now_ns):
            return
        pose = compose(self._ctx.physics.link_pose(self._ctx.sensor_link), self._ctx.sensor.pose)
        self._ctx.refresh_scene()
        nearest = float(self._rays.cast(self._ctx.scene, pose)[0].min())
        farthest = self._message.max_range
        if math.isinf(nearest):
            nearest = farthest
        elif self._sigma:
            nearest = min(farthest, nearest + self._sigma * float(self._rng.standard_normal()))
        self._message.header.stamp, self._message.range = self._ctx.moment(now_ns), float32_or_inf(nearest)
        self._port.publish(self._message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._sent.restart(now_ns)
        if rewound:
            self._sensed.restart()
            self._rng = self._ctx.rng("noise")

# SPDX-License-Identifier: BSD-3-Clause
"""libhector_gazebo_ros_sonar.so: the shortest range of a cone of rays, as sensor_msgs/Range."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import compose
from m2wr_sim.messages import Range
from m2wr_sim.model.types import Noise
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.plugins.hector import drift_model
from m2wr_sim.plugins.laser import float32_or_inf
from m2wr_sim.runtime.schedule import GapSchedule
from m2wr_sim.sensors.laser import LaserSensor


class HectorSonar(LazySensor):
    """Casts rays only while there are subscribers; the noise is that of the plugin."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.ray is None:
            raise PluginError("%s: a sonar plugin must be in a <sensor type=\"ray\"> with a <ray> element"
                              % spec.spec.where)
        self._ctx, ray = ctx, ctx.sensor.ray
        namespace = spec.spec.find("robotNamespace") or ""
        self._schedule = GapSchedule(spec.number("updateRate", 10.0, minimum=0.0), ctx.now_ns)
        self._error = drift_model(spec, ctx, "", 1)
        try:
            self._rays = LaserSensor(replace(ray, noise=Noise(), resolution=1.0, vertical_resolution=1.0),
                                     ctx.rng("no noise"))
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        message = self._message = Range(radiation_type=Range.ULTRASOUND)
        message.header.frame_id = ctx.frame(spec.text("frameId", "/sonar_link"), namespace)
        message.field_of_view = float32_or_inf(min(abs(ray.max_angle - ray.min_angle),
                                                   abs(ray.vertical_max_angle - ray.vertical_min_angle)))
        message.min_range, message.max_range = map(float32_or_inf, (self._rays.range_min, self._rays.range_max))
        self._port: Any = ctx.advertise(spec.text("topicName", "sonar"), Range, namespace=namespace)

    def wanted(self) -> bool:
        return self._port.wanted()

    def wake(self, now_ns: int) -> None:
        self._schedule.restart(now_ns)

    def next_reading(self, now_ns: int) -> int:
        return max(now_ns + self._ctx.step_ns, self._schedule.next_due(now_ns, self._ctx.step_ns))

    def after_step(self, now_ns: int) -> None:
        elapsed = self._schedule.elapsed(now_ns) * 1e-9
        if not self.awake or not self._schedule.due(now_ns):
            return
        pose = compose(self._ctx.physics.link_pose(self._ctx.sensor_link), self._ctx.sensor.pose)
        self._ctx.refresh_scene()
        nearest, message = float(self._rays.cast(self._ctx.scene, pose)[0].min()), self._message
        measured = float(self._error.measure([0.0 if math.isinf(nearest) else nearest], elapsed)[0])
        message.range = message.max_range if nearest >= message.max_range else min(
            max(float32_or_inf(measured), message.min_range), message.max_range)
        message.header.stamp = self._ctx.moment(now_ns)
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        if rewound:
            self._error.restart(self._ctx.rng("errors"))

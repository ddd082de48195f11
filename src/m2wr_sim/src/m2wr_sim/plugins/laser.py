# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_laser.so and libgazebo_ros_gpu_laser.so: a ray sensor as sensor_msgs/LaserScan."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from m2wr_sim.errors import PluginError
from m2wr_sim.messages import LaserScan
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import SensorSchedule
from m2wr_sim.sensors.laser import LaserSensor

if TYPE_CHECKING:
    import numpy.typing as npt

_LARGEST = float(np.finfo(np.float32).max)


def float32_or_inf(limit: float) -> float:
    """Return a number, or an infinity of its sign if it is out of the range of a message's float32."""
    return limit if abs(limit) <= _LARGEST else math.copysign(math.inf, limit)


class Laser(LazySensor):
    """Casts rays only while there are subscribers; the first scan is taken in the next step."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.ray is None:
            raise PluginError("%s: a laser plugin must be in a <sensor type=\"ray\"> or \"gpu_ray\" with a <ray> "
                              "element" % spec.spec.where)
        self._ctx = ctx
        namespace = spec.spec.find("robotNamespace")
        namespace = "" if namespace is None else namespace or ctx.model_name
        try:
            self._make_laser()
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        if self._laser.range_min >= self._laser.range_max:
            spec.problems.append("<min> range %g m is not below <max> range %g m; all readings are inf"
                                 % (self._laser.range_min, self._laser.range_max))
        self._schedule = SensorSchedule(ctx.sensor.update_rate)
        named = spec.text("topicName", "/world")
        topic = "" if spec.spec.find("topicName") == "" else named     # an empty element disables the topic
        self._port: Any = ctx.advertise(topic, LaserScan, namespace=namespace) if topic else None
        self._message = LaserScan()
        header = self._message
        header.header.frame_id = ctx.frame(spec.text("frameName", "/world"), namespace)
        header.angle_min, header.angle_max = self._laser.angle_min, self._laser.angle_max
        header.angle_increment = self._laser.angle_increment
        header.range_min = float32_or_inf(self._laser.range_min)
        header.range_max = float32_or_inf(self._laser.range_max)

    def _make_laser(self) -> None:
        """Create the laser with its initial noise, and the function that updates its pose."""
        ctx = self._ctx
        self._laser = LaserSensor(ctx.sensor.ray, ctx.rng("noise"))
        self._update_pose = ctx.physics.pose_reader([(ctx.sensor_link, ctx.sensor.pose)], self._laser.pose)

    def wanted(self) -> bool:
        """Return whether the scans have subscribers."""
        return self._port is not None and self._port.wanted()

    def measure(self) -> Tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Measure now; return ranges [m] and intensities, (n,) float32 each, which the next scan overwrites."""
        self._update_pose()
        self._ctx.refresh_scene()
        return self._laser.cast(self._ctx.scene)

    def wake(self, now_ns: int) -> None:
        self._schedule.restart()

    def next_reading(self, now_ns: int) -> int:
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def after_step(self, now_ns: int) -> None:
        if not self.awake or not self._schedule.due(now_ns):
            return
        ranges, intensities = self.measure()
        message = self._message
        message.header.stamp = self._ctx.moment(now_ns)
        message.ranges, message.intensities = ranges, intensities      # arrays are serialised much faster than lists
        self._port.publish(message)

    def reset(self, now_ns: int, rewound: bool) -> None:
        if rewound:
            self._schedule.restart()
            self._laser.reset(self._ctx.rng("noise"))

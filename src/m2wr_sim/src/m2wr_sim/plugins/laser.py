# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_laser.so and libgazebo_ros_gpu_laser.so: a ray sensor as sensor_msgs/LaserScan."""
import math

import numpy as np
from sensor_msgs.msg import LaserScan

from m2wr_sim.errors import PluginError
from m2wr_sim.plugins.base import LazySensor
from m2wr_sim.runtime.schedule import SensorSchedule
from m2wr_sim.sensors.laser import LaserSensor

_LARGEST = float(np.finfo(np.float32).max)


def told_limit(limit):
    """Return a number as it goes into messages: infinite, with its sign, where float32 does not hold it."""
    return limit if abs(limit) <= _LARGEST else math.copysign(math.inf, limit)


class Laser(LazySensor):
    """Casts rays only while somebody listens; the first scan comes with the next step."""

    def configure(self, spec, ctx):
        if ctx.sensor is None or ctx.sensor.ray is None:
            raise PluginError("%s: a laser plugin belongs into a <sensor type=\"ray\"> or \"gpu_ray\" with a <ray> "
                              "element" % spec.spec.where)
        self._ctx = ctx
        namespace = spec.spec.find("robotNamespace")
        namespace = "" if namespace is None else namespace or ctx.model_name
        try:
            self._make_laser()
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        if self._laser.range_min >= self._laser.range_max:
            spec.problems.append("nothing is between a <min> range of %g m and a <max> of %g m; every reading is inf"
                                 % (self._laser.range_min, self._laser.range_max))
        self._schedule = SensorSchedule(ctx.sensor.update_rate)
        named = spec.text("topicName", "/world")
        topic = "" if spec.spec.find("topicName") == "" else named     # an empty element means no topic at all
        self._port = ctx.advertise(topic, LaserScan, namespace=namespace) if topic else None
        self._message = LaserScan()
        header = self._message
        header.header.frame_id = ctx.frame(spec.text("frameName", "/world"), namespace)
        header.angle_min, header.angle_max = self._laser.angle_min, self._laser.angle_max
        header.angle_increment = self._laser.angle_increment
        header.range_min, header.range_max = told_limit(self._laser.range_min), told_limit(self._laser.range_max)

    def _make_laser(self):
        """Make a scanner whose noise begins anew, and what writes its pose."""
        ctx = self._ctx
        self._laser = LaserSensor(ctx.sensor.ray, ctx.rng("noise"))
        self._look = ctx.physics.pose_reader([(ctx.sensor_link, ctx.sensor.pose)], self._laser.pose)

    def wanted(self):
        """Tell whether anybody listens to the scans."""
        return self._port is not None and self._port.wanted()

    def measure(self):
        """Take a scan now; returns the sensor's own arrays of ranges and intensities."""
        self._look()
        self._ctx.refresh_scene()
        return self._laser.cast(self._ctx.scene)

    def wake(self, now_ns):
        self._schedule.restart()

    def next_reading(self, now_ns):
        return self._schedule.next_due(now_ns, self._ctx.step_ns)

    def after_step(self, now_ns):
        if not self.awake or not self._schedule.due(now_ns):
            return
        ranges, intensities = self.measure()
        message = self._message
        message.header.stamp = self._ctx.moment(now_ns)
        message.ranges, message.intensities = ranges, intensities      # arrays: what is far slower as lists
        self._port.publish(message)

    def reset(self, now_ns, rewound):
        if rewound:
            self._schedule.restart()
            self._laser.reset(self._ctx.rng("noise"))

# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_velodyne_laser.so and libgazebo_ros_block_laser.so: lasers of several layers as point clouds."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from m2wr_sim.errors import PluginError
from m2wr_sim.messages import ChannelFloat32, Point32, PointCloud, PointCloud2, PointField
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import GapSchedule, SensorSchedule
from m2wr_sim.sensors.laser import LaserSensor

if TYPE_CHECKING:
    import numpy.typing as npt

    Ranges = npt.NDArray[np.float32]

#: A point as velodyne_simulator 1.0.11 and later publish it.
POINT = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("intensity", "<f4"), ("ring", "<u2"), ("time", "<f4")])

OFFSETS = (("x", 0), ("y", 4), ("z", 8), ("intensity", 12), ("ring", 16), ("time", 18))


class CloudLaser(LazySensor):
    """Base: casts the rays of all layers while there are subscribers."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.ray is None:
            raise PluginError("%s: a laser plugin must be in a <sensor type=\"ray\"> or \"gpu_ray\" with a <ray> "
                              "element" % spec.spec.where)
        self._ctx = ctx
        self._namespace = spec.spec.find("robotNamespace") or ""
        ray = ctx.sensor.ray
        try:
            self._laser = LaserSensor(ray, ctx.rng("noise"))
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        self._update_pose = ctx.physics.pose_reader([(ctx.sensor_link, ctx.sensor.pose)], self._laser.pose)
        rows = self._laser.vertical_count
        heights = np.linspace(ray.vertical_min_angle, ray.vertical_max_angle, rows) if rows > 1 else np.zeros(1)
        flat = np.cos(heights)[:, None]
        angles = self._laser.angles
        #: Directions of the readings, (rows, readings of a row, 3) float32.
        self._directions = np.stack(np.broadcast_arrays(
            flat * np.cos(angles), flat * np.sin(angles), np.sin(heights)[:, None]), axis=-1).astype(np.float32)
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        self._rng = ctx.rng("plugin noise")
        self._sensed = SensorSchedule(ctx.sensor.update_rate)
        self._sent = GapSchedule(0.0, ctx.now_ns)
        self._frame = self._prefixed(spec.text("frameName", "/world"))
        self._port: Any = None
        self._set_up(spec)

    def _set_up(self, spec: PluginReader) -> None:
        """Read further tags and open the topic."""
        raise NotImplementedError

    def _prefixed(self, name: str) -> str:
        return self._ctx.frame(name, self._namespace)

    def wanted(self) -> bool:
        return self._port.wanted()

    def wake(self, now_ns: int) -> None:
        self._sensed.restart()

    def next_reading(self, now_ns: int) -> int:
        if not self._sensed.period_ns:
            return max(now_ns + self._ctx.step_ns, self._sent.next_due(now_ns, self._ctx.step_ns))
        return self._sensed.next_due(now_ns, self._ctx.step_ns)

    def after_step(self, now_ns: int) -> None:
        if not self.awake or not self._sensed.due(now_ns) or not self._sent.due(now_ns):
            return
        self._update_pose()
        self._ctx.refresh_scene()
        ranges, intensities = self._laser.cast(self._ctx.scene)
        ranges = ranges.copy()
        if self._sigma:
            ranges += self._sigma * self._rng.standard_normal(ranges.size, np.float32)
        shape = self._directions.shape[:2]
        self._port.publish(self._message(self._ctx.moment(now_ns), ranges.reshape(shape), intensities.reshape(shape)))

    def _message(self, stamp: Any, ranges: Ranges, intensities: Ranges) -> Any:
        """Return the message of readings (rows, readings of a row)."""
        raise NotImplementedError

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._sent.restart(now_ns)
        if rewound:
            self._sensed.restart()
            self._laser.reset(self._ctx.rng("noise"))
            self._rng = self._ctx.rng("plugin noise")


class Velodyne(CloudLaser):
    """Points in the laser's frame, azimuth by azimuth, in each from the lowest ring to the highest."""

    def _set_up(self, spec: PluginReader) -> None:
        self._least = max(spec.number("min_range", 0.0), self._laser.range_min)
        self._most = min(_number_or_inf(spec, "max_range"), self._laser.range_max)
        if not self._least < self._most:
            spec.problems.append("<min_range> %g m is not below <max_range> %g m; there are no points"
                                 % (self._least, self._most))
        text = spec.spec.find("min_intensity")
        self._dimmest = spec.number("min_intensity", 0.0) if text else -math.inf
        spec.ignore("min_intensity")
        self._organised = spec.flag("organize_cloud", False)
        self._rings = np.arange(self._directions.shape[0], dtype=np.uint16)
        self._port = self._ctx.advertise(spec.text("topicName", "/points"), PointCloud2, 1, self._namespace)

    def _prefixed(self, name: str) -> str:
        """Return the frame's name; as in the original the namespace stands for a missing ``tf_prefix``."""
        found, space = super()._prefixed(name), self._namespace.strip("/")
        return found if name.startswith("/") or found != name or not space else space + "/" + name

    def _message(self, stamp: Any, ranges: Ranges, intensities: Ranges) -> PointCloud2:
        valid = ((ranges > self._least) & (ranges < self._most) & (intensities >= self._dimmest)).T
        directions, distances = self._directions.transpose(1, 0, 2), ranges.T
        rings = np.broadcast_to(self._rings, valid.shape)
        if not self._organised:
            directions, distances, rings = directions[valid], distances[valid], rings[valid]
            bright = intensities.T[valid]
        else:
            distances, bright = np.where(valid, distances, np.float32(np.nan)), intensities.T
        points = np.zeros(distances.shape, POINT)
        for axis, name in enumerate("xyz"):
            points[name] = distances * directions[..., axis]
        points["intensity"], points["ring"] = bright, rings
        message = PointCloud2()
        message.header.stamp, message.header.frame_id = stamp, self._frame
        message.height, message.width = points.shape if self._organised else (1, points.size)
        message.fields = [PointField(name, offset, PointField.UINT16 if name == "ring" else PointField.FLOAT32, 1)
                          for name, offset in OFFSETS]
        message.point_step, message.row_step = POINT.itemsize, POINT.itemsize * message.width
        message.is_dense = not self._organised or bool(valid.all())
        message.data = points.reshape(-1).view(np.uint8)
        return message


class BlockLaser(CloudLaser):
    """All points, row by row; those without a hit are infinitely far."""

    def _set_up(self, spec: PluginReader) -> None:
        self._sent = GapSchedule(spec.number("updateRate", 0.0, minimum=0.0), self._ctx.now_ns)
        self._port = self._ctx.advertise(spec.text("topicName", "/world"), PointCloud, 1, self._namespace)

    def _message(self, stamp: Any, ranges: Ranges, intensities: Ranges) -> Any:
        with np.errstate(invalid="ignore"):
            points = ranges[..., None] * self._directions
        points[np.isnan(points)] = 0.0          # infinity times a component that is 0
        return CloudOfPoints(stamp, self._frame, points.reshape(-1, 3), intensities.reshape(-1).copy())


class CloudOfPoints:
    """A sensor_msgs/PointCloud as arrays: ``points`` (n, 3) float32, ``intensities`` (n,) float32."""

    def __init__(self, stamp: Any, frame: str, points: Ranges, intensities: Ranges) -> None:
        self.header = PointCloud().header
        self.header.stamp, self.header.frame_id = stamp, frame
        self.points, self.intensities = points, intensities

    def __repr__(self) -> str:
        return repr(self.message())

    def message(self, message_class: Any = PointCloud) -> Any:
        """Return the message."""
        message = message_class()
        message.header = self.header
        message.points = [Point32(*point) for point in self.points.tolist()]
        channel = ChannelFloat32()
        channel.name, channel.values = "intensity", self.intensities.tolist()
        message.channels = [channel]
        return message


def _number_or_inf(spec: PluginReader, tag: str) -> float:
    text = spec.spec.find(tag)
    if text is None or text.strip().lower() in ("", "inf", "+inf", "infinity"):
        spec.ignore(tag)
        return math.inf
    return spec.number(tag, 0.0)

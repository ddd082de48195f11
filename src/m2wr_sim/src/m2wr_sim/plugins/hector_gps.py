# SPDX-License-Identifier: BSD-3-Clause
"""libhector_gazebo_ros_gps.so: position as sensor_msgs/NavSatFix, velocity north, west, up as Vector3Stamped."""
from __future__ import annotations

import math

from m2wr_sim.errors import PluginError
from m2wr_sim.messages import NavSatFix, Vector3Stamped
from m2wr_sim.plugins.base import PluginReader
from m2wr_sim.plugins.hector import HectorSensor
from m2wr_sim.sensors.drift import places_from


class HectorGps(HectorSensor):
    """The origin of the world is the reference."""

    _rate = 4.0

    def _set_up(self, spec: PluginReader) -> None:
        self._link, _ = self._body(spec)
        self._frame = self._ctx.frame(spec.text("frameId", "/world"), self._namespace)
        self._latitude = spec.number("referenceLatitude", 49.9)
        self._longitude = spec.number("referenceLongitude", 8.9)
        self._heading = math.radians(spec.number("referenceHeading", 0.0))
        self._altitude = spec.number("referenceAltitude", 0.0)
        if not (abs(self._latitude) <= 90.0 and abs(self._longitude) <= 360.0):
            raise PluginError("%s: reference at latitude %g, longitude %g; expected at most 90 and 360 degrees"
                              % (spec.spec.where, self._latitude, self._longitude))
        self._status = int(min(max(spec.number("status", 0.0), -1.0), 2.0))
        self._service = int(min(max(spec.number("service", 0.0), 0.0), 65535.0))
        spec.ignore("useWorldSphericalCoordinates")
        self._position_error, self._velocity_error = self._error(spec, "", 3), self._error(spec, "velocity", 3)
        self._port = self._advertise(spec.text("topicName", "fix"), NavSatFix)
        self._velocity_port = self._advertise(spec.text("velocityTopicName", "fix_velocity"), Vector3Stamped)

    def _measure(self, now_ns: int, elapsed: float) -> None:
        state = self._physics.link_state(self._link)
        velocity = self._velocity_error.measure(state.linear_velocity, elapsed)
        position = self._position_error.measure(state.position, elapsed)
        self._position_error.drift = self._position_error.drift + elapsed * self._velocity_error.drift
        stamp = self._ctx.moment(now_ns)
        if self._port.wanted():
            fix = NavSatFix()
            fix.header.stamp, fix.header.frame_id = stamp, self._frame
            fix.status.status, fix.status.service = self._status, self._service
            fix.latitude, fix.longitude = places_from(self._latitude, self._longitude, self._heading,
                                                      float(position[0]), float(position[1]))
            fix.altitude = self._altitude + float(position[2])
            variance = self._position_error.drift ** 2 + self._position_error.noise ** 2
            fix.position_covariance = [0.0] * 9
            fix.position_covariance[::4] = map(float, variance)
            fix.position_covariance_type = NavSatFix.COVARIANCE_TYPE_DIAGONAL_KNOWN
            self._port.publish(fix)
        if self._velocity_port.wanted():
            message, turn = Vector3Stamped(), self._heading
            message.header.stamp, message.header.frame_id = stamp, self._frame
            x, y, z = map(float, velocity)
            message.vector.x = math.cos(turn) * x + math.sin(turn) * y
            message.vector.y = -math.sin(turn) * x + math.cos(turn) * y
            message.vector.z = z
            self._velocity_port.publish(message)

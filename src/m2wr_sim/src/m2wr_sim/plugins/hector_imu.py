# SPDX-License-Identifier: BSD-3-Clause
"""libhector_gazebo_ros_imu.so: rates, accelerations with gravity and orientation, with drifting errors."""
from __future__ import annotations

import math
from typing import Any, Tuple

from m2wr_sim.geometry import (
    conjugate,
    multiply,
    normalise_quaternion,
    quaternion_from_rpy,
    rotate_inverse,
)
from m2wr_sim.messages import Empty, EmptyResponse, Imu
from m2wr_sim.plugins.base import PluginReader
from m2wr_sim.plugins.hector import HectorSensor


class HectorImu(HectorSensor):
    """The rate is the rotation between two measurements, so it has a peak when the body is placed elsewhere."""

    def _set_up(self, spec: PluginReader) -> None:
        self._link, body = self._body(spec)
        topic = spec.text("topicName", "imu")
        self._frame = self._ctx.frame(spec.text("frameId", body), self._namespace)
        self._mounting = quaternion_from_rpy(*spec.vector("rpyOffset"))
        self._acceleration_error = self._error(spec, "accel", 3)
        self._rate_error, self._yaw_error = self._error(spec, "rate", 3), self._error(spec, "yaw", 1)
        spec.ignore("headingOffset", "headingDrift", "headingDriftFrequency", "headingGaussianNoise", "gaussianNoise",
                    "rpyOffsets", "xyzOffset", "biasTopicName", "serviceName")
        self._port = self._advertise(topic, Imu)
        self._bias_port = self._advertise(spec.spec.find("biasTopicName") or topic + "/bias", Imu)
        self._ctx.serve(spec.spec.find("serviceName") or topic + "/calibrate", Empty, self._calibrate, self._namespace)
        self._restart()

    def _calibrate(self, request: Any) -> EmptyResponse:
        """Answer the calibration service: the drift of rates and of the yaw angle restarts at 0."""
        self._rate_error.drift[:], self._yaw_error.drift[:] = 0.0, 0.0
        return EmptyResponse()

    def _state(self) -> Tuple[Any, Any]:
        state = self._physics.link_state(self._link)
        return normalise_quaternion(multiply(state.orientation, self._mounting)), state.linear_velocity

    def _restart(self) -> None:
        self._orientation, self._velocity = self._state()

    def _measure(self, now_ns: int, elapsed: float) -> None:
        orientation, velocity = self._state()
        gravity = self._physics.settings.gravity
        turn = multiply(conjugate(self._orientation), orientation)
        rates = self._rate_error.measure([rate / elapsed for rate in _rotation_vector(turn)], elapsed)
        along = [(new - old) / elapsed - pull for new, old, pull in zip(velocity, self._velocity, gravity)]
        accelerations = self._acceleration_error.measure(rotate_inverse(orientation, along), elapsed)
        self._orientation, self._velocity = orientation, velocity
        yaw = float(self._yaw_error.measure([0.0], elapsed)[0])
        if not (self._port.wanted() or self._bias_port.wanted()):
            return
        strength = math.sqrt(sum(pull * pull for pull in gravity))
        bias = self._acceleration_error.bias
        tilt = (0.5 * bias[1] / strength, -0.5 * bias[0] / strength) if strength > 0.0 else (0.0, 0.0)
        error = normalise_quaternion(multiply((0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw)),
                                              (float(tilt[0]), float(tilt[1]), 0.0, 1.0)))
        stamp = self._ctx.moment(now_ns)
        message = self._message(stamp, multiply(error, orientation), rates, accelerations)
        noise = self._acceleration_error.noise
        level = [(value / strength) ** 2 if strength > 0.0 else -1.0 for value in noise[:2]]
        message.orientation_covariance = _diagonal(level[0], level[1], float(self._yaw_error.noise[0]) ** 2)
        message.angular_velocity_covariance = _diagonal(*(float(value) ** 2 for value in self._rate_error.noise))
        message.linear_acceleration_covariance = _diagonal(*(float(value) ** 2 for value in noise))
        self._port.publish(message)
        if self._bias_port.wanted():
            self._bias_port.publish(self._message(stamp, error, self._rate_error.bias, bias))

    def _message(self, stamp: Any, orientation: Any, rates: Any, accelerations: Any) -> Imu:
        message = Imu()
        message.header.stamp, message.header.frame_id = stamp, self._frame
        quaternion, angular, linear = message.orientation, message.angular_velocity, message.linear_acceleration
        quaternion.x, quaternion.y, quaternion.z, quaternion.w = map(float, orientation)
        angular.x, angular.y, angular.z = map(float, rates)
        linear.x, linear.y, linear.z = map(float, accelerations)
        return message


def _diagonal(x: float, y: float, z: float) -> Any:
    return [x, 0.0, 0.0, 0.0, y, 0.0, 0.0, 0.0, z]


def _rotation_vector(turn: Any) -> Tuple[float, float, float]:
    """Return axis times angle [rad] of a quaternion, by the shorter way."""
    x, y, z, w = turn if turn[3] >= 0.0 else tuple(-value for value in turn)
    length = math.sqrt(x * x + y * y + z * z)
    scale = 2.0 if length < 1e-12 else 2.0 * math.atan2(length, w) / length
    return x * scale, y * scale, z * scale

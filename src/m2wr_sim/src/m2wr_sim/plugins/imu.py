# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_imu.so: orientation, angular velocity, acceleration without gravity of a link, as sensor_msgs/Imu."""
from __future__ import annotations

from typing import Any, Optional, Sequence

from m2wr_sim.geometry import multiply, normalise_quaternion, quaternion_from_rpy, rotate_inverse
from m2wr_sim.messages import Empty, EmptyResponse, Imu
from m2wr_sim.plugins.base import NEVER, Plugin, PluginContext, PluginReader
from m2wr_sim.runtime.schedule import GapSchedule


class BodyImu(Plugin):
    """The IMU that is a model plugin; it measures only while there are subscribers.

    The acceleration is the change of the link's velocity since the last message, divided by the time between the two.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        body = spec.text("bodyName")
        self._link = ctx.link(body)
        named = spec.text("topicName", "/default_imu")
        topic = "" if spec.spec.find("topicName") == "" else named     # an empty element disables the topic
        service = spec.text("serviceName", "/default_imu")
        self._frame = spec.text("frameName", body)
        spec.ignore("xyzOffset")                     # an Imu message has no position
        self._offset = quaternion_from_rpy(*spec.vector("rpyOffset"))
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        self._schedule = GapSchedule(spec.number("updateRate", 0.0), ctx.now_ns)
        self._rng = ctx.rng("noise")
        self._velocity = self._physics.link_state(self._link).linear_velocity
        namespace = spec.spec.find("robotNamespace") or ""
        self._port: Any = None
        if topic:
            self._port = ctx.advertise(topic, Imu, namespace=namespace)
            ctx.serve(service, Empty, self._calibrate, namespace)

    @staticmethod
    def _calibrate(request: Any) -> EmptyResponse:
        """Answer the calibration service; a simulated IMU needs no calibration."""
        return EmptyResponse()

    def _wanted(self) -> bool:
        return self._port is not None and self._port.wanted()

    def next_before(self, now_ns: int) -> Optional[int]:
        return self._schedule.next_due(now_ns, self._ctx.step_ns) if self._wanted() else NEVER

    def before_step(self, now_ns: int) -> None:
        elapsed = self._schedule.elapsed(now_ns) * 1e-9
        if not self._wanted() or not self._schedule.due(now_ns):
            return
        state = self._physics.link_state(self._link)
        acceleration = tuple((a - b) / elapsed for a, b in zip(state.linear_velocity, self._velocity))
        self._velocity = state.linear_velocity
        orientation = normalise_quaternion(multiply(self._offset, state.orientation))
        noise = self._sigma * self._rng.standard_normal(6) if self._sigma else (0.0,) * 6
        rates = rotate_inverse(orientation, tuple(a + float(b) for a, b in zip(state.angular_velocity, noise[:3])))
        acceleration = rotate_inverse(orientation, tuple(a + float(b) for a, b in zip(acceleration, noise[3:])))
        self._port.publish(imu_message(self._ctx.moment(now_ns), self._frame, orientation, rates, acceleration,
                                       self._sigma * self._sigma))

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        self._velocity = self._physics.link_state(self._link).linear_velocity
        if rewound:
            self._rng = self._ctx.rng("noise")


def imu_message(stamp: Any, frame: str, orientation: Sequence[float], rates: Sequence[float],
                acceleration: Sequence[float], variance: float) -> Imu:
    """Return a sensor_msgs/Imu with one variance on all diagonals, as Gazebo's plugins fill it.

    Parameters
    ----------
    stamp : time stamp of a message
    frame : str
    orientation : (4,) float
        Quaternion x y z w of the IMU in the world frame.
    rates : (3,) float
        Angular velocity [rad/s] in the axes of the IMU.
    acceleration : (3,) float
        Linear acceleration [m/s^2] in the axes of the IMU.
    variance : float
        Of each component.
    """
    message = Imu()
    message.header.stamp, message.header.frame_id = stamp, frame
    quaternion, angular, linear = message.orientation, message.angular_velocity, message.linear_acceleration
    quaternion.x, quaternion.y, quaternion.z, quaternion.w = orientation
    angular.x, angular.y, angular.z = rates
    linear.x, linear.y, linear.z = acceleration
    covariance = [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance]
    message.orientation_covariance = message.angular_velocity_covariance = covariance
    message.linear_acceleration_covariance = covariance
    return message

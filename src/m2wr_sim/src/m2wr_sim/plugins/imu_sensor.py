# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_imu_sensor.so: an IMU sensor, whose acceleration includes gravity, as sensor_msgs/Imu."""
from __future__ import annotations

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import multiply, quaternion_from_rpy
from m2wr_sim.messages import Imu
from m2wr_sim.plugins.base import LazySensor, PluginContext, PluginReader
from m2wr_sim.plugins.imu import imu_message
from m2wr_sim.runtime.schedule import GapSchedule, SensorSchedule
from m2wr_sim.sensors.imu import ImuSensor

_WORLD = (0.0, 0.0, 0.0, 1.0)


class SensorImu(LazySensor):
    """Measures only while there are subscribers; the first message follows one period after the first one connects.

    As in Gazebo there are two rates. The sensor's rate sets when it measures, ``updateRateHZ`` which readings are sent.
    """

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        if ctx.sensor is None or ctx.sensor.kind != "imu":
            raise PluginError("%s: an imu_sensor plugin must be in a <sensor type=\"imu\">" % spec.spec.where)
        self._ctx, self._physics = ctx, ctx.physics
        self._frame = spec.text("frameName")
        namespace = "/" + (spec.spec.find("robotNamespace") or ctx.model_name).strip("/")
        topic = namespace.rstrip("/") + "/" + spec.text("topicName", "imu_data").lstrip("/")
        self._sigma = spec.number("gaussianNoise", 0.0, minimum=0.0)
        spec.ignore("bodyName", "xyzOffset")         # an Imu message has no position
        self._offset = quaternion_from_rpy(*spec.vector("rpyOffset"))
        self._sensed = SensorSchedule(ctx.sensor.update_rate)
        self._sent = GapSchedule(spec.number("updateRateHZ", 1.0), ctx.now_ns)
        relative = spec.flag("initialOrientationAsReference", False)
        start = multiply(self._physics.link_pose(ctx.sensor_link)[1], ctx.sensor.pose[1])
        self._rng = ctx.rng("message noise")
        try:
            self._imu = ImuSensor(ctx.sensor.pose, ctx.sensor.imu_noise, ctx.rng("noise"),
                                  start if relative else _WORLD)
        except ValueError as error:
            raise PluginError("%s: sensor %s: %s" % (spec.spec.where, ctx.sensor.name, error)) from error
        self._port = ctx.advertise(topic, Imu)

    def wanted(self) -> bool:
        return self._port.wanted()

    def wake(self, now_ns: int) -> None:
        self._imu.start(self._physics.link_state(self._ctx.sensor_link), now_ns)
        self._sensed.restart()
        self._sensed.due(now_ns)                        # starts a period
        self._sent.restart(now_ns)

    def next_reading(self, now_ns: int) -> int:
        return self._sensed.next_due(now_ns, self._ctx.step_ns)

    def after_step(self, now_ns: int) -> None:
        if not self.awake or not self._sensed.due(now_ns):
            return
        state = self._physics.link_state(self._ctx.sensor_link)
        orientation, rates, acceleration = self._imu.read(state, now_ns, self._physics.settings.gravity)
        if not self._sent.due(now_ns):
            return
        orientation = multiply(self._offset, orientation)
        if self._sigma:
            noise = (self._sigma * self._rng.standard_normal(10)).tolist()
            orientation = tuple(a + b for a, b in zip(orientation, noise[0:4]))
            acceleration = tuple(a + b for a, b in zip(acceleration, noise[4:7]))
            rates = tuple(a + b for a, b in zip(rates, noise[7:10]))
        self._port.publish(imu_message(self._ctx.moment(now_ns), self._frame, orientation, rates, acceleration,
                                       self._sigma * self._sigma))

    def reset(self, now_ns: int, rewound: bool) -> None:
        self.awake = False                              # restarts from the present state in the next step
        if rewound:
            self._imu.reset(self._ctx.rng("noise"))
            self._rng = self._ctx.rng("message noise")

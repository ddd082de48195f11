# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_kobuki.so: the base of TurtleBot2, with its drive, odometry, gyro, cliff sensors and bumpers."""
from __future__ import annotations

import math
from typing import Any, Dict, List, Optional, Set, Tuple

from m2wr_sim.errors import PluginError
from m2wr_sim.geometry import Vector, quaternion_from_rpy, yaw_of
from m2wr_sim.kobuki_messages import BumperEvent, CliffEvent, MotorPower, SensorState, WheelDropEvent
from m2wr_sim.messages import EmptyMessage, Imu, JointState, Odometry
from m2wr_sim.plugins.base import Plugin, PluginContext, PluginReader, driven_joint
from m2wr_sim.plugins.kobuki_sensors import CLIFF_BITS, SIDES, CliffSensors, Contacts
from m2wr_sim.plugins.velocity_command import VelocityCommand
from m2wr_sim.runtime.schedule import StrictSchedule
from m2wr_sim.sensors.imu import ImuSensor

_RATE = 50.0            # Hz, of the base and of its sensors; Gazebo's plugin publishes in every step
_TICKS = 11724.41658029856  # encoder ticks for each metre of a wheel's rim: 2578.33 for each rotation of 70 mm
_UNUSED = 1e6           # variance of what the base does not measure
_ODOMETRY_COVARIANCE = [0.0] * 36
_ODOMETRY_COVARIANCE[::7] = [0.1, 0.1, _UNUSED, _UNUSED, _UNUSED, 0.05]
_IMU_COVARIANCE = [_UNUSED, 0.0, 0.0, 0.0, _UNUSED, 0.0, 0.0, 0.0, 0.05]


class Kobuki(Plugin):
    """Emulates the Kobuki base: tags, topics, and the odometry, whose heading comes from the gyro."""

    def configure(self, spec: PluginReader, ctx: PluginContext) -> None:
        self._ctx, self._physics = ctx, ctx.physics
        self._namespace = spec.spec.find("robotNamespace") or ctx.model_name
        self._names = [spec.text(side + "_wheel_joint_name") for side in ("left", "right")]
        self._joints = [driven_joint(ctx, spec, name) for name in self._names]
        self._separation = spec.length("wheel_separation")
        self._radius = 0.5 * spec.length("wheel_diameter")
        self._torque = spec.number("torque", minimum=0.0)
        timeout = spec.number("velocity_command_timeout", minimum=0.0)
        self._schedule = StrictSchedule(spec.number("update_rate", 0.0, minimum=0.0) or _RATE, ctx.now_ns)
        self._publish_tf = spec.flag("publish_tf", False)
        self._set_up_sensors(spec)
        prefix = self._prefix()
        self._command = VelocityCommand(ctx, prefix + "/commands/velocity", self._namespace,
                                        max(1, int(round(timeout * 1e9))))
        ctx.subscribe(prefix + "/commands/motor_power", MotorPower, self._switch, self._namespace)
        ctx.subscribe(prefix + "/commands/reset_odometry", EmptyMessage, lambda _: self._restart_odometry(),
                      self._namespace)
        self._ports: Dict[str, Any] = {name: ctx.advertise(topic, kind, 1, self._namespace) for name, topic, kind in (
            ("joints", "joint_states", JointState), ("odometry", "odom", Odometry),
            ("imu", prefix + "/sensors/imu_data", Imu), ("core", prefix + "/sensors/core", SensorState),
            ("cliff", prefix + "/events/cliff", CliffEvent), ("bumper", prefix + "/events/bumper", BumperEvent),
            ("drop", prefix + "/events/wheel_drop", WheelDropEvent))}
        self._frames = [ctx.frame(name, self._namespace) for name in ("odom", "base_footprint", "base_link")]
        self._powered, self._speeds, self._last_ns = True, (0.0, 0.0), ctx.now_ns
        self._angles: List[float] = [0.0, 0.0]
        self._pressed: Set[int] = set()
        self._dropped: Set[int] = set()
        self._restart_odometry()
        self._restart(ctx.now_ns)

    def _prefix(self) -> str:
        """Return the first part of the base's own topics, which a parameter may set."""
        name = "/".join(part for part in ("", self._namespace.strip("/"), "base_prefix") if part or not part)
        given = self._ctx.parameter("/" + name.strip("/"))
        return given.strip("/") if isinstance(given, str) and given.strip("/") else "mobile_base"

    def _set_up_sensors(self, spec: PluginReader) -> None:
        ctx = self._ctx
        gyro, self._gyro_link, _ = ctx.find_sensor(spec.text("imu_name"), "imu")
        try:
            self._imu = ImuSensor(gyro.pose, gyro.imu_noise, ctx.rng("imu"))
            self._cliffs = CliffSensors(ctx, [spec.text("cliff_sensor_%s_name" % side)
                                              for side in ("left", "center", "right")],
                                        spec.number("cliff_detection_threshold", minimum=0.0))
        except ValueError as error:
            raise PluginError("%s: %s" % (spec.spec.where, error)) from error
        self._contacts = Contacts(ctx, spec.text("bumper_name"),
                                  [spec.text("wheel_drop_%s_sensor_name" % side) for side in ("left", "right")])

    # ---- commands ---------------------------------------------------------------------------------------------------

    def _switch(self, message: Any) -> None:
        if message.state not in (MotorPower.ON, MotorPower.OFF):
            self._ctx.log.warning("%s: motor_power with state %s ignored; expected %d (off) or %d (on)",
                                  self._ctx.model_name, message.state, MotorPower.OFF, MotorPower.ON)
            return
        self._powered = message.state == MotorPower.ON
        self._ctx.log.info("%s: motors %s", self._ctx.model_name, "on" if self._powered else "off")

    def _wanted(self, now_ns: int) -> Tuple[float, float]:
        """Return the rates of both wheels [rad/s]."""
        linear, _, angular = self._command.at(now_ns) if self._powered else (0.0, 0.0, 0.0)
        turn = 0.5 * self._separation * angular
        return (linear - turn) / self._radius, (linear + turn) / self._radius

    def next_before(self, now_ns: int) -> Optional[int]:
        self._command.look(now_ns)
        step_ns = self._ctx.step_ns
        if self._wanted(now_ns + step_ns) != self._speeds:
            return now_ns + step_ns             # a command acts in the next step
        return self._schedule.next_due(now_ns, step_ns)

    def before_step(self, now_ns: int) -> None:
        self._drive(now_ns)
        if not self._schedule.due(now_ns):
            return
        stamp, elapsed = self._ctx.moment(now_ns), (now_ns - self._last_ns) * 1e-9
        self._last_ns = now_ns
        state = self._physics.link_state(self._gyro_link)
        reading = self._imu.read(state, now_ns, self._physics.settings.gravity)
        angles = [self._physics.joint_angle(joint) for joint in self._joints]
        self._integrate(angles, reading[1][2], elapsed)
        self._send_joints(stamp, angles)
        self._send_odometry(stamp)
        self._send_imu(stamp, *reading)
        self._send_state(stamp, now_ns)

    def _drive(self, now_ns: int) -> None:
        speeds = self._wanted(now_ns)
        if speeds != self._speeds:
            self._speeds = speeds
            for joint, speed in zip(self._joints, speeds):
                self._physics.set_joint_motor(joint, speed, self._torque)

    # ---- odometry ---------------------------------------------------------------------------------------------------

    def _restart_odometry(self) -> None:
        self._x = self._y = self._heading = self._forward = self._turning = 0.0

    def _integrate(self, angles: List[float], rate: float, elapsed: float) -> None:
        """Add the way of the wheels along the heading, which the gyro measures."""
        if elapsed <= 0.0:
            return
        left, right = (self._radius * (now - before) for now, before in zip(angles, self._angles))
        self._angles, way = angles, 0.5 * (left + right)
        middle = self._heading + 0.5 * rate * elapsed
        self._x, self._y = self._x + way * math.cos(middle), self._y + way * math.sin(middle)
        self._heading += rate * elapsed
        self._forward, self._turning = way / elapsed, rate

    def _send_joints(self, stamp: Any, angles: List[float]) -> None:
        if not self._ports["joints"].wanted():
            return
        message = JointState(name=list(self._names), position=angles, effort=[0.0, 0.0],
                             velocity=[self._physics.joint_rate(joint) for joint in self._joints])
        message.header.stamp, message.header.frame_id = stamp, self._frames[2]
        self._ports["joints"].publish(message)

    def _send_odometry(self, stamp: Any) -> None:
        position, orientation = (self._x, self._y, 0.0), quaternion_from_rpy(0.0, 0.0, self._heading)
        if self._publish_tf:
            self._ctx.send_transform(stamp, self._frames[0], self._frames[1], position, orientation)
        if not self._ports["odometry"].wanted():
            return
        message = Odometry(child_frame_id=self._frames[1])
        message.header.stamp, message.header.frame_id = stamp, self._frames[0]
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = position[:2]
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        message.pose.covariance = _ODOMETRY_COVARIANCE
        twist.linear.x, twist.angular.z = self._forward, self._turning
        self._ports["odometry"].publish(message)

    def _send_imu(self, stamp: Any, orientation: Any, rates: Vector, acceleration: Vector) -> None:
        if not self._ports["imu"].wanted():
            return
        message = Imu(orientation_covariance=_IMU_COVARIANCE, angular_velocity_covariance=_IMU_COVARIANCE)
        message.header.stamp, message.header.frame_id = stamp, self._frames[2]
        turn, rate, push = message.orientation, message.angular_velocity, message.linear_acceleration
        turn.x, turn.y, turn.z, turn.w = orientation
        rate.x, rate.y, rate.z = rates
        push.x, push.y, push.z = acceleration
        self._ports["imu"].publish(message)

    # ---- sensors of the base ----------------------------------------------------------------------------------------

    def _send_state(self, stamp: Any, now_ns: int) -> None:
        """Publish events and the state of the sensors, as far as there are subscribers."""
        ports, core = self._ports, self._ports["core"].wanted()
        if core or ports["cliff"].wanted():
            for sensor, cliff, bottom in self._cliffs.changes():
                ports["cliff"].publish(CliffEvent(sensor, CliffEvent.CLIFF if cliff else CliffEvent.FLOOR, bottom))
        if core or ports["bumper"].wanted() or ports["drop"].wanted():
            pose = self._ctx.model_state()
            pressed, dropped = self._contacts.read(pose.position[2], yaw_of(pose.orientation))
            self._send_changes("bumper", BumperEvent, self._pressed, pressed)
            self._send_changes("drop", WheelDropEvent, self._dropped, dropped)
            self._pressed, self._dropped = pressed, dropped
        else:
            self._contacts.sleep()
        if not core:
            return
        ticks = [int(angle * self._radius * _TICKS) & 0xffff for angle in self._angles]
        message = SensorState(time_stamp=now_ns // 10**6 & 0xffff, left_encoder=ticks[0], right_encoder=ticks[1])
        message.header.stamp, message.header.frame_id = stamp, self._frames[2]
        message.bumper = sum(bit for side, bit in zip(SIDES, CLIFF_BITS) if side in self._pressed)
        message.cliff = self._cliffs.bits()
        message.wheel_drop = sum(bit for side, bit in ((0, SensorState.WHEEL_DROP_LEFT),
                                                       (1, SensorState.WHEEL_DROP_RIGHT)) if side in self._dropped)
        ports["core"].publish(message)

    def _send_changes(self, port: str, kind: Any, before: Set[int], now: Set[int]) -> None:
        """Publish an event for each sensor that has changed: its number, and 1 if it is active now."""
        for number in sorted(before ^ now):
            self._ports[port].publish(kind(number, int(number in now)))

    # ---- life -------------------------------------------------------------------------------------------------------

    def _restart(self, now_ns: int) -> None:
        self._last_ns = now_ns
        self._angles = [self._physics.joint_angle(joint) for joint in self._joints]
        self._imu.start(self._physics.link_state(self._gyro_link), now_ns)
        self._pressed, self._dropped = set(), set()
        self._cliffs.reset()
        for joint, speed in zip(self._joints, self._speeds):
            self._physics.set_joint_motor(joint, speed, self._torque)

    def reset(self, now_ns: int, rewound: bool) -> None:
        self._schedule.restart(now_ns)
        self._command.reset(now_ns)
        self._powered, self._speeds = True, (0.0, 0.0)
        if rewound:
            self._imu.reset(self._ctx.rng("imu"))
            self._restart_odometry()
        self._restart(now_ns)

    def close(self) -> None:
        self._contacts.sleep()

# SPDX-License-Identifier: BSD-3-Clause
"""four_wheel_steering_controller/FourWheelSteeringController: four driven and four steered wheels."""
from __future__ import annotations

import math
from typing import Any, List, NamedTuple, Tuple

from m2wr_sim.control_messages import FourWheelSteering as FourWheelSteeringMessage
from m2wr_sim.control_messages import FourWheelSteeringStamped
from m2wr_sim.errors import PluginError
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.ros_control.controllers.base import Controller, ControllerNode, Due, read_joints
from m2wr_sim.ros_control.controllers.odometry import OdometryPublisher, PlanarOdometry, TwistCommand
from m2wr_sim.ros_control.hardware import POSITION, VELOCITY, JointHandle, RobotHardware

_SLOWEST = 1e-3         # m/s: below, the wheels do not turn, as in ros_controllers
_NAMES = ("front_wheel", "rear_wheel", "front_steering", "rear_steering")


class Geometry(NamedTuple):
    """Lengths of the robot [m].

    ``track`` is the distance of the steering axes of one axle, ``offset`` that of a wheel from its steering axis,
    ``base`` that of the axles.
    """

    track: float
    offset: float
    base: float
    radius: float

    def steering_of(self, front: float, rear: float) -> Tuple[float, float, float, float]:
        """Return the angles of front left, front right, rear left and rear right, from those of the axles [rad].

        Parameters
        ----------
        front : float
            Angle of the front axle [rad].
        rear : float
            Angle of the rear axle [rad].
        """
        front, rear = math.tan(front), math.tan(rear)
        change = 0.5 * self.track * (front - rear)
        if abs(self.base - abs(change)) <= 1e-3:
            return 0.0, 0.0, 0.0, 0.0
        left, right = self.base / (self.base - change), self.base / (self.base + change)
        return math.atan(front * left), math.atan(front * right), math.atan(rear * left), math.atan(rear * right)

    def speeds_of(self, speed: float, front: float, rear: float) -> Tuple[float, float, float, float]:
        """Return the rates of the four wheels [rad/s], for a speed along the body [m/s] and the angles of the axles.

        Parameters
        ----------
        speed : float
            [m/s]
        front : float
            Angle of the front axle [rad].
        rear : float
            Angle of the rear axle [rad].
        """
        if abs(speed) <= _SLOWEST:
            return 0.0, 0.0, 0.0, 0.0
        tan_front, tan_rear = math.tan(front), math.tan(rear)
        rate, sign = speed * (tan_front - tan_rear) / self.base, math.copysign(1.0, speed)
        found = []
        for tangent in (tan_front, tan_rear):
            for side in (-1.0, 1.0):            # left, right
                at_axis = math.hypot(speed + side * 0.5 * rate * self.track, speed * tangent)
                found.append((sign * at_axis + side * rate * self.offset) / self.radius)
        return found[0], found[1], found[2], found[3]


class FourWheelSteering(Controller):
    """Drives and steers all four wheels.

    Commands come as geometry_msgs/Twist on ``cmd_vel``: the rear wheels steer against the front wheels; or as
    four_wheel_steering_msgs/FourWheelSteering on ``cmd_four_wheel_steering``, with the angles of both axles.  The newer
    one counts.
    """

    interface = VELOCITY

    def configure(self, node: ControllerNode, hardware: RobotHardware) -> None:
        pairs = {name: node.names(name) for name in _NAMES}
        for name, pair in pairs.items():
            if len(pair) != 2:
                node.fail(name, "two joints, the left one first")
        self._wheels = [joint for name in _NAMES[:2] for joint in read_joints(node, hardware, VELOCITY, pairs[name])]
        self._steering = [joint for name in _NAMES[2:] for joint in read_joints(node, hardware, POSITION, pairs[name])]
        self.joints = [*self._wheels, *self._steering]
        self._geometry = _geometry(node, pairs)
        self._odometry = PlanarOdometry(1)
        self._publisher, self._command = OdometryPublisher(node), TwistCommand(node)
        self._node, self._timeout_ns = node, int(node.number("cmd_vel_timeout", 0.5, least=0.0) * 1e9)
        self._due = Due(node.number("publish_rate", 50.0))
        self._port = node.advertise("odom_steer", FourWheelSteeringStamped, 100)
        node.subscribe("cmd_four_wheel_steering", FourWheelSteeringMessage, self._store)
        self._restart()

    def _restart(self) -> None:
        self._direct: Tuple[float, float, float] = (0.0, 0.0, 0.0)      # speed [m/s], front and rear angle [rad]
        self._direct_ns, self._new = -1, False
        self._speed = (0.0, 0.0, 0.0)

    def _store(self, message: Any) -> None:
        values = message.speed, message.front_steering_angle, message.rear_steering_angle
        if not self._command.running:
            self._node.log.error("%s: Can't accept new commands. Controller is not running.", self._node.namespace)
        elif not all(abs(value) <= FASTEST for value in values):
            self._node.log.warning("%s: Received NaN in four wheel steering command. Ignoring. Read speed, front and "
                                   "rear angle %s; expected finite numbers.", self._node.namespace, values)
        else:
            quarter = 0.5 * math.pi
            self._direct = (values[0], *(max(-quarter, min(quarter, angle)) for angle in values[1:]))   # type: ignore
            self._new = True

    def starting(self, now_ns: int) -> None:
        for joint in self.joints:
            joint.command = 0.0
        self._restart()
        self._odometry.restart()
        self._publisher.restart(now_ns)
        self._due.restart(now_ns)
        self._command.restart()
        self._command.running = True

    def update(self, now_ns: int, dt: float) -> None:
        front, rear = axle_angle(*self._steering[:2]), axle_angle(*self._steering[2:])
        forward, left, rate = measured_twist([joint.velocity for joint in self._wheels], front, rear, self._geometry)
        heading = self._odometry.yaw + 0.5 * rate * dt
        self._odometry.x += (forward * math.cos(heading) - left * math.sin(heading)) * dt
        self._odometry.y += (forward * math.sin(heading) + left * math.cos(heading)) * dt
        self._odometry.yaw += rate * dt
        self._odometry.linear, self._odometry.sideways, self._odometry.angular = forward, left, rate
        self._publisher.publish(now_ns, self._odometry)
        self._publish(now_ns, math.copysign(math.hypot(forward, left), forward), front, rear)
        self._drive(now_ns, dt)

    def _publish(self, now_ns: int, speed: float, front: float, rear: float) -> None:
        """Publish speed and angles of the axles; their rates are those since the last message."""
        if not self._due.due(now_ns):
            return
        period = self._due.period_ns * 1e-9
        rates = [(now - before) / period for now, before in zip((speed, front, rear), self._speed)]
        self._speed = speed, front, rear
        if self._port.wanted():
            message = FourWheelSteeringStamped()
            message.header.stamp = self._node.moment(now_ns)
            data = message.data
            data.speed, data.front_steering_angle, data.rear_steering_angle = speed, front, rear
            data.acceleration, data.front_steering_angle_velocity, data.rear_steering_angle_velocity = rates
            self._port.publish(message)

    def _drive(self, now_ns: int, dt: float) -> None:
        if self._new:
            self._direct_ns, self._new = now_ns, False
        self._command.take(now_ns)
        direct = self._direct_ns >= 0 and self._direct_ns >= self._command.since_ns
        if direct:
            wanted = self._direct if now_ns - self._direct_ns <= self._timeout_ns else (0.0, 0.0, 0.0)
            speed = self._command.limited((wanted[0], 0.0), dt)[0]
            front, rear = wanted[1:]
        else:
            speed, rate = self._command.update(now_ns, dt)
            front, rear = self._angles(speed, rate)
        for joint, value in zip(self._steering, self._geometry.steering_of(front, rear)):
            joint.command = value
        for joint, value in zip(self._wheels, self._geometry.speeds_of(speed, front, rear)):
            joint.command = value

    def _angles(self, speed: float, rate: float) -> Tuple[float, float]:
        """Return the angles of both axles for a speed [m/s] and a rate [rad/s]; none without a speed."""
        if abs(speed) <= _SLOWEST:
            return 0.0, 0.0
        if abs(2.0 * speed) <= abs(rate * self._geometry.track):        # the centre of the turn is between the wheels
            rate = math.copysign(2.0 * abs(speed) / self._geometry.track * 0.99, rate) if self._geometry.track else 0.0
        front = math.atan(0.5 * rate * self._geometry.base / speed)
        return front, -front

    def stopping(self, now_ns: int) -> None:
        self._command.running = False
        for joint in self.joints:
            joint.command = 0.0


def _geometry(node: ControllerNode, pairs: Any) -> Geometry:
    """Return the lengths from the parameters ``track``, ``wheel_base``, ``wheel_radius``, or from the description."""
    base_link, description = str(node.value("base_frame_id", "base_link")), node.description

    def between(first: str, second: str) -> float:
        return math.dist(description.place(first, base_link), description.place(second, base_link))

    (left, right), rear, steering = pairs["front_wheel"], pairs["rear_wheel"][0], pairs["front_steering"][0]
    track = between(left, right) if node.value("track") is None else node.number("track")
    base = between(left, rear) if node.value("wheel_base") is None else node.number("wheel_base")
    radius = description.wheel_radius(left) if node.value("wheel_radius") is None else node.number("wheel_radius")
    offset = between(steering, left)
    if not min(track, base, radius, track - 2.0 * offset) > 0.0:
        raise PluginError("%s: read a track of %g m, a wheel base of %g m, a radius of %g m and wheels %g m from "
                          "their steering axes; expected lengths above 0, and the steering axes inside the track"
                          % (node.namespace, track, base, radius, offset))
    return Geometry(track - 2.0 * offset, offset, base, radius)


def axle_angle(left: JointHandle, right: JointHandle) -> float:
    """Return the angle of the wheel in the middle of an axle: the mean of the cotangents of both wheels [rad].

    Parameters
    ----------
    left : JointHandle
    right : JointHandle
    """
    if abs(left.position) <= 1e-3 and abs(right.position) <= 1e-3:
        return 0.0
    first, second = math.tan(left.position), math.tan(right.position)
    return math.atan(2.0 * first * second / (first + second)) if abs(first + second) > 1e-9 else 0.0


def measured_twist(rates: List[float], front: float, rear: float, size: Geometry) -> Tuple[float, float, float]:
    """Return forward and left speed [m/s] and yaw rate [rad/s] in the middle of the robot, from its wheels' rates.

    Parameters
    ----------
    rates : list of float
        Front left, front right, rear left, rear right [rad/s].
    front, rear : float
        Angles of the axles [rad].
    size : Geometry

    Notes
    -----
    As four_wheel_steering_controller computes it: the speed of each axle is the root mean square of its wheels.
    """
    turn = (math.tan(front) - math.tan(rear)) / size.base
    speeds, curves = [], []
    for angle, (left, right) in ((front, rates[:2]), (rear, rates[2:])):
        curve = math.cos(angle) * turn          # 1/m, of the way of the axle's middle
        sides = [rate / (1.0 - side * size.offset * curve / math.sqrt(
            1.0 - side * size.track * curve * math.cos(angle) + (0.5 * size.track * curve) ** 2))
            for side, rate in ((1.0, left), (-1.0, right))]
        mean = math.sqrt((sides[0] ** 2 + sides[1] ** 2) / (2.0 + 0.5 * (size.track * curve) ** 2))
        speeds.append(size.radius * math.copysign(mean, sides[0] + sides[1]))
        curves.append(curve)
    return (0.5 * (speeds[0] * math.cos(front) + speeds[1] * math.cos(rear)),
            0.5 * (speeds[0] * math.sin(front) + speeds[1] * math.sin(rear)),
            0.5 * (speeds[0] * curves[0] + speeds[1] * curves[1]))

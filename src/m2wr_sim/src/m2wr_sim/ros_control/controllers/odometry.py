# SPDX-License-Identifier: BSD-3-Clause
"""Wheel odometry and the commands of wheeled controllers: what diff drive and steering controllers share."""
from __future__ import annotations

import math
from collections import deque
from typing import Any, Deque, List, Optional, Tuple

from m2wr_sim.control_messages import Odometry, Twist, TwistStamped
from m2wr_sim.geometry import quaternion_from_rpy
from m2wr_sim.physics.engine import FASTEST
from m2wr_sim.ros_control.controllers.base import ControllerNode, Due, covariance
from m2wr_sim.ros_control.speed_limiter import SpeedLimiter

_STRAIGHT = 1e-6        # rad in a cycle: below, a move is integrated as straight (Runge-Kutta, second order)
_LOOK_NS = 100000000    # of simulated time between two counts of the publishers of commands
_SHORTEST = 1e-4        # s: the twist is not updated for shorter cycles


class PlanarOdometry:
    """Pose by integration of travelled distance and turn, and the twist as a rolling mean.

    Parameters
    ----------
    window : int
        Number of control cycles of the mean.

    Attributes
    ----------
    x, y : float
        Position [m] in the odometry frame.
    yaw : float
        [rad]
    linear, sideways, angular : float
        Twist [m/s, m/s, rad/s] in the robot's frame; only robots that steer all wheels move sideways.
    """

    def __init__(self, window: int) -> None:
        self.x = self.y = self.yaw = 0.0
        self._recent: Deque[Tuple[float, float]] = deque(maxlen=window)
        self.restart()

    def restart(self) -> None:
        """Discard the past twist; the pose stays."""
        self.linear = self.sideways = self.angular = self._linear_sum = self._angular_sum = 0.0
        self._recent.clear()

    def move(self, distance: float, turn: float, dt: float) -> None:
        """Add a movement.

        Parameters
        ----------
        distance : float
            Length of the arc [m].
        turn : float
            Change of the yaw [rad].
        dt : float
            Time that it took [s].
        """
        before, self.yaw = self.yaw, self.yaw + turn
        if abs(turn) < _STRAIGHT:
            middle = before + 0.5 * turn
            self.x += distance * math.cos(middle)
            self.y += distance * math.sin(middle)
        else:
            radius = distance / turn
            self.x += radius * (math.sin(self.yaw) - math.sin(before))
            self.y -= radius * (math.cos(self.yaw) - math.cos(before))
        if dt < _SHORTEST:
            return
        if len(self._recent) == self._recent.maxlen:
            linear, angular = self._recent[0]
            self._linear_sum -= linear
            self._angular_sum -= angular
        new = distance / dt, turn / dt
        self._recent.append(new)
        self._linear_sum += new[0]
        self._angular_sum += new[1]
        count = len(self._recent)
        self.linear, self.angular = self._linear_sum / count, self._angular_sum / count


class OdometryPublisher:
    """Publishes ``odom`` and its transform.

    Parameters
    ----------
    node : ControllerNode
        With the parameters ``publish_rate``, ``base_frame_id``, ``odom_frame_id``, ``enable_odom_tf``,
        ``pose_covariance_diagonal`` and ``twist_covariance_diagonal``.
    """

    def __init__(self, node: ControllerNode) -> None:
        self._node = node
        rate = node.number("publish_rate", 50.0)
        if not rate > 0.0:
            node.fail("publish_rate", "a rate above 0 Hz")
        self._due = Due(rate)
        self._frames = str(node.value("odom_frame_id", "odom")), str(node.value("base_frame_id", "base_link"))
        self._transform = node.flag("enable_odom_tf", True)
        self._port = node.advertise("odom", Odometry, 100)
        self._message = Odometry(child_frame_id=self._frames[1])
        self._message.header.frame_id = self._frames[0]
        self._message.pose.covariance = covariance(node, "pose_covariance_diagonal")
        self._message.twist.covariance = covariance(node, "twist_covariance_diagonal")

    def restart(self, now_ns: int) -> None:
        """Count the publishing period from now on."""
        self._due.restart(now_ns)

    def publish(self, now_ns: int, odometry: PlanarOdometry) -> None:
        """Publish, if it is due.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        odometry : PlanarOdometry
        """
        if not self._due.due(now_ns):
            return
        stamp, orientation = self._node.moment(now_ns), quaternion_from_rpy(0.0, 0.0, odometry.yaw)
        if self._transform:
            self._node.send_transform(stamp, self._frames[0], self._frames[1], (odometry.x, odometry.y, 0.0),
                                      orientation)
        if not self._port.wanted():
            return
        message = self._message
        message.header.stamp = stamp
        pose, twist = message.pose.pose, message.twist.twist
        pose.position.x, pose.position.y = odometry.x, odometry.y
        pose.orientation.x, pose.orientation.y, pose.orientation.z, pose.orientation.w = orientation
        twist.linear.x, twist.linear.y, twist.angular.z = odometry.linear, odometry.sideways, odometry.angular
        self._port.publish(message)


class TwistCommand:
    """The newest velocity command on ``cmd_vel``, until it is older than ``cmd_vel_timeout``, and limited.

    Parameters
    ----------
    node : ControllerNode
    """

    def __init__(self, node: ControllerNode) -> None:
        self._node = node
        self._timeout_ns = int(node.number("cmd_vel_timeout", 0.5, least=0.0) * 1e9)
        self.running = False
        self._limiters = read_limiter(node, "linear/x"), read_limiter(node, "angular/z")
        self._subscription = node.subscribe("cmd_vel", Twist, self._store)
        self._several = node.flag("allow_multiple_cmd_vel_publishers", True)
        self._looked_ns, self._braked = -_LOOK_NS, False
        self._output: Any = None
        if node.flag("publish_cmd", False):
            self._output = node.advertise("cmd_vel_out", TwistStamped, 100)
        self.restart()

    def restart(self) -> None:
        """Discard the command and the speeds that were commanded."""
        self._wanted, self.since_ns = (0.0, 0.0), -10 ** 18     # of simulated time at which it came [ns]
        self._new: Optional[Tuple[float, float]] = None
        self.last = self._before_last = (0.0, 0.0)

    def _store(self, message: Any) -> None:
        values = message.linear.x, message.angular.z
        if not self.running:
            self._node.log.error("%s: Can't accept new commands. Controller is not running.", self._node.namespace)
        elif not all(abs(value) <= FASTEST for value in values):
            self._node.log.warning("%s: Received NaN in velocity command. Ignoring. Read linear.x = %s, angular.z = "
                                   "%s; expected finite numbers of at most %g m/s and rad/s.", self._node.namespace,
                                   *values, FASTEST)
        else:
            self._new = values

    def take(self, now_ns: int) -> None:
        """Let the newest command count from now on."""
        if self._new is not None:
            self._wanted, self.since_ns, self._new = self._new, now_ns, None

    def update(self, now_ns: int, dt: float) -> Tuple[float, float]:
        """Return the limited command: linear [m/s] and angular [rad/s].

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        dt : float
            Time since the last call [s].
        """
        self.take(now_ns)
        if now_ns - self.since_ns > self._timeout_ns or self._ambiguous(now_ns):
            self._wanted = (0.0, 0.0)
        if self._wanted == self.last == self._before_last and self._output is None:
            return self._wanted
        self.limited(self._wanted, dt)
        if self._output is not None and self._output.wanted():
            message = TwistStamped()
            message.header.stamp = self._node.moment(now_ns)
            message.twist.linear.x, message.twist.angular.z = self.last
            self._output.publish(message)
        return self.last

    def limited(self, wanted: Tuple[float, float], dt: float) -> Tuple[float, float]:
        """Return linear and angular speed within the limits, and keep them as the last ones.

        Parameters
        ----------
        wanted : tuple of float
            Linear and angular speed [m/s, rad/s].
        dt : float
            Time since the last call [s].
        """
        linear, angular = (limiter.limit(value, last, before, dt) for limiter, value, last, before in zip(
            self._limiters, wanted, self.last, self._before_last))
        self._before_last, self.last = self.last, (linear, angular)
        return self.last

    def _ambiguous(self, now_ns: int) -> bool:
        """Return whether more nodes publish commands than are allowed; looked at every 0.1 s."""
        if self._several:
            return False
        if not 0 <= now_ns - self._looked_ns < _LOOK_NS:
            self._looked_ns = now_ns
            count = self._subscription.publishers()
            if count > 1 and not self._braked:
                self._node.log.error("%s: Detected %d publishers. Only 1 publisher is allowed. Going to brake.",
                                     self._node.namespace, count)
            self._braked = count > 1
        return self._braked


def read_limiter(node: ControllerNode, axis: str) -> SpeedLimiter:
    """Return the limits of one axis, ``linear/x`` or ``angular/z``.

    Parameters
    ----------
    node : ControllerNode
    axis : str

    Raises
    ------
    PluginError
        If a limit is switched on and has no value, or its values are exchanged.
    """
    found: List[Tuple[float, float]] = []
    for word in ("velocity", "acceleration", "jerk"):
        if not node.flag("%s/has_%s_limits" % (axis, word), False):
            found.append((-math.inf, math.inf))
            continue
        most = node.number("%s/max_%s" % (axis, word))
        least = node.number("%s/min_%s" % (axis, word), -most)
        if least > most:
            node.fail("%s/min_%s" % (axis, word), "at most max_%s, %g" % (word, most))
        found.append((least, most))
    return SpeedLimiter(*found)

# SPDX-License-Identifier: BSD-3-Clause
"""``carrier``: one robot that maps the ground, hears the base by radio, and carries parcels."""
from __future__ import annotations

import math
import threading
from typing import Any, List, Optional, Sequence, Tuple

import rospy
from geometry_msgs.msg import PointStamped, Twist
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, String
from std_srvs.srv import Trigger

from m2wr_delivery.carrier import Carrier, Sense
from m2wr_delivery.position import take_fix
from m2wr_delivery.scenario import Settings, starts_of
from m2wr_elevation.dead_reckoning import heading
from m2wr_elevation.kernel_warm_up import compile_kernels
from m2wr_elevation.ros.elevation_node import ElevationNode
from m2wr_node.ros.starting import start_node

TELL = 5.0                  # s between two messages about one cause
MOST_MESSAGES = 200         # of the radio that wait


class CarrierNode(ElevationNode):
    """The robot in whose namespace the node is."""

    def __init__(self) -> None:
        name = rospy.get_namespace().strip("/")
        settings = Settings(**dict(rospy.get_param("/delivery/settings")))
        starts, elevation = starts_of(settings.robots), settings.map
        if name not in starts:
            raise ValueError("the namespace is /{}; expected one of {}".format(name, ", ".join(starts)))
        x, y, _ = starts[name]
        super().__init__(elevation, follow=False, start=(x, y))
        self._carrier = Carrier(name, (x, y), settings.capacity, elevation, 0.5 * settings.size, settings.charger)
        self._lock = threading.Lock()
        self._battery: Optional[float] = None
        self._loaded = False
        self._inbox: List[str] = []
        self._fix: Optional[Tuple[float, float]] = None
        self._commands = rospy.Publisher("wanted_vel", Twist, queue_size=1)
        self._radio = rospy.Publisher("radio/out", String, queue_size=20)
        self._heard = [rospy.Subscriber("battery", BatteryState, self._on_battery, queue_size=1),
                       rospy.Subscriber("loaded", Bool, self._on_loaded, queue_size=1),
                       rospy.Subscriber("radio/position", PointStamped, self._on_fix, queue_size=1),
                       rospy.Subscriber("radio/in", String, self._on_radio, queue_size=50)]

    def wanted(self) -> bool:
        """Return whether the run has begun: before it, the robot is let down."""
        return self._battery is not None

    def others(self, stamp: Any) -> Sequence[Tuple[float, float]]:
        """Return where other robots say they are [m]."""
        return self._carrier.others(stamp.to_sec())

    def mapped(self, stamp: Any) -> None:
        """Decide what to do."""
        with self._lock:
            inbox, self._inbox = self._inbox, []
            fix, self._fix = self._fix, None
            battery, loaded = self._battery or 0.0, self._loaded
        if fix is not None and take_fix(self, fix):
            rospy.logwarn("the robot has slid: its map begins again")
        x, y, _ = self.reckoning.position.tolist()
        rotation = self.reckoning.rotation
        tilt = math.acos(max(-1.0, min(1.0, float(rotation[2, 2]))))
        action = self._carrier.step(Sense(stamp.to_sec(), x, y, heading(rotation), tilt, battery, loaded, inbox,
                                          self.map.layers, fix))
        for text in self._carrier.rejected:
            rospy.logwarn_throttle(TELL, "radio message is refused: %s", text)
        self._carrier.rejected.clear()
        command = Twist()
        command.linear.x, command.angular.z = action.linear, action.angular
        self._commands.publish(command)
        for text in action.outbox:
            self._radio.publish(text)
        if action.request:
            try:
                answer = rospy.ServiceProxy(action.request, Trigger)()
            except rospy.ServiceException as error:
                rospy.logwarn("%s: %s", action.request, error)
            else:
                if not answer.success:
                    rospy.logwarn("%s: %s", action.request, answer.message)

    def _on_battery(self, message: BatteryState) -> None:
        if math.isfinite(message.percentage):
            self._battery = message.percentage

    def _on_loaded(self, message: Bool) -> None:
        self._loaded = bool(message.data)

    def _on_fix(self, message: PointStamped) -> None:
        if math.isfinite(message.point.x) and math.isfinite(message.point.y):
            with self._lock:
                self._fix = (message.point.x, message.point.y)

    def _on_radio(self, message: String) -> None:
        with self._lock:
            self._inbox = self._inbox[-MOST_MESSAGES + 1:] + [message.data]


def main() -> int:
    """Run the node; return the exit code."""
    start_node("carrier")
    try:
        compile_kernels()
        node = CarrierNode()
    except (KeyError, TypeError, ValueError) as error:
        rospy.logfatal("parameters: %s", error)
        return 1
    node.run()
    return 0

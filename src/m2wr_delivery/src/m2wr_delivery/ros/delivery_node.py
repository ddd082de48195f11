# SPDX-License-Identifier: BSD-3-Clause
"""``delivery``: makes a field from a seed, is base, radio and judge of a run, and ends it with a report."""
from __future__ import annotations

import math
import os
import threading
from dataclasses import fields
from functools import partial
from typing import Any, Dict, List, Optional, Set

import rospy
from geometry_msgs.msg import PointStamped, Twist
from sensor_msgs.msg import BatteryState
from std_msgs.msg import Bool, String
from std_srvs.srv import Empty, Trigger, TriggerResponse
from visualization_msgs.msg import MarkerArray

from gazebo_msgs.msg import ModelState, ModelStates
from m2wr_campaign.ros.ground import values_of
from m2wr_campaign.rough.drive import heading_of, tilt_of
from m2wr_delivery import figure, report
from m2wr_delivery.referee import Referee, Truth
from m2wr_delivery.ros.field import PARCEL, markers, pose_of, spawn
from m2wr_delivery.scenario import Scenario, Settings, make_scenario
from m2wr_delivery.study.run import SETTLE
from m2wr_elevation.study.mapping import PERIOD
from m2wr_node.ros.shutdown import until_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_node.user_folder import from_user

READY = 180.0               # s of wall time for the robots' nodes to start
BACK = 0.5                  # s: further back than messages overtake one another
STALE = 1.0                 # s of simulated time after which a command is no longer followed
ABOVE = 0.3                 # m above a robot's origin: a parcel that it carries
MOST_MESSAGES = 100         # radio messages of a robot in one step


class _Robot:
    """Topics and services of one robot."""

    def __init__(self, name: str, node: "DeliveryNode") -> None:
        self.command, self.commanded = Twist(), -math.inf
        self.outbox: List[str] = []
        self.commands = rospy.Publisher("/{}/cmd_vel".format(name), Twist, queue_size=1)
        self.battery = rospy.Publisher("/{}/battery".format(name), BatteryState, queue_size=1)
        self.loaded = rospy.Publisher("/{}/loaded".format(name), Bool, queue_size=1)
        self.fix = rospy.Publisher("/{}/radio/position".format(name), PointStamped, queue_size=1)
        self.radio = rospy.Publisher("/{}/radio/in".format(name), String, queue_size=50)
        self.wanted = rospy.Subscriber("/{}/wanted_vel".format(name), Twist, self._on_command, queue_size=1)
        self.sent = rospy.Subscriber("/{}/radio/out".format(name), String, self._on_radio, queue_size=50)
        for request in ("pick_up", "put_down"):
            rospy.Service("/{}/{}".format(name, request), Trigger, partial(node.handle, request, name))

    def _on_command(self, message: Twist) -> None:
        if math.isfinite(message.linear.x) and math.isfinite(message.angular.z):
            self.command, self.commanded = message, rospy.get_time()

    def _on_radio(self, message: String) -> None:
        if len(self.outbox) < MOST_MESSAGES:
            self.outbox.append(message.data)

    def messages(self) -> List[str]:
        """Return the radio messages since the last call."""
        found, self.outbox = self.outbox, []
        return found


class DeliveryNode:
    """The run; all parameters are private ones of the node."""

    def __init__(self) -> None:
        given = rospy.get_param("~settings", {})
        unknown = sorted(set(given) - {one.name for one in fields(Settings)})
        if unknown:
            raise ValueError("there is no setting {}".format(", ".join(unknown)))
        self._scenario: Scenario = make_scenario(int(rospy.get_param("~seed", 0)), Settings(**given))
        self._output = from_user(str(rospy.get_param("~output", "delivery")))
        folder = os.path.dirname(self._output)
        if not os.access(folder, os.W_OK):
            raise ValueError("{}: no report can be written there; expected a folder that may be written to".format(
                folder))
        self._referee = Referee(self._scenario)
        self._changed, self._lock = threading.Condition(), threading.Lock()
        self._states: Optional[ModelStates] = None
        self._robots: Dict[str, _Robot] = {}
        self._lifted: Set[str] = set()
        self._shown = 0

    def run(self) -> int:
        """Return the exit code: 0 if every parcel was delivered to which a way leads."""
        spawn(self._scenario, str(rospy.get_param("/robot_description")))
        self._robots = {name: _Robot(name, self) for name in self._scenario.starts}
        moves = rospy.Publisher("/gazebo/set_model_state", ModelState, queue_size=20)
        places = rospy.Publisher("~places", MarkerArray, queue_size=1, latch=True)
        places.publish(markers(self._scenario))
        rospy.Subscriber("/gazebo/model_states", ModelStates, self._on_states, queue_size=1)
        self._wait_for_robots()
        rospy.ServiceProxy("/gazebo/unpause_physics", Empty)()
        began: Optional[float] = None
        ended, next_time = "", 0.0
        while not rospy.is_shutdown() and not ended:
            with self._changed:
                self._changed.wait(0.5)
            now = rospy.get_time()
            if self._states is None or now <= 0.0:
                continue
            began = now if began is None else began
            if now < self._referee.time - BACK:
                ended = "simulated time has gone back"
                break
            if now < max(began + SETTLE, next_time):
                continue
            next_time = now + PERIOD - 1e-6
            with until_shutdown():
                self._step(now, moves)
            ended = self._referee.finished()
        return self._report(ended or "the node was shut down")

    def handle(self, request: str, name: str, asked: Any) -> TriggerResponse:
        """Load or unload a robot.

        Parameters
        ----------
        request : str
            pick_up or put_down.
        name : str
            Of the robot.
        asked : TriggerRequest
            It has no members.

        Returns
        -------
        TriggerResponse
        """
        with self._lock:
            problem = getattr(self._referee, request)(name)
        return TriggerResponse(not problem, problem)

    def _on_states(self, message: ModelStates) -> None:
        with self._changed:
            self._states = message
            self._changed.notify()

    def _wait_for_robots(self) -> None:
        """Wait until each robot has a node that commands it."""
        waited, pause, missing = 0.0, 0.2, list(self._robots)
        while not rospy.is_shutdown() and waited < READY:
            missing = [name for name, robot in self._robots.items() if not robot.wanted.get_num_connections()]
            if not missing:
                return
            threading.Event().wait(pause)
            waited += pause
        if not rospy.is_shutdown():
            rospy.logwarn("no node commands %s; expected a publisher of wanted_vel", ", ".join(missing))

    def _truth(self, states: ModelStates) -> Dict[str, Truth]:
        found = {}
        for name, pose in zip(states.name, states.pose):
            if name in self._robots:
                true = values_of(pose)
                found[name] = Truth(*true[0], heading_of(true), tilt_of(true))
        return found

    def _step(self, now: float, moves: rospy.Publisher) -> None:
        states = self._states
        assert states is not None
        truth, referee = self._truth(states), self._referee
        with self._lock:
            senses = referee.step(now, truth, {name: robot.messages() for name, robot in self._robots.items()})
            cargos = [(cargo.parcel.name, cargo.carried, cargo.robot, cargo.place) for cargo in referee.cargo.values()]
        for name, robot in self._robots.items():
            live = referee.powered(name) and now - robot.commanded < STALE
            robot.commands.publish(robot.command if live else Twist())
            sense = senses[name]
            robot.battery.publish(BatteryState(percentage=sense.battery, present=True))
            robot.loaded.publish(sense.loaded)
            if sense.fix is not None:
                fix = PointStamped()
                fix.header.stamp, fix.header.frame_id = rospy.Time.from_sec(now), "world"
                fix.point.x, fix.point.y = sense.fix
                robot.fix.publish(fix)
            for text in sense.inbox:
                robot.radio.publish(text)
        for parcel, carried, name, place in cargos:
            if carried and name in truth:
                at = truth[name]
                moves.publish(ModelState(parcel, pose_of(at.x, at.y, at.z + ABOVE, at.yaw), Twist(), "world"))
                self._lifted.add(parcel)
            elif parcel in self._lifted:
                high = self._scenario.height_at(place) + 0.5 * PARCEL
                moves.publish(ModelState(parcel, pose_of(*place, high), Twist(), "world"))
                self._lifted.discard(parcel)
        self._tell()

    def _tell(self) -> None:
        """Log what happened."""
        for event in self._referee.events[self._shown:]:
            rospy.loginfo("%.0f s: %s", *event)
        self._shown = len(self._referee.events)
        for text in self._referee.rejected:
            rospy.logwarn_throttle(5.0, text)
        self._referee.rejected.clear()

    def _report(self, ended: str) -> int:
        with until_shutdown():              # the report must not be lost by a shutdown
            for robot in self._robots.values():
                robot.commands.publish(Twist())
        if math.isnan(self._referee.began):
            rospy.loginfo("the run ended before it began: %s", ended)
            return 1
        result = report.result_of(self._scenario, self._referee, ended)
        print(report.text_of(result), end="", flush=True)
        report.write(self._output + ".json", result)
        figure.save(self._output + ".png", self._scenario, self._referee)
        rospy.loginfo("the report is in %s.json and %s.png", self._output, self._output)
        return 0 if report.succeeded(result) else 1


def main() -> int:
    """Run the node; return the exit code."""
    start_node("delivery")
    try:
        return DeliveryNode().run()
    except rospy.ROSInterruptException:
        return 1
    except (TypeError, ValueError, OSError, rospy.ServiceException) as error:
        rospy.logfatal("%s", error)
        return 1

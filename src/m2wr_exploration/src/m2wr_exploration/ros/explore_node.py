# SPDX-License-Identifier: BSD-3-Clause
"""``explore``: drives the robot to frontiers by move_base until nothing reachable is left."""
from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Dict, Tuple

import rospy
from std_msgs.msg import Bool, String
from visualization_msgs.msg import MarkerArray

from m2wr_exploration import registry
from m2wr_exploration.explorer import DONE, PARAMETERS, Decision, Explorer
from m2wr_exploration.kernel_warm_up import compile_kernels
from m2wr_exploration.ros.frontier_markers import FrontierMarkers
from m2wr_exploration.ros.goals import Goals
from m2wr_exploration.ros.map_input import TELL, MapInput
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown
from m2wr_navigation.registry import UnknownPluginError
from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap

NODE: Dict[str, Parameter] = {
    "robot_base_frame": text("base_link", "frame of the robot"),
    "costmap_topic": text("costmap", "topic of the costmap or map"),
    "costmap_updates_topic": text("costmap_updates", "topic of its changes"),
    "map_topic": text("map", "topic of the map without inflation; used with min_corner_size"),
    "visualize": flag(False, "whether ~frontiers is published"),
    "planner_frequency": Parameter(1.0, "Hz", 0.01, 100.0, "rate at which the next goal is chosen"),
    "transform_tolerance": Parameter(0.3, "s", 0.0, 60.0, "greatest age of the pose of the robot"),
    "strategy": text("explore_lite", "which frontier is next: " + ", ".join(registry.STRATEGIES)),
    "exit_on_done": flag(False, "whether the node ends when exploration has ended"),
}


class ExploreNode:
    """Decides once a period, and sends goals to the action ``move_base``."""

    def __init__(self) -> None:
        self._values, self._explorer = self._configure()
        self._transforms = Transforms()
        self._map = MapInput(self._values["costmap_topic"], self._values["costmap_updates_topic"])
        topic = self._values["map_topic"]
        self._known = MapInput(topic, topic + "_updates") if self._explorer.values["min_corner_size"] else None
        self._goals = Goals()
        self._frontiers = rospy.Publisher("~frontiers", MarkerArray, queue_size=1)
        self._state = rospy.Publisher("~state", String, queue_size=1, latch=True)
        self._lock = threading.Lock()
        self._markers, self._running, self._shown = FrontierMarkers(), True, ""
        rospy.Subscriber("explore/resume", Bool, self._on_resume, queue_size=1)
        at_shutdown(self._goals.stop)

    def _configure(self) -> Tuple[Dict[str, Any], Explorer]:
        given = dict(rospy.get_param("~", {}) or {})
        place = rospy.get_name()
        node, warnings = read(NODE, given, place)
        values, more = read(PARAMETERS, given, place)
        kind = registry.find(node["strategy"])
        own, last = read(kind.PARAMETERS, given, place)
        known = list(NODE) + list(PARAMETERS) + list(kind.PARAMETERS)
        for warning in warnings + more + last + unknown(given, known, place):
            rospy.logwarn("%s", warning)
        return node, Explorer(values, kind(own))

    def _on_resume(self, message: Bool) -> None:
        with self._lock:
            if message.data == self._running:
                return
            self._running = message.data
            if not message.data:
                self._goals.cancel_all("preempted")
        rospy.loginfo("exploration continues" if message.data
                      else "exploration is stopped; true on explore/resume continues it")

    # ---- the loop ----------------------------------------------------------------------------------------------

    def spin(self) -> int:
        """Run until the node is shut down, or exploration has ended and ``exit_on_done`` is set; return 0."""
        rate = rospy.Rate(self._values["planner_frequency"])
        while not rospy.is_shutdown():
            try:
                self._turn()
                if self._explorer.state == DONE and self._values["exit_on_done"]:
                    rospy.rostime.wallsleep(0.3)         # the last messages are on their way
                    return 0
                rate.sleep()
            except rospy.ROSTimeMovedBackwardsException:
                rospy.logwarn("time has jumped back: exploration begins again")
                self._goals.cancel_all()
                self._values, self._explorer = self._configure()
            except rospy.ROSInterruptException:
                break
        return 0

    def _missing(self, reason: str) -> None:
        rospy.logwarn_throttle(TELL, "waiting: %s" % reason)

    def _turn(self) -> None:
        costmap = self._map.snapshot()
        if costmap is None:
            return self._missing("no map on {}".format(self._map.topic))
        if not self._goals.is_there():
            return self._missing("no action server on {}".format(rospy.resolve_name("move_base")))
        try:
            pose = self._transforms.fresh_pose(costmap.frame, self._values["robot_base_frame"],
                                               max(self._values["transform_tolerance"],
                                                   1.0 / self._values["planner_frequency"]))
        except TransformError as error:
            return self._missing(str(error))
        with self._lock:
            if not self._running:
                return self._show("stopped")
        result, why = self._goals.take()
        known = None if self._known is None else self._known.snapshot()
        if known is not None and known.frame != costmap.frame:
            rospy.logwarn_throttle(TELL, "the map on %s is in %s, the costmap in %s; corners are not looked into" % (
                rospy.resolve_name(self._values["map_topic"]), known.frame, costmap.frame))
            known = None
        self._act(self._explorer.step(rospy.get_time(), costmap, pose, result, why, known=known), costmap)
        if self._explorer.view is not None and (
                self._values["visualize"] or self._frontiers.get_num_connections()):
            self._frontiers.publish(MarkerArray(self._markers.of(self._explorer)))
        return None

    def _act(self, decision: Decision, costmap: Costmap) -> None:
        for message in decision.messages:
            rospy.loginfo("%s", message)
        begun = self._shown
        self._show(decision.state if decision.state != DONE else "done: " + self._explorer.summary)
        if decision.goal is not None:
            self._goals.send(decision.goal, costmap.frame)
        elif decision.cancel:
            self._goals.cancel()
        if decision.state == DONE and self._shown != begun:
            rospy.loginfo("Exploration stopped.")       # the words of explore_lite, which scripts look for

    def _show(self, state: str) -> None:
        if state != self._shown:
            self._shown = state
            self._state.publish(String(state))


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("explore")
    try:
        node = ExploreNode()
    except UnknownPluginError as error:
        rospy.logfatal("parameter %s: %s", rospy.resolve_name("~strategy"), error)
        return 1
    compile_kernels()
    return node.spin()

# SPDX-License-Identifier: BSD-3-Clause
"""``explore_team``: several robots explore one world; maps merged, frontiers auctioned, right of way by number."""
from __future__ import annotations

import math
import os
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional

import numpy as np
import rospy
import tf2_ros
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import OccupancyGrid
from std_msgs.msg import String
from visualization_msgs.msg import MarkerArray

from m2wr_exploration import registry
from m2wr_exploration.crew import Crew
from m2wr_exploration.explorer import PARAMETERS, RETURNING, Explorer
from m2wr_exploration.kernel_warm_up import compile_kernels
from m2wr_exploration.ros.frontier_markers import FrontierMarkers
from m2wr_exploration.ros.map_input import TELL
from m2wr_exploration.ros.map_merge_node import init_pose
from m2wr_exploration.ros.placer import Placer
from m2wr_exploration.ros.team_report import TeamReport
from m2wr_exploration.ros.team_robot import TeamRobot
from m2wr_exploration.team.placing import Placing
from m2wr_exploration.team.trails import Trails
from m2wr_maps.ros.message_conversion import pose_message
from m2wr_navigation.costmap.footprint import FootprintError, checked, placed
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown
from m2wr_navigation.registry import UnknownPluginError
from m2wr_navigation.ros.grid_messages import grid_message
from m2wr_navigation.ros.transforms import Transforms
from m2wr_node.ros.shutdown import at_shutdown, until_shutdown
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

NODE: Dict[str, Parameter] = {
    "robots": Parameter(2, "", 1, 8, "number of robots"),
    "robot_name": text("robot", "name of the robots without their numbers, which begin at 1; also their namespaces"),
    "robot_base_frame": text("link_chassis", "frame of each robot, without its name"),
    "odom_frame": text("odom", "frame of the odometry of each robot, without its name"),
    "world_frame": text("world", "frame of the merged map"),
    "known_init_poses": flag(True, "whether map_merge/init_pose_x, init_pose_y and init_pose_yaw of each robot count; "
                             "false: each robot explores alone, in the frame of its own map, until it is certain where "
                             "that lies on the map of others"),
    "planner_frequency": Parameter(1.0, "Hz", 0.01, 100.0, "rate at which maps are merged and goals chosen"),
    "lost_after": Parameter(10.0, "s", 1.0, 1e6, "time without a message after which a robot takes no part"),
    "endless_range": Parameter(0.0, "m", 0.0, 1000.0, "range that the mappers get of beams without an end; between "
                               "maxUrange and maxRange, such beams clear space. 0: infinite, as measured; mappers "
                               "ignore them"),
    "real_time_factor": Parameter(-1.0, "", -1.0, 1000.0, "of the simulation, for a warning if it is too fast for this "
                                  "machine; 0: as fast as possible; -1: not known, no warning"),
    "strategy": text("tour", "which frontier is next, for a robot that is alone: " + ", ".join(registry.STRATEGIES)),
    "map": text("", "map to write at the end, without extension, relative to the working directory of roslaunch; "
                "empty: none"),
    "world": text("", "world file of the simulation, for the share that was seen; empty: it is not told"),
    "exit_on_done": flag(False, "whether the node ends when exploration has ended"),
}
RATE = 20.0                 # Hz: of commands, as of the odometry
PERIOD = 0.1                # s in which a command may still be in force
SHOWN_EVERY = 4             # commands: teammates are shown in local costmaps at 5 Hz
#: Of a robot with mapper and move_base at real time, and of each other robot for it. Measured: 2 need 1.0, 4 1.7, 8 4.5
CORES_EACH, CORES_OTHER = 0.4, 0.02


def too_fast(robots: int, factor: float, cores: int) -> str:
    """Return a warning if a machine is too slow for the nodes of the robots, or an empty string.

    Parameters
    ----------
    robots : int
    factor : float
        Simulated seconds in a second; 0: as many as possible; negative: not known.
    cores : int
        Of this machine.
    """
    needed = robots * (CORES_EACH + CORES_OTHER * (robots - 1))
    fits = cores / needed
    if factor < 0.0 or 0.0 < factor <= fits:
        return ""
    return "{} robots need about {:.1f} processor cores at real time, and there are {}: with real_time_factor {:g} " \
        "their maps may be wrong; use real_time_factor:={:g}".format(
            robots, needed, cores, factor, max(0.1, math.floor(10.0 * fits) / 10.0))


class TeamError(ValueError):
    """The team cannot be made; the message says why."""


class TeamNode:
    """Decides for all robots once a period, and gates their commands."""

    def __init__(self) -> None:
        given = dict(rospy.get_param("~", {}) or {})
        place = rospy.get_name()
        self.values, warnings = read(NODE, given, place)
        self._explorer_values, more = read(PARAMETERS, given, place)
        self._kind = registry.find(self.values["strategy"])
        self._own, last = read(self._kind.PARAMETERS, given, place)
        known = list(NODE) + list(PARAMETERS) + list(self._kind.PARAMETERS)
        for warning in warnings + more + last + unknown(given, known, place):
            rospy.logwarn("%s", warning)
        if given.get("robots", self.values["robots"]) != self.values["robots"]:
            raise TeamError("parameter ~robots is {!r}; expected a whole number from 1 to 8".format(given["robots"]))
        warning = too_fast(self.values["robots"], self.values["real_time_factor"], len(os.sched_getaffinity(0)))
        if warning:
            rospy.logwarn("%s", warning)
        self.names = ["{}{}".format(self.values["robot_name"], number + 1) for number in range(self.values["robots"])]
        try:
            self._starts = [init_pose(rospy.get_param("/{}/map_merge".format(name), {}), "/" + name)
                            if self.values["known_init_poses"] else np.zeros(3) for name in self.names]
            self._outline = checked(np.array(rospy.get_param("/{}/move_base/footprint".format(self.names[0]), []), float
                                             ).reshape(-1, 2))
        except (ValueError, FootprintError) as error:
            raise TeamError(str(error)) from error
        self._transforms, self._broadcaster = Transforms(), tf2_ros.StaticTransformBroadcaster()
        odom, base, endless = (self.values[key] for key in ("odom_frame", "robot_base_frame", "endless_range"))
        self.robots = [TeamRobot(name, self._frame(name), "{}/{}".format(name, odom), "{}/{}".format(name, base), start,
                                 self._transforms, endless) for name, start in zip(self.names, self._starts)]
        self._merged = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        self._frontiers = rospy.Publisher("~frontiers", MarkerArray, queue_size=1)
        self._state = rospy.Publisher("~state", String, queue_size=1, latch=True)
        self._markers, self._placer, self._shown, self._ticks = FrontierMarkers(), Placer(), "", 0
        self._begin()
        for number, robot in enumerate(self.robots):
            robot.others = partial(self._places, number)
            at_shutdown(robot.goals.stop)
        self._timer = rospy.Timer(rospy.Duration.from_sec(1.0 / RATE), self._on_timer, reset=True)

    def _frame(self, name: str) -> str:
        """Return the frame in which a robot plans: the common one, or that of its map while others are not known."""
        return str(self.values["world_frame"]) if self.values["known_init_poses"] else name + "/map"

    def _hang_on(self) -> None:
        """Publish where the maps of the robots lie, of those for which it is certain."""
        transforms = []
        for number, name in enumerate(self.names):
            if self.crew.placing.relative(0, number) is None:
                continue
            start = self._starts[number] if self.values["known_init_poses"] else self.crew.placing.frames[number]
            transform = TransformStamped()
            transform.header.stamp, transform.header.frame_id = rospy.Time.now(), self.values["world_frame"]
            transform.child_frame_id = name + "/map"
            pose = pose_message(start)
            transform.transform.translation.x, transform.transform.translation.y = start[0], start[1]
            transform.transform.rotation = pose.orientation
            transforms.append(transform)
        self._broadcaster.sendTransform(transforms)

    def _begin(self) -> None:
        known = self.values["known_init_poses"]
        self.crew = Crew(self.names, [Explorer(self._explorer_values, self._kind(self._own)) for _ in self.robots],
                         Placing(self.names, [np.zeros(3)] * len(self.names) if known else None))
        self._trails = Trails(len(self.names), self._outline)
        self._hang_on()
        for member in self.crew.members:
            member.fault = "it has not started"
        self._known: Dict[int, Costmap] = {}            # by robot, in the frame in which it plans
        self.report = TeamReport(self.values["map"], self.values["world"], known)

    # ---- commands ----------------------------------------------------------------------------------------------

    def _on_timer(self, _event: Any) -> None:
        with until_shutdown():
            self._drive()

    def _drive(self) -> None:
        """Send every robot the command that it may take."""
        now, there = rospy.get_time(), {}
        for number, robot in enumerate(self.robots):
            robot.locate()
            pose = robot.pose
            if pose is not None:
                self.crew.see(number, now, pose[:2])
                there[number] = pose
                if not self.crew.placing.whole:
                    self._trails.add(number, pose)
        for number in there:
            self.robots[number].pass_scans()
        wanted = {number: (0.0, 0.0) if self.crew.members[number].fault else self.robots[number].wanted(now)
                  for number in there}
        velocities = {number: self.robots[number].velocity for number in there}
        for number, command in self.crew.commands(there, velocities, wanted, self._outline, PERIOD).items():
            self.robots[number].command(command)
        self._ticks += 1
        if self._ticks % SHOWN_EVERY == 0:
            for number in there:
                self.robots[number].show_teammates([placed(self._outline, pose)
                                                    for pose in self.crew.teammates(number, there)])

    def _places(self, number: int, stamp: rospy.Time) -> List[FloatArray]:
        """Return where the teammates of a robot were at a time, as far as it is known, in the frame in which it plans.

        The time is that of a scan: in 0.2 s a robot drives out of the disc that is cut out of the scan.
        """
        poses = {other: robot.pose_at(stamp) for other, robot in enumerate(self.robots) if other != number}
        known = {other: pose for other, pose in poses.items() if pose is not None}
        return [pose[:2] for pose in self.crew.teammates(number, known)]

    # ---- decisions ---------------------------------------------------------------------------------------------

    def spin(self) -> int:
        """Run until the node is shut down, or exploration has ended and ``exit_on_done`` is set; return 0."""
        rate = rospy.Rate(self.values["planner_frequency"])
        while not rospy.is_shutdown():
            try:
                self._turn()
                if self.report.told and self.values["exit_on_done"]:
                    self._timer.shutdown()
                    rospy.rostime.wallsleep(0.3)         # the last messages are on their way
                    return 0
                rate.sleep()
            except rospy.ROSTimeMovedBackwardsException:
                rospy.logwarn("time has jumped back: exploration begins again")
                for robot in self.robots:
                    robot.goals.cancel_all()
                    robot.forget()
                self._begin()
            except rospy.ROSInterruptException:
                break
        return 0

    def _turn(self) -> None:
        now = rospy.get_time()
        self._merge(now)
        for number, robot in enumerate(self.robots):
            self._attend(number, robot, now)
        if self.report.begun is None or not self._known or self.report.told:
            return
        for number, robot in enumerate(self.robots):
            if not self.crew.members[number].fault and number in self._known:
                self._decide(number, robot, now)
        if self.crew.explored:
            self.report.explored(now)
        self._show()
        if self.crew.ended:
            self.report.tell(now, self.crew, self._known[min(self._known)])
            self._tell_state("done: " + self.crew.summary())
            rospy.loginfo("Exploration stopped.")       # the words of explore_lite, which scripts look for

    def _merge(self, now: float) -> None:
        """Merge the maps, and publish what comes of it: for all, and for each robot."""
        maps = {number: costmap for number, costmap in (
            (number, robot.map.snapshot()) for number, robot in enumerate(self.robots)) if costmap is not None}
        self._place(maps)
        maps = self._trails.cleared(maps, self.crew.placing)
        common: Optional[Costmap] = None
        for number, robot in enumerate(self.robots):
            try:
                known = self.crew.merged(number, maps, self._starts, self._frame(self.names[number])) \
                    if common is None else common
            except ValueError as error:
                rospy.logwarn_throttle(TELL, "the maps cannot be merged: %s" % error)
                return
            if known is None:
                continue
            common = known if self.values["known_init_poses"] else None         # then it is the same for all
            self._known[number] = known
            if number == 0:
                self._merged.publish(grid_message(replace(known, frame=self.values["world_frame"]), rospy.Time.now()))
            robot.show_known(self.crew.occupancy(number, now, known), known)

    def _place(self, maps: Mapping[int, Costmap]) -> None:
        """Take what is known of where maps lie on each other."""
        before = self.crew.placing
        if before.known or self._placer.busy:       # trails are only drawn for a comparison
            return
        placing, told = self._placer.turn(before, self._trails.comparable(maps, before))
        for message in told:
            rospy.loginfo("%s", message)
        if placing is not before:
            changed = placing.groups != before.groups or not np.array_equal(placing.frames, before.frames)
            self.crew.placing = placing
            if changed:
                self._hang_on()

    def _attend(self, number: int, robot: TeamRobot, now: float) -> None:
        """Notice that a robot begins, is lost, or is back."""
        member, fault = self.crew.members[number], robot.fault(now, self.values["lost_after"])
        if fault and not member.fault:
            robot.goals.cancel()
            rospy.logwarn("%s", self.crew.lose(number, now, fault))
        elif fault:
            member.fault = fault
            rospy.logwarn_throttle_identical(TELL, "waiting: {}: {}".format(member.name, fault))
        elif member.fault and robot.pose is not None:
            rospy.loginfo("%s", self.crew.welcome(number))
            self.report.begin(now, robot.pose[:2])

    def _decide(self, number: int, robot: TeamRobot, now: float) -> None:
        member, costmap, pose = self.crew.members[number], robot.costmap.snapshot(), robot.pose
        if costmap is None or pose is None:
            return
        result, why = robot.goals.take()
        self.crew.drive(number, now, member.driving and not result)
        decision = member.explorer.step(now, costmap, pose, result, why, self.crew.others(number, now),
                                        self._known[number])
        self.crew.share(number)
        for message in decision.messages:
            rospy.loginfo("%s: %s", member.name, message)
        if decision.goal is not None:
            robot.goals.send(decision.goal, costmap.frame)
            self.crew.drive(number, now, True)
        elif decision.cancel:
            robot.goals.cancel()
            self.crew.drive(number, now, False)

    # ---- what people see ---------------------------------------------------------------------------------------

    def _show(self) -> None:
        found = [marker for member in self.crew.members
                 for marker in self._markers.of(member.explorer, member.name)]
        self._frontiers.publish(MarkerArray(found))
        if not self.crew.ended:
            self._tell_state(RETURNING if self.crew.explored else "exploring")

    def _tell_state(self, state: str) -> None:
        if state != self._shown:
            self._shown = state
            self._state.publish(String(state))


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    start_node("explore_team")
    compile_kernels()
    try:
        node = TeamNode()
    except UnknownPluginError as error:
        rospy.logfatal("parameter %s: %s", rospy.resolve_name("~strategy"), error)
        return 1
    except TeamError as error:
        rospy.logfatal("%s", error)
        return 1
    return node.spin()

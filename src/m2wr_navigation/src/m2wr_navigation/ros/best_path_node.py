# SPDX-License-Identifier: BSD-3-Clause
"""``best_path``: the report's experiment with a choice of paths, and a memory of all runs."""
from __future__ import annotations

import logging
import math
import threading
from dataclasses import replace
from typing import Any, Dict, List, Optional, Tuple

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan
from std_msgs.msg import String

from m2wr_maps.saved_map_reader import MapReadingError, read_map
from m2wr_navigation.best_path.driver import BestPath
from m2wr_navigation.best_path.memory import PERIOD as STORED
from m2wr_navigation.best_path.memory import REACHED, Memory, Run, load
from m2wr_navigation.best_path.settings import CRITERIA, PARAMETERS, make_settings
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import ObstacleField, Track
from m2wr_navigation.costmap.observation import ObservationError
from m2wr_navigation.methods.method import RUNNING
from m2wr_navigation.parameters import Parameter, flag, read, text, unknown
from m2wr_navigation.registry import CONTROLLERS, UnknownPluginError, short_name
from m2wr_navigation.ros.best_path_outputs import Outputs
from m2wr_navigation.ros.explore import memory_folder
from m2wr_node.node_help import answer_help
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.user_folder import from_user
from motion_plan.pose_history import PoseHistory
from motion_plan.ros_parameters import NodeError, required_number
from motion_plan.ros_support import SCAN_TOPIC, RosoutHandler, choose_rhythm, planar_pose, run_node
from motion_plan.surroundings import axle_of

NODE: Dict[str, Parameter] = {
    "memory": text("", "folder for map and experience, with a folder for each world; empty: best_path in ~/.ros"),
    "world": text("world", "name or file of the world, for the folder"),
    "map": text("", "a map of map_saver that is known from the beginning: a YAML file"),
    "exit_on_goal": flag(False, "whether the node ends when the drive has ended", False),
    "size": Parameter(40.0, "m", 5.0, 200.0, "side of the mapped square, start and goal about its middle", False),
    "lockstep": flag(False, "whether the node runs in lockstep with the simulation", False),
}
LAUNCH_FILE = "best_path.launch"
MARGIN = 5.0                # m: between start or goal and the edge of the map
OLD = 0.4                   # s: with odometry or scans older than this the robot stops; with a turn within 0.5 s
START = 5.0                 # s in which the first messages may come without a warning
SHOWN = 1.0                 # s between two maps
EXPLORER = "Bug 2"
ENDS = {"goal_reached": REACHED, "goal_unreachable": "unreachable"}
FAREWELL = 0.3              # s of wall time for the transmission of the last messages


class BestPathNode:
    """Explores beside Bug 2 if there is no map, otherwise chooses a path and drives it; saves what was learned."""

    def __init__(self) -> None:
        self._rhythm = choose_rhythm()
        library = logging.getLogger("m2wr_navigation")
        library.addHandler(RosoutHandler())
        library.setLevel(logging.INFO)
        library.propagate = False
        given = dict(rospy.get_param("~", {}) or {})
        self._values = self._parameters(given)
        self._goal = np.array([required_number("des_pos_x", "x of the goal in metres", LAUNCH_FILE),
                               required_number("des_pos_y", "y of the goal in metres", LAUNCH_FILE)])
        start = [required_number("initial_" + axis, axis + " of the start in metres", LAUNCH_FILE) for axis in "xy"]
        self._survey = Survey(self._side(np.array(start)), 0.5 * (np.array(start) + self._goal))
        self._memory = self._remember()
        self._lock, self._closed = threading.RLock(), False
        self._history, self._pose, self._speed = PoseHistory(), (0.0, 0.0, 0.0), (0.0, 0.0)
        self._heard: Dict[str, float] = {}
        self._samples: List[Tuple[float, float, float, float]] = []
        self._driver: Optional[BestPath] = None
        self._plans, self._shown, self._ended, self._saved = 0, -math.inf, "", False
        self._bug = ""
        self._waited: Optional[float] = None        # when the first cycle was
        self._outputs = Outputs(self._survey.costs.frame, self._settings.scorer.units)
        self._commands = self._rhythm.publisher("/cmd_vel", Twist)
        self._rhythm.subscribe("/odom", Odometry, self._on_odometry)
        self._rhythm.subscribe(SCAN_TOPIC, LaserScan, self._on_scan)
        rospy.Subscriber("/bug2/state", String, self._on_bug, queue_size=10)
        at_shutdown(self._close)
        self._tell("exploring by Bug 2" if self.explores else "choosing")

    def _parameters(self, given: Dict[str, Any]) -> Dict[str, Any]:
        values, warnings = read(NODE, given, rospy.get_name())
        try:
            self._settings, found = make_settings(given, rospy.get_name())
        except UnknownPluginError as error:
            raise NodeError(str(error)) from error
        known = list(NODE) + list(PARAMETERS) + [CRITERIA] + [short_name(name) for name in CONTROLLERS]
        for warning in warnings + found + unknown(given, known, rospy.get_name()):
            rospy.logwarn("%s", warning)
        return values

    def _side(self, start: Any) -> float:
        """Return the side of the mapped square [m], large enough for start and goal."""
        side, needed = float(self._values["size"]), float(np.abs(self._goal - start).max()) + 2.0 * MARGIN
        if needed <= side:
            return side
        if needed > NODE["size"].high:
            raise NodeError("start and goal are {:.0f} m apart; expected at most {:.0f} m".format(
                needed - 2.0 * MARGIN, NODE["size"].high - 2.0 * MARGIN))
        rospy.logwarn("parameter %s: %g m is too small for start and goal; %.0f m is used",
                      rospy.resolve_name("~size"), side, needed)
        return needed

    def _remember(self) -> Memory:
        """Read the memory and the map that is given."""
        folder = memory_folder(self._values["memory"], self._values["world"])
        memory = load(folder)
        if self._values["map"]:
            try:
                found = read_map(from_user(self._values["map"]))
            except MapReadingError as error:
                raise NodeError(str(error)) from error
            self._survey.seed(found.data, found.resolution, found.origin)
        if memory.cells is not None:
            self._survey.seed(memory.cells, memory.resolution, memory.origin)
        self.explores = memory.cells is None and not self._values["map"]
        memory.rescore(self._settings.scorer, ObstacleField(self._survey.snapshot()))
        content = "no map" if memory.cells is None else "a map with %.0f m^2 known" % self._survey.known_area
        rospy.loginfo("memory %s: %s, %d runs", folder, content, len(memory.runs))
        return memory

    # ---- messages ----------------------------------------------------------------------------------------------

    def _on_odometry(self, message: Odometry) -> None:
        try:
            pose, speed = planar_pose(message)
        except ValueError as error:
            rospy.logwarn_throttle(5.0, "/odom refused: %s" % error)
            return
        with self._lock:
            stamp = message.header.stamp.to_sec()
            if self._history.is_jump(stamp, pose):
                rospy.logwarn("the robot was moved to (%.2f, %.2f)%s", pose[0], pose[1],
                              "" if self._ended else "; the drive begins again")
                self._history.clear()
                if not self._ended:
                    self._samples, self._driver = [], None
            self._pose, self._speed = pose, speed
            self._history.add(stamp, pose)
            turn = message.pose.pose.orientation
            self._survey.incline((turn.x, turn.y, turn.z, turn.w))
            self._heard["/odom"] = rospy.get_time()

    def _on_scan(self, message: LaserScan) -> None:
        with self._lock:
            stamp = message.header.stamp.to_sec()
            pose = self._history.at(stamp)
            try:
                if pose is not None and not self._saved:
                    self._survey.add(stamp, pose, message)
                self._heard[SCAN_TOPIC] = rospy.get_time()      # the robot stops if no scan can be used
            except ObservationError as error:
                rospy.logwarn_throttle(5.0, "%s refused: %s" % (SCAN_TOPIC, error))

    def _on_bug(self, message: String) -> None:
        with self._lock:
            self._bug = message.data[:100]

    # ---- the drive ---------------------------------------------------------------------------------------------

    def spin(self) -> int:
        """Run until the drive has ended; return the exit code."""
        code = self._rhythm.spin(self._turn, self._time_reset)
        if code is not None and not rospy.is_shutdown():
            rospy.rostime.wallsleep(FAREWELL)
        return code

    def _time_reset(self) -> None:
        with self._lock:
            self._history.clear()
            self._heard, self._samples, self._driver = {}, [], None
            self._ended, self._saved, self._bug = "", False, ""

    def _turn(self, now: float) -> Optional[int]:
        with self._lock:
            late = [topic for topic in ("/odom", SCAN_TOPIC) if now - self._heard.get(topic, -math.inf) > OLD]
            pose, speed = self._pose, self._speed
        if self._ended:
            return self._code()
        if late:
            self._waited = now if self._waited is None else self._waited
            if len(self._heard) < 2 and now - self._waited < START:
                return None
            rospy.logwarn_throttle(5.0, "no new message on %s for %g s: the robot stops" % (" and ".join(late), OLD))
            if not self.explores:
                self._command(0.0, 0.0)
            return None
        if now - self._shown >= SHOWN:
            self._shown = now
            self._outputs.survey(self._survey)
        axle = np.array([*axle_of(pose), pose[2]])
        outcome, reason = self._watch(now, axle) if self.explores else self._drive(now, axle, speed)
        if outcome != RUNNING:
            self._end(outcome, reason)
        return None

    def _watch(self, now: float, axle: Any) -> Tuple[str, str]:
        """Take note of where Bug 2 drives; return outcome and reason."""
        with self._lock:
            state = self._bug
            if state and (not self._samples or now > self._samples[-1][0]):
                self._samples.append((now, *axle.tolist()))
        return (ENDS[state], state) if state in ENDS else (RUNNING, "")

    def _drive(self, now: float, axle: Any, speed: Tuple[float, float]) -> Tuple[str, str]:
        """Drive on the best path; return outcome and reason."""
        with self._lock:
            if self._driver is None:
                self._driver, self._plans = BestPath(self._settings, self._survey, self._goal,
                                                     self._memory.best(axle[:2], self._goal)), 0
            driver = self._driver
        if driver.chosen is None:
            self._command(0.0, 0.0)
        decision = driver.step(now, axle, np.array([speed[0], 0.0, speed[1]]))
        self._command(decision.linear, decision.angular)
        if driver.plans != self._plans:
            self._plans = driver.plans
            self._show_choice(driver)
        return decision.outcome, decision.reason

    def _show_choice(self, driver: BestPath) -> None:
        self._outputs.choice(driver.candidates, driver.chosen)
        for rank, candidate in enumerate(driver.candidates, 1):
            if candidate.score is None:
                rospy.loginfo("%2d %-32s %s", rank, candidate.name, candidate.reason)
            else:
                rospy.loginfo("%2d %-32s score %6.2f m: %s", rank, candidate.name, candidate.total, ", ".join(
                    "%s %.2f %s" % (name, amount, self._settings.scorer.units[name])
                    for name, amount in candidate.score.amounts.items()))
        if driver.chosen is not None:
            self._tell("driving: %s" % driver.chosen.name)

    def _command(self, linear: float, angular: float) -> None:
        message = Twist()
        message.linear.x, message.angular.z = linear, angular
        with self._lock:
            if not self._closed:
                self._commands.publish(message)

    def _tell(self, words: str) -> None:
        rospy.loginfo("best_path: %s", words)
        self._outputs.state(words)

    # ---- the end -----------------------------------------------------------------------------------------------

    def _end(self, outcome: str, reason: str) -> None:
        """Stop, save, and tell how this run compares."""
        if not self.explores:
            self._command(0.0, 0.0)
        before = self._memory.best(self._begin(), self._goal)
        run = self._save(outcome, reason)
        self._outputs.survey(self._survey)
        self._ended = outcome
        if run is not None:
            self._tell("run %d, %s: %s, score %.2f m (%s)" % (
                run.number, run.how, outcome, run.total, ", ".join(
                    "%s %.2f %s" % (name, amount, self._settings.scorer.units[name])
                    for name, amount in run.amounts.items())))
            if before is not None:
                rospy.loginfo("best_path: the best run before was run %d, score %.2f m", before[0], before[1].total)
        else:
            self._tell("%s: %s" % (outcome, reason))

    def _begin(self) -> Tuple[float, float]:
        track = self._track()
        return self._pose[:2] if track is None else (float(track.poses[0, 0]), float(track.poses[0, 1]))

    def _track(self) -> Optional[Track]:
        with self._lock:
            driver, samples = self._driver, list(self._samples)
        if not self.explores:
            return None if driver is None else driver.track
        if len(samples) < 2:
            return None
        rows = np.array(samples)
        return Track(rows[:, 0], rows[:, 1:], self._goal)

    def _save(self, outcome: str, reason: str) -> Optional[Run]:
        """Write map and experience, once; return the run, None if the robot has not moved."""
        with self._lock:
            if self._saved:
                return None
            self._saved = True
            driver, track, survey = self._driver, self._track(), self._survey
        run = None
        if track is not None:
            chosen = None if driver is None else driver.chosen
            plan = chosen.plan if chosen is not None and driver is not None and driver.plans == 1 else np.zeros((0, 3))
            name = EXPLORER if chosen is None else chosen.name
            run = Run(name, outcome, reason, track.thinned(STORED), plan, {}, 0.0)
            score = self._settings.scorer.score(run.track, ObstacleField(survey.snapshot()))
            run = replace(run, amounts=score.amounts, total=score.total)
            run = self._memory.add(run)
        self._memory.cells, self._memory.resolution = survey.occupancy(), survey.costs.resolution
        self._memory.origin = float(survey.costs.origin[0]), float(survey.costs.origin[1])
        try:
            self._memory.save_map()
            self._memory.save_runs()
        except (OSError, ValueError) as error:
            rospy.logerr("map and experience are not saved in %s: %s", self._memory.folder, error)
        return run

    def _code(self) -> Optional[int]:
        if not self._values["exit_on_goal"]:
            return None
        return 0 if self._ended == REACHED else 1

    def _close(self) -> None:
        """Stop the robot; keep what an interrupted run has taught."""
        with self._lock:
            if not self.explores and self._driver is not None and not self._ended:
                self._command(0.0, 0.0)
            self._closed = True         # no command of the loop follows this one
        if not self._saved and self._survey.version > 0 and self._track() is not None:
            self._save("interrupted", "the node was ended")


def main() -> None:
    """Run the node."""
    answer_help("best_path", "Choose the best path to the goal and drive it; keep map and experience.", {
        **{name: "%s (%r)" % (known.meaning, known.default) for name, known in {**NODE, **PARAMETERS}.items()},
        "criteria/NAME/weight": "metres of path that are as bad as one unit of a criterion's costs"})
    run_node("best_path", BestPathNode)

# SPDX-License-Identifier: BSD-3-Clause
"""What one robot of a team sends and gets: topics in its namespace, and the action ``move_base`` there."""
from __future__ import annotations

import threading
from collections import deque
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from actionlib_msgs.msg import GoalStatusArray
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

from m2wr_exploration.frontiers import costs_of_occupancy
from m2wr_exploration.ros.goals import Goals
from m2wr_exploration.ros.map_input import TELL, MapInput
from m2wr_exploration.team.teammates import without
from m2wr_maps.se2 import compose
from m2wr_navigation.costmap.cost_layout import FREE, LETHAL
from m2wr_navigation.costmap.costmap import Costmap
from m2wr_navigation.costmap.footprint_kernels import fill_polygon
from m2wr_navigation.ros.grid_messages import grid_message
from m2wr_navigation.ros.transforms import TransformError, Transforms
from m2wr_node.ros.shutdown import until_shutdown
from m2wr_node.ros.transform_buffer import fault_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array

WAITING = 20                # scans that wait for their transform
PATIENCE = 1.0              # s after which such a scan is dropped
MOST_BEAMS = 100000
SIDE = 6.4                  # m: of the map of teammates around a robot; its local costmap has 6 m
NEAR = 4.6                  # m: half of the diagonal of that map
CELL = 0.05                 # m
OLD = 0.5                   # s after which a command of move_base does not count


class TeamRobot:
    """One robot.

    Parameters
    ----------
    name : str
        Its namespace, and the prefix of its frames.
    world, odom, base : str
        Frames: the common one, and those of the robot.
    start : (3,) float64
        Where the frame of its map lies in the common one [m, m, rad].
    transforms : Transforms
    endless : float, optional
        Range that mappers get of beams without an end [m]; 0: infinite, as it is measured.
    """

    def __init__(self, name: str, world: str, odom: str, base: str, start: FloatArray, transforms: Transforms,
                 endless: float = 0.0) -> None:
        self.name, self._world, self._odom, self._base = name, world, odom, base
        self._start, self._transforms, self._endless = start, transforms, endless
        self.map = MapInput("/{}/map".format(name), "/{}/map_updates".format(name))
        costmap = "/{}/move_base/global_costmap/costmap".format(name)
        self.costmap = MapInput(costmap, costmap + "_updates")
        self.goals = Goals("/{}/move_base".format(name))
        self.pose: Optional[FloatArray] = None      # (3,) in the common frame
        self.posed = -np.inf                        # s: its stamp
        self.velocity: FloatArray = np.zeros(2)     # m/s, rad/s
        #: Returns where the others were at a time, (2,) m each.
        self.others: Callable[[rospy.Time], Sequence[FloatArray]] = lambda stamp: ()
        self._wanted: Tuple[float, Tuple[float, float]] = (-np.inf, (0.0, 0.0))
        self._stopped = True
        self._heard: Dict[str, float] = {}
        self._lock = threading.Lock()
        self._waiting: Deque[LaserScan] = deque(maxlen=WAITING)
        self._near, self._passed = True, False
        self._command = rospy.Publisher("/{}/cmd_vel".format(name), Twist, queue_size=1, tcp_nodelay=True)
        self._scan = rospy.Publisher("/{}/scan_without_robots".format(name), LaserScan, queue_size=10)
        self._known = rospy.Publisher("/{}/team_map".format(name), OccupancyGrid, queue_size=1, latch=True)
        self._teammates = rospy.Publisher("/{}/teammates".format(name), OccupancyGrid, queue_size=1, latch=True)
        self.show_teammates([])
        self._topics = ["/{}/{}".format(name, topic) for topic in ("m2wr/laser/scan", "odom", "move_base/status")]
        self._subscribers = [
            rospy.Subscriber(self._topics[0], LaserScan, self._on_scan, queue_size=WAITING, tcp_nodelay=True),
            rospy.Subscriber(self._topics[1], Odometry, self._on_odometry, queue_size=1, tcp_nodelay=True),
            rospy.Subscriber(self._topics[2], GoalStatusArray, lambda _: self._hear(self._topics[2]), queue_size=1),
            rospy.Subscriber("/{}/cmd_vel_wanted".format(name), Twist, self._on_wanted, queue_size=1,
                             tcp_nodelay=True)]

    def forget(self) -> None:
        """Forget what was heard, after a jump of time."""
        self._heard, self.pose, self.posed = {}, None, -np.inf
        self._wanted = (-np.inf, (0.0, 0.0))

    # ---- what comes --------------------------------------------------------------------------------------------

    def _hear(self, topic: str) -> None:
        self._heard[topic] = rospy.get_time()

    def _on_odometry(self, message: Odometry) -> None:
        velocity = np.array([message.twist.twist.linear.x, message.twist.twist.angular.z])
        if not np.isfinite(velocity).all():
            rospy.logwarn_throttle(TELL, "a message on %s has the velocity %s; expected finite numbers" % (
                self._topics[1], tuple(velocity.tolist())))
            return
        self.velocity = velocity
        self._hear(self._topics[1])

    def _on_wanted(self, message: Twist) -> None:
        wanted = float(message.linear.x), float(message.angular.z)
        if not np.isfinite(wanted).all():
            rospy.logwarn_throttle(TELL, "a command for %s is %s; expected finite numbers" % (self.name, wanted))
            return
        self._wanted = rospy.get_time(), wanted

    def _on_scan(self, message: LaserScan) -> None:
        fault = fault_of(message.header)
        if not fault and not 0 < len(message.ranges) <= MOST_BEAMS:
            fault = "it has {} beams; expected 1 to {}".format(len(message.ranges), MOST_BEAMS)
        if not fault and not np.isfinite([message.angle_min, message.angle_increment]).all():
            fault = "its angles are not finite"
        if fault:
            rospy.logwarn_throttle(TELL, "a scan on %s is not used: %s" % (self._topics[0], fault))
            return
        self._hear(self._topics[0])
        with self._lock:
            self._waiting.append(message)
        with until_shutdown():
            self.pass_scans()

    def fault(self, now: float, longest: float) -> str:
        """Return why the robot cannot take part, one clause; empty: it can.

        Parameters
        ----------
        now : float
            [s]
        longest : float
            Time without a message after which it does not [s].
        """
        for topic in self._topics:
            if topic not in self._heard:
                return "nothing has come on {} yet".format(topic)
            if now - self._heard[topic] > longest:
                return "nothing has come on {} for {:g} s".format(topic, longest)
        if self.pose is None or now - self.posed > longest:
            try:
                self._transforms.fresh_pose(self._world, self._base, longest)
            except TransformError as error:
                return str(error)
            return "its pose is not known yet"
        costmap = self.costmap.costmap
        if costmap is None:
            return "no map has come on {} yet".format(self.costmap.topic)
        if costmap.frame != self._world:
            return "the map on {} is in {}; expected {}".format(self.costmap.topic, costmap.frame, self._world)
        return ""

    # ---- poses -------------------------------------------------------------------------------------------------

    def _in_world(self, pose: FloatArray) -> Tuple[FloatArray, float]:
        """Return a pose in the odometry frame in the common one, and the stamp of the mapper's transform [s]."""
        try:
            place, stamp = self._transforms.stamped_pose(self._world, self._odom)
        except TransformError:          # no map yet
            place, stamp = self._start, -np.inf
        return compose(place, pose), stamp

    def locate(self) -> None:
        """Take the newest pose."""
        try:
            pose, stamp = self._transforms.stamped_pose(self._odom, self._base)
        except TransformError:
            return
        self.pose, mapped = self._in_world(pose)
        self.posed = min(stamp, mapped)

    def pose_at(self, stamp: rospy.Time) -> Optional[FloatArray]:
        """Return the pose at a time, (3,) float64 in the common frame [m, m, rad]; if it is not known, the newest.

        Parameters
        ----------
        stamp : rospy.Time
        """
        if self.pose is None:
            return None
        try:
            return self._in_world(self._transforms.pose(self._odom, self._base, stamp))[0]
        except TransformError:
            return self.pose

    def pass_scans(self) -> None:
        """Publish the scans whose transforms are known, without the beams that end on other robots."""
        with self._lock:
            while self._waiting:
                message = self._waiting[0]
                try:
                    pose = self._transforms.pose(self._odom, message.header.frame_id, message.header.stamp)
                except TransformError as error:
                    if rospy.get_time() - message.header.stamp.to_sec() < PATIENCE:
                        return
                    if self._passed:        # before, the first transform was still to come
                        rospy.logwarn_throttle(TELL, "a scan on %s is not used: %s" % (self._topics[0], error))
                    self._waiting.popleft()
                    continue
                self._waiting.popleft()
                self._passed = True
                self._scan.publish(self._without_robots(message, self._in_world(pose)[0]))

    def _without_robots(self, message: LaserScan, laser: FloatArray) -> LaserScan:
        if self._endless:
            ranges = np.array(message.ranges, np.float32)
            message.ranges = np.where(np.isposinf(ranges), np.float32(self._endless), ranges).tolist()
        near = [place for place in self.others(message.header.stamp)
                if np.hypot(*(place - laser[:2])) < message.range_max + 1.0]
        if near:
            ranges = np.array(message.ranges, np.float32)
            angles = message.angle_min + message.angle_increment * np.arange(len(ranges))
            message.ranges = without(ranges, angles, laser, np.array(near)).tolist()
        return message

    # ---- what goes ---------------------------------------------------------------------------------------------

    def wanted(self, now: float) -> Tuple[float, float]:
        """Return the command that move_base wants [m/s, rad/s]; an old one is a stop.

        Parameters
        ----------
        now : float
            [s]
        """
        stamp, command = self._wanted
        return command if now - stamp < OLD else (0.0, 0.0)

    def command(self, velocity: Tuple[float, float]) -> None:
        """Send a command; a stop is sent once.

        Parameters
        ----------
        velocity : (float, float)
            [m/s, rad/s]
        """
        stop = not any(velocity)
        if stop and self._stopped:
            return
        message = Twist()
        message.linear.x, message.angular.z = velocity
        self._command.publish(message)
        self._stopped = stop

    def show_known(self, occupancy: Int8Array, known: Costmap) -> None:
        """Publish the map on which the robot plans.

        Parameters
        ----------
        occupancy : (H, W) int8
        known : Costmap
            With its resolution, origin and frame.
        """
        self._known.publish(grid_message(Costmap(costs_of_occupancy(occupancy), known.resolution, known.origin,
                                                 known.frame), rospy.Time.now()))

    def show_teammates(self, outlines: List[Any]) -> None:
        """Publish where other robots are: obstacles for the local costmap.

        Parameters
        ----------
        outlines : list of (K, 2) float64
            In the common frame [m].
        """
        centre = np.zeros(2) if self.pose is None else self.pose[:2]
        outlines = [corners for corners in outlines if np.hypot(*(corners.mean(axis=0) - centre)) < NEAR]
        if not outlines and not self._near:
            return                      # the last message was empty, too
        self._near = bool(outlines)
        count = int(round(SIDE / CELL))
        made = Costmap.filled((count, count), CELL, np.floor(centre / CELL) * CELL - 0.5 * SIDE, FREE, self._world)
        for corners in outlines:
            fill_polygon(made.costs, made.resolution, made.origin, corners, LETHAL)
        self._teammates.publish(grid_message(made, rospy.Time.now()))

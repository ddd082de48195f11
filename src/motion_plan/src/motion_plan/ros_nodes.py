# SPDX-License-Identifier: BSD-3-Clause
"""The nodes reading_laser, go_to_point, wall_follower and obstacle_avoidance around their state machines."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional

import rospy
from geometry_msgs.msg import Twist

from m2wr_node.ros.shutdown import at_shutdown
from motion_plan.go_to_point import GoToPoint
from motion_plan.obstacle_avoidance import ObstacleAvoidance
from motion_plan.regions import READING_LASER_BOUNDS, SECTOR_NAMES
from motion_plan.ros_diagnostics import Diagnostics, Report
from motion_plan.ros_parameters import NodeError, required_number
from motion_plan.ros_support import SCAN_TOPIC, Rhythm, Senses, Switchable, choose_rhythm, run_node, wait_for_clock
from motion_plan.wall_follower import WallFollower
from motion_plan.wall_guard import WallGuard

if TYPE_CHECKING:
    from motion_plan.planar_types import Command, Point, Regions


class ReadingLaserNode:
    """Logs the five sector minima of every scan, right to left."""

    def __init__(self) -> None:
        self._senses = Senses(Rhythm(), odom=False, bounds=READING_LASER_BOUNDS, on_regions=self.clbk_laser)

    @staticmethod
    def clbk_laser(regions: Regions) -> None:
        """Log the list."""
        rospy.loginfo([regions[name] for name in SECTOR_NAMES])

    @staticmethod
    def spin() -> None:
        """Wait for the end."""
        wait_for_clock()
        rospy.spin()


class GoToPointNode:
    """Publishes the commands of `GoToPoint` while switched on by /go_to_point_switch."""

    def __init__(self) -> None:
        self.behaviour = GoToPoint(self._goal())
        self._rhythm = choose_rhythm()
        self._senses = Senses(self._rhythm, scan=False)
        self._switch = Switchable(self._rhythm, '/go_to_point_switch', self._switched)
        Diagnostics('go_to_point', self._senses, self._report, ('/odom',), lambda: self._switch.command)

    def _report(self) -> Report:
        return Report(self._switch.active, {'state': self.behaviour.state.name.lower(),
                                            'goal': '(%.2f, %.2f)' % tuple(self.behaviour.goal)}, 'switched off')

    @staticmethod
    def _goal() -> Point:
        return (required_number('des_pos_x', 'x of the goal in metres', 'behaviors.launch'),
                required_number('des_pos_y', 'y of the goal in metres', 'behaviors.launch'))

    def _switched(self, on: bool) -> None:
        """Restart with the present goal of the parameters."""
        if not on:
            return
        try:
            goal = self._goal()
            if goal != self.behaviour.goal:
                rospy.loginfo('go_to_point: the goal is now (%.2f, %.2f)', *goal)
            self.behaviour.goal = goal
        except (NodeError, OSError, rospy.ROSException) as error:
            rospy.logwarn('go_to_point: %s; keeping the goal (%.2f, %.2f)', error, *self.behaviour.goal)
        self.behaviour.restart()

    def spin(self) -> int:
        """Run the loop."""
        return self._rhythm.spin(self._turn, self._time_reset)

    def _turn(self, now: float) -> None:
        if not self._switch.active:
            return
        with self._senses.lock:
            pose, stale = self._senses.pose, self._senses.stale(now)
        if pose is None:
            rospy.logwarn_throttle(5.0, 'go_to_point: switched on, but no /odom has been received yet')
        elif stale:
            rospy.logwarn_throttle(5.0, 'go_to_point: no new message on %s for over a second: stopped' % stale)
            self._switch.publish((0.0, 0.0))
        else:
            self._switch.publish(self.behaviour.update(pose))

    def _time_reset(self) -> None:
        self._senses.forget()
        self.behaviour.restart()


class WallFollowerNode:
    """Publishes the commands of `WallFollower`, guarded by `WallGuard`, while switched on by /wall_follower_switch."""

    def __init__(self) -> None:
        self.behaviour = WallFollower()
        self._guard = WallGuard() if rospy.get_param('~guard', True) else None
        self._rhythm = choose_rhythm()
        self._senses = Senses(self._rhythm, odom=self._guard is not None, remember=self._guard is not None,
                              on_regions=self.behaviour.take_action)
        self._switch = Switchable(self._rhythm, '/wall_follower_switch', self._switched)
        Diagnostics('wall_follower', self._senses, self._report,
                    (SCAN_TOPIC,) if self._guard is None else ('/odom', SCAN_TOPIC), lambda: self._switch.command)

    def _report(self) -> Report:
        return Report(self._switch.active, {'state': self.behaviour.state.name.lower(),
                                            'guard': 'off' if self._guard is None else 'on'}, 'switched off')

    def _switched(self, on: bool) -> None:
        with self._senses.lock:
            if self._guard is not None:
                self._guard.release()

    def spin(self) -> int:
        """Run the loop."""
        return self._rhythm.spin(self._turn, self._time_reset)

    def _turn(self, now: float) -> None:
        if not self._switch.active:
            return
        with self._senses.lock:
            command = self._command(now)
        if command is not None:
            self._switch.publish(command)

    def _command(self, now: float) -> Optional[Command]:
        senses = self._senses
        if self._guard is None:
            return self.behaviour.update()
        if senses.regions is None or senses.pose is None:
            rospy.logwarn_throttle(5.0, 'wall_follower: switched on, but no %s has been received yet (the guard needs '
                                        'it)' % ('/odom' if senses.pose is None else 'laser scan'))
            return None
        stale = senses.stale(now)
        if stale:
            rospy.logwarn_throttle(5.0, 'wall_follower: no new message on %s for over a second: stopped' % stale)
            return 0.0, 0.0
        return self._guard.update(now, senses.pose, senses.surroundings, self.behaviour.update())

    def _time_reset(self) -> None:
        with self._senses.lock:
            self._senses.forget()
            if self._guard is not None:
                self._guard.release()


class ObstacleAvoidanceNode:
    """Drives without a goal and turns away from obstacles; active from the first scan on."""

    def __init__(self) -> None:
        self.behaviour = ObstacleAvoidance()
        self._publisher = rospy.Publisher('/cmd_vel', Twist, queue_size=1)
        self._senses = Senses(Rhythm(), odom=False, on_regions=self.clbk_laser)
        at_shutdown(self._stop)

    def clbk_laser(self, regions: Regions) -> None:
        """Answer a scan with a command."""
        msg = Twist()
        msg.linear.x, msg.angular.z = self.behaviour.update(None, regions)
        try:
            self._publisher.publish(msg)
        except rospy.ROSException:
            if not rospy.core.is_shutdown_requested():      # which closes the topic concurrently
                raise

    def _stop(self) -> None:
        self._publisher.publish(Twist())
        rospy.rostime.wallsleep(0.1)

    @staticmethod
    def spin() -> None:
        """Wait for the end."""
        wait_for_clock()
        rospy.spin()


def reading_laser() -> None:
    """Run the node reading_laser."""
    run_node('reading_laser', ReadingLaserNode, only_prints=True)


def go_to_point() -> None:
    """Run the node go_to_point."""
    run_node('go_to_point', GoToPointNode)


def wall_follower() -> None:
    """Run the node wall_follower."""
    run_node('wall_follower', WallFollowerNode)


def obstacle_avoidance() -> None:
    """Run the node obstacle_avoidance."""
    run_node('obstacle_avoidance', ObstacleAvoidanceNode)

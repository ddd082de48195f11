# SPDX-License-Identifier: BSD-3-Clause
"""The node tour: drives along the way points of a parameter."""
from __future__ import annotations

import time
from typing import TYPE_CHECKING, Optional

import rospy
from geometry_msgs.msg import Twist

from m2wr_node.node_help import answer_help
from m2wr_node.ros.shutdown import at_shutdown
from motion_plan.ros_parameters import NodeError, finite_number
from motion_plan.ros_support import Senses, choose_rhythm, run_node
from motion_plan.tour import Tour, TourError

if TYPE_CHECKING:
    from motion_plan.planar_types import Command

#: Wall seconds for the transmission of the last command before the node exits.
FAREWELL_SECONDS = 0.2


class TourNode:
    """Publishes the commands of `Tour` at 20 Hz, or in lockstep; ends at the last way point if ``~exit_at_end``."""

    def __init__(self) -> None:
        if not rospy.has_param('~way_points'):
            raise NodeError('parameter ~way_points is not set: expected a list of [x, y] in metres')
        try:
            self.tour = Tour(rospy.get_param('~way_points'),
                             finite_number('~speed', rospy.get_param('~speed', 0.5), 'm/s'))
        except TourError as error:
            raise NodeError('parameters ~way_points, ~speed: %s' % error) from error
        self._exit_at_end = bool(rospy.get_param('~exit_at_end', False))
        self._rhythm = choose_rhythm()
        self._publisher = self._rhythm.publisher('/cmd_vel', Twist)
        self._senses = Senses(self._rhythm, scan=False)
        self._told = False
        at_shutdown(self._stop)

    def spin(self) -> int:
        """Drive; return the exit code: 0 at the end of the tour, 1 if the robot is stuck."""
        code = self._rhythm.spin(self._turn, self._time_reset)
        if code is not None and not rospy.is_shutdown():
            time.sleep(FAREWELL_SECONDS)
        return code

    def _turn(self, now: float) -> Optional[int]:
        with self._senses.lock:
            pose, stale = self._senses.pose, self._senses.stale(now)
        if pose is None:
            rospy.logwarn_throttle(5.0, 'tour: no /odom has been received yet')
            return None
        if stale:
            rospy.logwarn_throttle(5.0, 'tour: no new message on %s for over a second: stopped' % stale)
            self._command((0.0, 0.0))
            return None
        self._command(self.tour.update(now, pose))
        if self._rhythm.lockstep:
            self._rhythm.note = 'way point %d of %d' % (self.tour.index, len(self.tour.way_points))
        if not (self.tour.finished or self.tour.stuck):
            return None
        if self.tour.finished and not self._told:
            rospy.loginfo('tour: all %d way points reached', len(self.tour.way_points))
        self._told = True
        return int(self.tour.stuck) if self._exit_at_end else None

    def _command(self, command: Command) -> None:
        message = Twist()
        message.linear.x, message.angular.z = command
        self._publisher.publish(message)

    def _stop(self) -> None:
        self._publisher.publish(Twist())

    def _time_reset(self) -> None:
        self._senses.forget()
        self.tour.restart()
        self._told = False


def tour() -> None:
    """Run the node tour."""
    answer_help('tour.py', 'Drive along way points.', {
        'way_points': 'list of [x, y] [m], required', 'speed': '[m/s] (0.5)',
        'exit_at_end': 'whether the node ends at the last way point (false)'})
    run_node('tour', TourNode)

# SPDX-License-Identifier: BSD-3-Clause
"""The node bug2: places the robot at the start, switches the two behaviours, publishes its state."""
from __future__ import annotations

import json
import math
import threading
import time
from typing import TYPE_CHECKING, Dict, Optional, Sequence

import rospy
from geometry_msgs.msg import PointStamped, PoseStamped
from nav_msgs.msg import Path
from std_msgs.msg import String
from std_srvs.srv import SetBool
from visualization_msgs.msg import MarkerArray

from gazebo_msgs.msg import ModelState
from gazebo_msgs.srv import GetWorldProperties, SetModelState
from m2wr_node.ros.shutdown import at_shutdown
from motion_plan.bug2 import STATE_DESCRIPTIONS, Bug2, State
from motion_plan.ros_bug2_markers import Bug2Markers
from motion_plan.ros_diagnostics import Diagnostics, Report
from motion_plan.ros_parameters import NodeError, optional_number, required_number
from motion_plan.ros_poses import PoseError, planar_in
from motion_plan.ros_support import SCAN_TOPIC, Senses, choose_rhythm, run_node, wait_for_clock, wait_while

if TYPE_CHECKING:
    from motion_plan.planar_types import Point, Pose
    from motion_plan.ros_support import Timing

LAUNCH_FILE = 'bug2.launch'
SWITCHES = ('/go_to_point_switch', '/wall_follower_switch')
SET_MODEL_STATE = '/gazebo/set_model_state'
GET_WORLD_PROPERTIES = '/gazebo/get_world_properties'
GOAL_TOPIC = '/move_base_simple/goal'
STATUS_PERIOD = 0.5
#: Wall seconds for the transmission of the last latched messages before the node exits.
FAREWELL_SECONDS = 0.5
#: Wall seconds between two attempts to place the robot, and for the robot to be spawned.
PLACE_PAUSE, PLACE_PATIENCE = 0.2, 2.0


class Bug2Publishers:
    """The latched topics of Bug 2's state."""

    def __init__(self, rhythm: Timing) -> None:
        self._state = rhythm.publisher('bug2/state', String, queue_size=10, latch=True)
        self._status = rhythm.publisher('bug2/status', String, queue_size=1, latch=True)
        self._hit = rhythm.publisher('bug2/hit_point', PointStamped, queue_size=10, latch=True)
        self._leave = rhythm.publisher('bug2/leave_point', PointStamped, queue_size=10, latch=True)
        self._line = rhythm.publisher('bug2/m_line', Path, queue_size=1, latch=True)
        self._markers = rhythm.publisher('bug2/markers', MarkerArray, queue_size=1, latch=True)
        self._shown = Bug2Markers()

    def begin(self) -> None:
        """Start a new run: remove the markers of the previous one."""
        self._shown.begin()

    def markers(self, bug: Bug2, frame_id: str, base_frame: str) -> None:
        """Publish all markers of Bug 2 for rviz.

        Parameters
        ----------
        bug : Bug2
            State machine of the run.
        frame_id : str
            Odometry frame.
        base_frame : str
            Frame of the robot.
        """
        self._markers.publish(self._shown.message(bug, frame_id, base_frame))

    def state(self, bug: Bug2, frame_id: str, stamp: rospy.Time) -> None:
        """Publish a new state, with the point at which it was entered.

        Parameters
        ----------
        bug : Bug2
            State machine of the run.
        frame_id : str
            Odometry frame.
        stamp : rospy.Time
            Of the message.
        """
        self._state.publish(String(data=bug.state.value))
        self._shown.note(bug)
        for publisher, point, state in ((self._hit, bug.hit_point, State.WALL_FOLLOWING),
                                        (self._leave, bug.leave_point, State.GO_TO_POINT)):
            if point is not None and bug.state is state:
                msg = PointStamped()
                msg.header.frame_id, msg.header.stamp = frame_id, stamp
                msg.point.x, msg.point.y = point
                publisher.publish(msg)

    def status(self, bug: Bug2, pose: Pose, stamp: rospy.Time) -> None:
        """Publish the state in numbers, as JSON.

        Parameters
        ----------
        bug : Bug2
            State machine of the run.
        pose : (float, float, float)
            x, y [m] and yaw [rad], odometry frame.
        stamp : rospy.Time
            Of the message.
        """
        self._status.publish(String(data=json.dumps({
            'stamp': stamp.to_sec(), 'state': bug.state.value, 'reason': bug.reason, 'leave_rule': bug.leave_rule,
            'position': [round(pose[0], 4), round(pose[1], 4)],
            'distance_to_line': round(bug.distance_to_line(pose), 4),
            'distance_to_goal': round(bug.distance_to_goal(pose), 4),
            'hit_point': bug.hit_point, 'leave_point': bug.leave_point}, sort_keys=True)))

    def m_line(self, bug: Bug2, frame_id: str, stamp: rospy.Time) -> None:
        """Publish the m-line as a path of two poses.

        Parameters
        ----------
        bug : Bug2
            State machine of the run.
        frame_id : str
            Odometry frame.
        stamp : rospy.Time
            Of the message.
        """
        path = Path()
        path.header.frame_id, path.header.stamp = frame_id, stamp
        yaw = math.atan2(bug.goal[1] - bug.line_start[1], bug.goal[0] - bug.line_start[0])
        for x, y in (bug.line_start, bug.goal):
            pose = PoseStamped()
            pose.header = path.header
            pose.pose.position.x, pose.pose.position.y = x, y
            pose.pose.orientation.z, pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
            path.poses.append(pose)
        self._line.publish(path)


class Bug2Node:
    """Reads the parameters, waits for the services, then updates `Bug2` at 20 Hz.

    A new goal, or a robot that was moved, starts a new run of `Bug2` from the robot's pose.
    """

    def __init__(self) -> None:
        start = (required_number('initial_x', 'x of the start in metres', LAUNCH_FILE),
                 required_number('initial_y', 'y of the start in metres', LAUNCH_FILE))
        goal = (required_number('des_pos_x', 'x of the goal in metres', LAUNCH_FILE),
                required_number('des_pos_y', 'y of the goal in metres', LAUNCH_FILE))
        self._initial_yaw = optional_number('initial_yaw', 0.0, 'heading at the start in radians')
        self._exit_on_goal = bool(rospy.get_param('~exit_on_goal', False))
        self._model_name = rospy.get_param('~model_name', 'm2wr')
        try:
            self.bug = Bug2(start, goal, rospy.get_param('~leave_rule', 'complete'))
        except ValueError as error:
            raise NodeError('parameters initial_x, initial_y, des_pos_x, des_pos_y, ~leave_rule: %s' % error) from error
        self._rhythm = choose_rhythm()
        self._publishers = Bug2Publishers(self._rhythm)
        self._senses = Senses(self._rhythm, remember=True)
        Diagnostics('bug2', self._senses, self._report, ('/odom', SCAN_TOPIC))
        self._switched: Optional[State] = None      # state for which the behaviours have been switched
        self._began = False
        self._start = start             # pose of the robot after a reset of the simulation
        self._asked: Optional[Point] = None     # goal that the next period takes
        self._asked_lock = threading.Lock()
        self._renew = False
        # not by the rhythm: a click belongs to no period, and waiting for tf must delay none
        rospy.Subscriber(GOAL_TOPIC, PoseStamped, self.clbk_goal, queue_size=1)
        at_shutdown(self._leave_nothing_driving)
        self._told_line: Optional[Point] = None
        self._next_status = 0.0

    def _report(self) -> Report:
        bug, pose = self.bug, self._senses.pose
        values: Dict[str, str] = {'state': bug.state.value, 'reason': bug.reason or 'none',
                                  'leave rule': bug.leave_rule, 'goal': '(%.2f, %.2f)' % tuple(bug.goal)}
        if pose is not None:
            values['distance to goal [m]'] = '%.2f' % bug.distance_to_goal(pose)
            values['distance to line [m]'] = '%.2f' % bug.distance_to_line(pose)
        return Report(self._began and not bug.finished, values, bug.state.value if self._began else 'waiting')

    def spin(self) -> int:
        """Place the robot at its start and drive it; return the exit code."""
        if not self._rhythm.lockstep:
            wait_for_clock()
        self._wait_for_services()
        self._place_robot()
        if not self._rhythm.lockstep:       # in lockstep, messages arrive with the requests
            wait_while(self._senses_nothing, self._missing_topics)
            self._begin()
        code = self._rhythm.spin(self._turn, self._time_reset)
        if code is not None and not rospy.is_shutdown():
            time.sleep(FAREWELL_SECONDS)
        return code

    def change_state(self, state: State) -> None:
        """Log the state, publish it and switch the behaviours for it."""
        rospy.loginfo('state changed: %s%s', STATE_DESCRIPTIONS[state],
                      ' (%s)' % self.bug.reason if self.bug.reason else '')
        self._publishers.state(self.bug, self._senses.frame_id, rospy.get_rostime())
        self._publishers.markers(self.bug, self._senses.frame_id, self._senses.base_frame)
        self._next_status = 0.0
        self._began = True
        self._switch_behaviours()

    def _begin(self) -> None:
        self._senses.jumped = False         # moved to the start by this node itself
        self.change_state(State.GO_TO_POINT)

    def distance_to_line(self, point: Sequence[float]) -> float:
        """Return the distance [m] of (x, y) from the line through start and goal."""
        return self.bug.distance_to_line(point)

    def _turn(self, now: float) -> Optional[int]:
        if not self._began:
            if self._senses_nothing():
                return None
            self._begin()
        code = self._decide(now) if self._take_news(now) else None
        if self._rhythm.lockstep:
            self._rhythm.note = self.bug.state.value
            if code is not None:
                self._leave_nothing_driving()       # while the zero commands are still a part of the run
        return code

    def _senses_nothing(self) -> bool:
        return self._senses.pose is None or self._senses.regions is None

    def _decide(self, now: float) -> Optional[int]:
        with self._senses.lock:
            pose, speed, regions = self._senses.pose, self._senses.speed, self._senses.regions
            if pose is None or speed is None or regions is None:
                return None
            before, stale = self.bug.state, self._senses.stale(now)
            state = self.bug.update(now, pose, regions, self._senses.surroundings, speed, self._senses.scan_age(now))
        if stale and not self.bug.finished:
            rospy.logwarn_throttle(5.0, 'bug2: no new message on %s for over a second' % stale)
        if state is not before:
            self.change_state(state)
            self._report_end(state, pose)
        elif self._switched is not state:
            self._switch_behaviours()
        self._tell(now, pose)
        if self._exit_on_goal and self.bug.finished and self._switched is state:
            return 0 if state is State.GOAL_REACHED else 1
        return None

    def _tell(self, now: float, pose: Pose) -> None:
        if self._told_line != self.bug.line_start:
            self._publishers.m_line(self.bug, self._senses.frame_id, rospy.get_rostime())
            self._publishers.markers(self.bug, self._senses.frame_id, self._senses.base_frame)
            self._told_line = self.bug.line_start
        if now >= self._next_status:
            self._next_status = now + STATUS_PERIOD
            self._publishers.status(self.bug, pose, rospy.get_rostime())
        if self.bug.finished:
            return
        line = 'distance to line: [%.2f], position: [%.2f, %.2f]' % (self.distance_to_line(pose), pose[0], pose[1])
        if self.bug.leave_rule == 'report':
            rospy.loginfo(line)
        else:
            rospy.loginfo_throttle(2.0, line)

    def _report_end(self, state: State, pose: Pose) -> None:
        goal = 'goal (%.2f, %.2f)' % self.bug.goal
        if state is State.GOAL_REACHED:
            rospy.loginfo('%s reached: the robot is at (%.2f, %.2f), %s', goal, pose[0], pose[1], self.bug.reason)
        elif state is State.GOAL_UNREACHABLE:
            rospy.logerr('%s cannot be reached: %s; the robot is at (%.2f, %.2f)', goal, self.bug.reason,
                         pose[0], pose[1])

    def _switch_behaviours(self) -> None:
        """Call the two switches in the report's order; a failed call is repeated in the next period."""
        state = self.bug.state
        # at the goal go_to_point stays on, as in the report: it stops the robot with zero commands
        wanted = {State.WALL_FOLLOWING: (False, True), State.GOAL_UNREACHABLE: (False, False)}.get(state, (True, False))
        calls = list(zip(SWITCHES, wanted))
        if self._renew:
            calls.insert(0, (SWITCHES[0], False))
        for service, value in calls:
            try:
                rospy.ServiceProxy(service, SetBool)(value)
            except (rospy.ServiceException, rospy.ROSException) as error:
                if not rospy.is_shutdown():
                    rospy.logwarn_throttle(2.0, 'bug2: service %s (%s) failed, trying again: %s'
                                           % (service, value, error))
                return
        self._switched, self._renew = state, False

    def _leave_nothing_driving(self) -> None:
        """Switch off the behaviours, which would drive without supervision."""
        if self._switched is None:
            return
        for service in SWITCHES:
            try:
                rospy.ServiceProxy(service, SetBool)(False)
            except (rospy.ServiceException, rospy.ROSException):
                continue    # it shuts down as well, and stops the robot itself

    def _wait_for_services(self) -> None:
        for service in SWITCHES + (SET_MODEL_STATE,):
            self._wait_for_service(service)

    def _wait_for_service(self, name: str) -> None:
        wait_while(lambda: not self._is_service(name), lambda: 'bug2: still waiting for the service %s' % name)

    @staticmethod
    def _is_service(name: str) -> bool:
        try:
            rospy.wait_for_service(name, timeout=0.5)
            return True
        except rospy.ROSException:
            return False

    def _model_is_there(self) -> bool:
        """Return whether the simulator has the robot's model, or does not answer."""
        try:
            return self._model_name in rospy.ServiceProxy(GET_WORLD_PROPERTIES, GetWorldProperties)().model_names
        except (rospy.ServiceException, rospy.ROSException):
            return True         # no answer: the next call will show it

    def _place_robot(self) -> None:
        """Place the robot at the start; repeated until the simulator has the model."""
        state = ModelState()
        state.model_name = self._model_name
        state.pose.position.x, state.pose.position.y = self.bug.start
        if self._initial_yaw != 0.0:    # otherwise the report's all-zero quaternion, which means no rotation
            state.pose.orientation.z = math.sin(self._initial_yaw / 2)
            state.pose.orientation.w = math.cos(self._initial_yaw / 2)
        wait_while(lambda: not self._model_is_there(),
                   lambda: 'bug2: still waiting for the model "%s" to be spawned' % self._model_name)
        quiet_until = time.monotonic() + PLACE_PATIENCE
        while not rospy.is_shutdown():
            try:
                answer = rospy.ServiceProxy(SET_MODEL_STATE, SetModelState)(state)
                if answer.success:
                    # measurements before the robot was moved are not valid any more
                    self._senses.forget(not_before=rospy.get_time())
                    return
                problem = answer.status_message
            except (rospy.ServiceException, rospy.ROSException) as error:
                problem = str(error)
            if time.monotonic() > quiet_until:
                rospy.logwarn_throttle(
                    5.0, 'bug2: %s did not place model "%s" at (%.2f, %.2f): %s; trying again'
                    % (SET_MODEL_STATE, self._model_name, self.bug.start[0], self.bug.start[1], problem))
            time.sleep(PLACE_PAUSE)

    def _missing_topics(self) -> str:
        missing = [name for name, value in (('/odom', self._senses.pose), ('/m2wr/laser/scan', self._senses.regions))
                   if value is None]
        return 'bug2: still waiting for %s' % ' and '.join(missing)

    def _time_reset(self) -> None:
        self._senses.forget()
        self._next_status = 0.0
        if self.bug.start != self._start and self.bug.goal != self._start:
            self.bug = Bug2(self._start, self.bug.goal, self.bug.leave_rule)
        self.bug.restart()
        self._told_line = None
        self._publishers.begin()
        self.change_state(State.GO_TO_POINT)

    # ---- new goal, moved robot ------------------------------------------------------------------------------

    def clbk_goal(self, msg: PoseStamped) -> None:
        """Store a goal for the next period, in the odometry frame; refuse an invalid one."""
        try:
            x, y, _ = planar_in(self._senses.frame_id, msg.header.frame_id, msg.pose)
        except PoseError as error:
            rospy.logwarn('bug2: the goal from %s is refused: %s; still heading for (%.2f, %.2f)', GOAL_TOPIC, error,
                          *self.bug.goal)
            return
        with self._asked_lock:
            self._asked = (x, y)

    def _take_news(self, now: float) -> bool:
        """Restart for a new goal or a moved robot; False while there is no scan from the new place."""
        with self._senses.lock:
            pose, jumped = self._senses.pose, self._senses.jumped
            if pose is None:
                return True
            if jumped and not self._senses.scan_since_jump:
                if self._senses.stale(now):
                    rospy.logwarn_throttle(5.0, 'bug2: the robot was put elsewhere; waiting for a scan from there')
                return False
            self._senses.jumped = False
        with self._asked_lock:
            goal, self._asked = self._asked, None
        if goal is not None:
            self._restart(pose, goal, 'new goal (%.2f, %.2f)' % goal)
        elif jumped:
            self._restart(pose, self.bug.goal, 'the robot was put elsewhere')
        return True

    def _restart(self, pose: Pose, goal: Point, why: str) -> None:
        """Define the m-line from ``pose`` to ``goal`` and drive to the goal."""
        try:
            bug = Bug2((pose[0], pose[1]), goal, self.bug.leave_rule)
            if goal != self.bug.goal:       # go_to_point reads it when it is switched on
                rospy.set_param('des_pos_x', goal[0])
                rospy.set_param('des_pos_y', goal[1])
        except (ValueError, OSError, rospy.ROSException) as error:
            rospy.logwarn('bug2: %s: %s; continuing as before', why, error)
            return
        self.bug, bug.reason = bug, why
        self._renew, self._switched, self._told_line = True, None, None
        self._publishers.begin()
        self.change_state(State.GO_TO_POINT)


def bug2() -> None:
    """Run the node; its default name is bug0, launch files name it bug2."""
    run_node('bug0', Bug2Node)

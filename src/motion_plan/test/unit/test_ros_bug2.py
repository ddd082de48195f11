# SPDX-License-Identifier: BSD-3-Clause
"""The node bug2 without a master: a new goal, a moved robot, and a reset of time."""
import math
from types import SimpleNamespace

import pytest
from geometry_msgs.msg import PoseStamped

from motion_plan import ros_bug2
from motion_plan.bug2 import State

FREE = {name: 10.0 for name in ('right', 'fright', 'front', 'fleft', 'left')}


class Calls:
    """All messages and calls of the node."""

    def __init__(self):
        self.published, self.switched, self.parameters, self.warnings, self.refusing = {}, [], {}, [], set()

    def publisher(self, topic, kind, queue_size=1, latch=False):
        return SimpleNamespace(publish=lambda message: self.published.setdefault(topic, []).append(message))

    def service(self, name, kind):
        def call(value):
            if name in self.refusing:
                raise ros_bug2.rospy.ServiceException('gone')
            self.switched.append((name, value))
        return call

    def newest(self, topic):
        return self.published[topic][-1]


class Rhythm:
    """Timing of a node that the test updates."""

    lockstep = False

    def __init__(self, calls):
        self.publisher = calls.publisher

    @staticmethod
    def subscribe(topic, kind, callback):
        pass


@pytest.fixture
def calls(monkeypatch):
    made = Calls()
    rospy = ros_bug2.rospy
    given = {'initial_x': 0.0, 'initial_y': 8.0, 'des_pos_x': 0.0, 'des_pos_y': -4.0}
    monkeypatch.setattr(rospy, 'has_param', given.__contains__)
    monkeypatch.setattr(rospy, 'get_param', lambda name, default=None: given.get(name, default))
    monkeypatch.setattr(rospy, 'set_param', made.parameters.__setitem__)
    monkeypatch.setattr(rospy, 'Subscriber', lambda *_, **__: None)
    monkeypatch.setattr(rospy, 'on_shutdown', lambda function: None)
    monkeypatch.setattr(rospy, 'ServiceProxy', made.service)
    monkeypatch.setattr(rospy, 'get_rostime', lambda: rospy.Time(1))
    monkeypatch.setattr(rospy, 'get_time', lambda: 1.0)
    monkeypatch.setattr(rospy, 'is_shutdown', lambda: False)
    for name in ('loginfo', 'logwarn', 'logerr', 'loginfo_throttle', 'logwarn_throttle'):
        monkeypatch.setattr(rospy, name, lambda *words: None)
    monkeypatch.setattr(rospy, 'logwarn', lambda text, *words: made.warnings.append(text % words))
    monkeypatch.setattr(rospy, 'logwarn_throttle', lambda period, text: made.warnings.append(text))
    monkeypatch.setattr(ros_bug2, 'Diagnostics', lambda *_: None)
    monkeypatch.setattr(ros_bug2, 'choose_rhythm', lambda: Rhythm(made))
    return made


@pytest.fixture
def node(calls):
    """A node that drives at (0, 6), without obstacles."""
    made = ros_bug2.Bug2Node()
    put(made, 0.0, 6.0)
    made._turn(1.0)
    assert made.bug.state is State.GO_TO_POINT
    calls.switched.clear()
    return made


def put(node, x, y):
    node._senses.pose, node._senses.speed, node._senses.regions = (x, y, 0.0), (0.0, 0.0), dict(FREE)
    node._senses.scan_stamp = node._senses.scan_time = node._senses.odom_time = 1.0


def goal(x, y, frame='odom'):
    message = PoseStamped()
    message.header.frame_id = frame
    message.pose.position.x, message.pose.position.y = x, y
    return message


def test_a_new_goal_restarts_from_the_present_pose(node, calls):
    node.clbk_goal(goal(3.0, 5.0))
    assert node.bug.goal == (0.0, -4.0)             # until the next period
    node._turn(1.05)
    assert (node.bug.start, node.bug.goal, node.bug.state) == ((0.0, 6.0), (3.0, 5.0), State.GO_TO_POINT)
    assert calls.parameters == {'des_pos_x': 3.0, 'des_pos_y': 5.0}
    # go_to_point reads its goal when it is switched on, so it must have been off
    assert calls.switched == [('/go_to_point_switch', False), ('/go_to_point_switch', True),
                              ('/wall_follower_switch', False)]
    assert [pose.pose.position.x for pose in calls.newest('bug2/m_line').poses] == [0.0, 3.0]
    assert calls.newest('bug2/state').data == 'go_to_point'
    node._turn(1.1)
    assert len(calls.switched) == 3                 # once


def test_bug2_places_the_robot_only_once_there_is_one(calls, monkeypatch):
    rospy, asked, worlds = ros_bug2.rospy, [], [['ground_plane'], ['ground_plane', 'm2wr']]

    def service(name, _):
        def call(*_):
            asked.append(name)
            models = worlds.pop(0) if name == ros_bug2.GET_WORLD_PROPERTIES else []
            return SimpleNamespace(success=True, model_names=models)
        return call

    monkeypatch.setattr(rospy, 'ServiceProxy', service)
    ros_bug2.Bug2Node()._place_robot()
    assert asked == [ros_bug2.GET_WORLD_PROPERTIES] * 2 + [ros_bug2.SET_MODEL_STATE] and not calls.warnings


def test_a_goal_after_the_end_is_driven_to_as_well(node):
    node.bug.state = State.GOAL_UNREACHABLE
    node.clbk_goal(goal(1.0, 6.0))
    node._turn(1.05)
    assert node.bug.state is State.GO_TO_POINT and node.bug.goal == (1.0, 6.0)


@pytest.mark.parametrize('bad', [goal(math.nan, 0.0), goal(math.inf, 0.0)])
def test_a_goal_that_is_not_finite_changes_nothing(node, calls, bad):
    node.clbk_goal(bad)
    node._turn(1.05)
    assert node.bug.goal == (0.0, -4.0) and not calls.switched
    assert 'still heading for (0.00, -4.00)' in calls.warnings[0]


def test_the_present_place_of_the_robot_is_refused_as_a_goal(node, calls):
    node.clbk_goal(goal(0.0, 6.0))
    node._turn(1.05)
    assert node.bug.goal == (0.0, -4.0) and 'same point' in calls.warnings[0] and not calls.parameters


def test_a_moved_robot_waits_for_a_scan_and_restarts(node, calls):
    node.bug.state = State.WALL_FOLLOWING
    node._senses.jumped, node._senses.scan_since_jump = True, False
    put(node, 4.0, 4.0)
    node._turn(1.05)
    assert node.bug.start == (0.0, 8.0) and not calls.switched and not calls.warnings
    node._turn(9.0)                 # no scans: this is reported, not that it continues
    assert node.bug.start == (0.0, 8.0) and 'waiting for a scan' in calls.warnings[-1]
    node._senses.scan_since_jump = True
    node._turn(1.1)
    assert (node.bug.start, node.bug.goal, node.bug.state) == ((4.0, 4.0), (0.0, -4.0), State.GO_TO_POINT)
    assert node.bug.reason == 'the robot was put elsewhere' and not node._senses.jumped and not calls.parameters


def test_a_switch_that_fails_is_tried_again_in_order(node, calls):
    calls.refusing.add('/wall_follower_switch')
    node.clbk_goal(goal(3.0, 5.0))
    node._turn(1.05)
    assert calls.switched[:2] == [('/go_to_point_switch', False), ('/go_to_point_switch', True)]
    assert {name for name, _ in calls.switched} == {'/go_to_point_switch'} and node._switched is None
    calls.refusing.clear()
    node._turn(1.1)
    assert calls.switched[-1] == ('/wall_follower_switch', False) and node._switched is State.GO_TO_POINT


def test_a_reset_of_time_keeps_the_goal_and_the_first_start(node, calls):
    node.clbk_goal(goal(3.0, 5.0))
    node._turn(1.05)
    node._time_reset()
    assert (node.bug.start, node.bug.goal) == ((0.0, 8.0), (3.0, 5.0))
    put(node, 0.0, 8.0)
    node._turn(0.05)
    assert [pose.pose.position.y for pose in calls.newest('bug2/m_line').poses] == [8.0, 5.0]

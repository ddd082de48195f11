# SPDX-License-Identifier: BSD-3-Clause
"""The markers of Bug 2 for rviz."""
import pytest
from visualization_msgs.msg import Marker

from motion_plan.bug2 import Bug2, State
from motion_plan.ros_bug2_markers import MOST_POINTS, Bug2Markers


@pytest.fixture
def bug():
    return Bug2((0.0, 8.0), (0.0, -4.0))


def by_name(message):
    found = {}
    for marker in message.markers[1:]:
        found.setdefault(marker.ns, []).append(marker)
    return found


def enter(markers, bug, state, point):
    """Set a state that was entered at a point."""
    bug.state = state
    if state is State.WALL_FOLLOWING:
        bug.hit_point = point
    else:
        bug.leave_point = point
    markers.note(bug)


def test_line_start_and_goal_are_at_their_places(bug):
    message = Bug2Markers().message(bug, 'odom', 'base')
    assert message.markers[0].action == Marker.DELETEALL
    found = by_name(message)
    assert [(point.x, point.y) for point in found['m_line'][0].points] == [(0.0, 8.0), (0.0, -4.0)]
    assert (found['start'][0].pose.position.y, found['goal'][0].pose.position.y) == (8.0, -4.0)
    assert found['goal'][0].scale.x == 0.6          # 0.3 m around the goal counts as reached
    assert {marker.header.frame_id for marker in message.markers[:-1]} == {'odom'}


def test_the_state_moves_with_the_robot(bug):
    state = by_name(Bug2Markers().message(bug, 'odom', 'base'))['state'][0]
    assert state.text.startswith('Go to point') and state.header.frame_id == 'base' and state.frame_locked


def test_every_marker_is_unique_and_valid_at_any_time(bug):
    markers = Bug2Markers()
    for number in range(3):
        enter(markers, bug, State.WALL_FOLLOWING, (1.0, number))
        enter(markers, bug, State.GO_TO_POINT, (2.0, number))
    message = markers.message(bug, 'odom', 'base')
    names = [(marker.ns, marker.id) for marker in message.markers[1:]]
    assert len(names) == len(set(names))
    for marker in message.markers[1:]:
        assert marker.header.stamp.is_zero() and marker.color.a == 1.0 and marker.pose.orientation.w == 1.0
        assert marker.scale.z > 0.0 or marker.type == Marker.LINE_STRIP


def test_points_are_numbered_and_kept_until_the_run_ends(bug):
    markers = Bug2Markers()
    enter(markers, bug, State.WALL_FOLLOWING, (0.0, 5.0))
    enter(markers, bug, State.GO_TO_POINT, (0.0, 3.0))
    enter(markers, bug, State.WALL_FOLLOWING, (0.0, 1.0))
    found = by_name(markers.message(bug, 'odom', 'base'))
    assert [marker.pose.position.y for marker in found['hit']] == [5.0, 1.0]
    assert [marker.text.split()[0] for marker in found['hit_text'] + found['leave_text']] == ['H1', 'H2', 'L1']
    markers.begin()
    assert not {'hit', 'leave'} & set(by_name(markers.message(bug, 'odom', 'base')))


def test_the_message_of_a_long_run_is_bounded(bug):
    markers = Bug2Markers()
    for number in range(MOST_POINTS + 20):
        enter(markers, bug, State.WALL_FOLLOWING, (float(number), 0.0))
    hits = by_name(markers.message(bug, 'odom', 'base'))['hit']
    assert len(hits) == MOST_POINTS and hits[-1].pose.position.x == MOST_POINTS + 19

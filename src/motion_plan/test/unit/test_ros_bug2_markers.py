# SPDX-License-Identifier: BSD-3-Clause
"""What rviz gets to show of Bug 2."""
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
    """Let the bug be in a state that it has entered at a point."""
    bug.state = state
    if state is State.WALL_FOLLOWING:
        bug.hit_point = point
    else:
        bug.leave_point = point
    markers.note(bug)


def test_line_start_and_goal_are_where_they_are(bug):
    message = Bug2Markers().message(bug, 'odom', 'base')
    assert message.markers[0].action == Marker.DELETEALL
    found = by_name(message)
    assert [(point.x, point.y) for point in found['m_line'][0].points] == [(0.0, 8.0), (0.0, -4.0)]
    assert (found['start'][0].pose.position.y, found['goal'][0].pose.position.y) == (8.0, -4.0)
    assert found['goal'][0].scale.x == 0.6          # 0.3 m around the goal counts as reached
    assert {marker.header.frame_id for marker in message.markers[:-1]} == {'odom'}


def test_the_state_rides_on_the_robot(bug):
    state = by_name(Bug2Markers().message(bug, 'odom', 'base'))['state'][0]
    assert state.text.startswith('Go to point') and state.header.frame_id == 'base' and state.frame_locked


def test_every_marker_is_one_of_its_own_and_valid_at_any_time(bug):
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


def test_all_points_of_a_run_are_kept_with_their_numbers_and_forgotten_with_it(bug):
    markers = Bug2Markers()
    enter(markers, bug, State.WALL_FOLLOWING, (0.0, 5.0))
    enter(markers, bug, State.GO_TO_POINT, (0.0, 3.0))
    enter(markers, bug, State.WALL_FOLLOWING, (0.0, 1.0))
    found = by_name(markers.message(bug, 'odom', 'base'))
    assert [marker.pose.position.y for marker in found['hit']] == [5.0, 1.0]
    assert [marker.text.split()[0] for marker in found['hit_text'] + found['leave_text']] == ['H1', 'H2', 'L1']
    markers.begin()
    assert not {'hit', 'leave'} & set(by_name(markers.message(bug, 'odom', 'base')))


def test_a_run_without_end_ends_in_no_endless_message(bug):
    markers = Bug2Markers()
    for number in range(MOST_POINTS + 20):
        enter(markers, bug, State.WALL_FOLLOWING, (float(number), 0.0))
    hits = by_name(markers.message(bug, 'odom', 'base'))['hit']
    assert len(hits) == MOST_POINTS and hits[-1].pose.position.x == MOST_POINTS + 19

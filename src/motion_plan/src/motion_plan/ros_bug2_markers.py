# SPDX-License-Identifier: BSD-3-Clause
"""Markers of Bug 2 for rviz: m-line, start, goal, every hit and leave point, the state above the robot."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Tuple

from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker, MarkerArray

from motion_plan.bug2 import STATE_DESCRIPTIONS, State

if TYPE_CHECKING:
    from motion_plan.bug2 import Bug2
    from motion_plan.planar_types import Point as PlanarPoint

#: Colours suitable for red-green colour blindness; the same as in the pictures of m2wr_view.
LINE, START, GOAL = (0.31, 0.31, 0.31), (0.94, 0.89, 0.26), (0.0, 0.62, 0.45)
HIT, LEAVE, TEXT = (0.84, 0.37, 0.0), (0.0, 0.45, 0.70), (0.08, 0.08, 0.08)
STATE_COLOURS = {State.GO_TO_POINT: (0.0, 0.45, 0.70), State.WALL_FOLLOWING: (0.84, 0.37, 0.0),
                 State.GOAL_REACHED: (0.0, 0.50, 0.36), State.GOAL_UNREACHABLE: (0.80, 0.10, 0.40)}
#: Where go_to_point stops [m].
GOAL_RADIUS = 0.3
#: Heights of the markers on the floor, and of the texts above points and robot [m].
FLOOR, LABEL, STATE_HEIGHT = 0.02, 0.3, 0.6
#: Height of the letters [m]: 23 of 720 pixels where a world of 22 m is seen from its lower to its upper edge.
LETTERS = 0.7
#: Largest number of points of one kind, the newest ones: bounds the message of a run without end.
MOST_POINTS = 100
#: Empty lines below a text: seen from above, it is beside its object and not on it.
BELOW, FAR_BELOW = '\n ', '\n \n '


def _marker(kind: int, name: str, number: int, frame: str, colour: Tuple[float, float, float],
            size: Tuple[float, float, float], place: Tuple[float, float, float]) -> Marker:
    marker = Marker(type=kind, action=Marker.ADD, ns=name, id=number)
    marker.header.frame_id = frame      # stamp zero: the present pose of the frame, also for late subscribers
    marker.color.r, marker.color.g, marker.color.b = colour
    marker.color.a = 1.0
    marker.scale.x, marker.scale.y, marker.scale.z = size
    marker.pose.position.x, marker.pose.position.y, marker.pose.position.z = place
    marker.pose.orientation.w = 1.0
    return marker


def _disc(name: str, frame: str, colour: Tuple[float, float, float], radius: float, place: PlanarPoint) -> Marker:
    return _marker(Marker.CYLINDER, name, 0, frame, colour, (2.0 * radius, 2.0 * radius, 0.02), (*place, FLOOR))


def _text(name: str, number: int, frame: str, colour: Tuple[float, float, float], place: Tuple[float, float, float],
          words: str) -> Marker:
    marker = _marker(Marker.TEXT_VIEW_FACING, name, number, frame, colour, (0.0, 0.0, LETTERS), place)
    marker.text = words
    return marker


class Bug2Markers:
    """Stores the points of a run and makes all its markers."""

    def __init__(self) -> None:
        self.begin()

    def begin(self) -> None:
        """Forget the points for a new run."""
        self._hits: List[PlanarPoint] = []
        self._leaves: List[PlanarPoint] = []

    def note(self, bug: Bug2) -> None:
        """Add the point at which the present state was entered, if it has one."""
        for points, point, state in ((self._hits, bug.hit_point, State.WALL_FOLLOWING),
                                     (self._leaves, bug.leave_point, State.GO_TO_POINT)):
            if point is not None and bug.state is state:
                points.append((point[0], point[1]))

    def message(self, bug: Bug2, frame: str, base_frame: str) -> MarkerArray:
        """Return a MarkerArray that replaces the previous one.

        Parameters
        ----------
        bug : motion_plan.bug2.Bug2
        frame : str
            Odometry frame, the frame of all points.
        base_frame : str
            Frame of the robot, above which the state is written.
        """
        first = Marker(action=Marker.DELETEALL)
        first.header.frame_id = frame
        line = _marker(Marker.LINE_STRIP, 'm_line', 0, frame, LINE, (0.06, 0.0, 0.0), (0.0, 0.0, FLOOR))
        line.points = [Point(x=x, y=y) for x, y in (bug.line_start, bug.goal)]
        markers = [first, line, _disc('start', frame, START, 0.15, bug.line_start),
                   _disc('goal', frame, GOAL, GOAL_RADIUS, bug.goal),
                   _text('goal', 1, frame, GOAL, (*bug.goal, LABEL), ' \n \ngoal')]
        for name, letter, colour, points in (('hit', 'H', HIT, self._hits), ('leave', 'L', LEAVE, self._leaves)):
            for index, point in list(enumerate(points))[-MOST_POINTS:]:
                markers.append(_marker(Marker.SPHERE, name, index, frame, colour, (0.22, 0.22, 0.22), (*point, 0.11)))
                markers.append(_text(name + '_text', index, frame, colour, (*point, LABEL),
                                     '%s%d%s' % (letter, index + 1, BELOW)))
        state = _text('state', 0, base_frame, STATE_COLOURS.get(bug.state, TEXT), (0.0, 0.0, STATE_HEIGHT),
                      STATE_DESCRIPTIONS[bug.state] + FAR_BELOW)
        state.frame_locked = True       # rviz moves it with the robot, so no messages are needed without changes
        return MarkerArray(markers=markers + [state])

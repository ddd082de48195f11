# SPDX-License-Identifier: BSD-3-Clause
"""What people see of a choice: paths, markers with scores, a table, the map and the costmap."""
from __future__ import annotations

import colorsys
import re
from typing import TYPE_CHECKING, Dict, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from geometry_msgs.msg import Point
from nav_msgs.msg import OccupancyGrid, Path
from std_msgs.msg import Header, String
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_maps.ros.message_conversion import path_message
from m2wr_navigation.ros.grid_messages import grid_message

if TYPE_CHECKING:
    from m2wr_navigation.best_path.candidates import Candidate
    from m2wr_navigation.best_path.survey import Survey
    from m2wr_node.array_types import FloatArray

CHOSEN = (0.0, 0.62, 0.45)          # colour of the path that is driven, as of Bug 2's goal
WIDTHS = 0.03, 0.09                 # m: of the lines of the others, and of the chosen one
HEIGHTS = 0.03, 0.06                # m: above the floor, so that the chosen one is on top
LETTERS = 0.35                      # m
LABELLED = 6                        # candidates that have a text beside their path
SHOWN = 60                          # candidates of a message
LEAST = 0.02                        # m between two points of a line


def topic_name(name: str) -> str:
    """Return the part of a topic that stands for a candidate: letters, digits and underscores."""
    return re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "unnamed"


def colour_of(rank: int, count: int) -> Tuple[float, float, float]:
    """Return the colour of a candidate, from blue (the best ones) over violet to orange.

    Parameters
    ----------
    rank : int
        From 0.
    count : int
    """
    return colorsys.hsv_to_rgb((0.6 + 0.48 * rank / max(count - 1, 1)) % 1.0, 0.75, 0.9)


def _thinned(points: FloatArray) -> FloatArray:
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])
    at = np.linspace(0.0, along[-1], max(2, int(along[-1] / max(LEAST, along[-1] / 500.0)) + 1))
    return np.stack([np.interp(at, along, points[:, k]) for k in (0, 1)], -1)


def _marker(kind: int, name: str, number: int, frame: str, colour: Sequence[float], size: float) -> Marker:
    marker = Marker(type=kind, action=Marker.ADD, ns=name, id=number)
    marker.header.frame_id = frame          # stamp zero: the present pose of the frame
    marker.color.r, marker.color.g, marker.color.b = colour
    marker.color.a = 1.0
    marker.pose.orientation.w = 1.0
    if kind == Marker.TEXT_VIEW_FACING:
        marker.scale.z = size
    else:
        marker.scale.x = size
    return marker


def markers_of(candidates: Sequence[Candidate], chosen: Optional[Candidate], frame: str) -> MarkerArray:
    """Return lines for all candidates, and texts with rank, name and score for the best ones.

    Parameters
    ----------
    candidates : sequence of Candidate
        The best first.
    chosen : Candidate or None
    frame : str
    """
    made = [Marker(action=Marker.DELETEALL)]
    made[0].header.frame_id = frame
    drawn = [candidate for candidate in candidates if candidate.score is not None][:SHOWN]
    for rank, candidate in enumerate(drawn):
        first = candidate is chosen
        points = _thinned(candidate.plan)
        colour = CHOSEN if first else colour_of(rank, len(drawn))
        line = _marker(Marker.LINE_STRIP, "candidates", rank, frame, colour, WIDTHS[first])
        line.points = [Point(x, y, HEIGHTS[first]) for x, y in points.tolist()]
        made.append(line)
        if rank < LABELLED or first:
            text = _marker(Marker.TEXT_VIEW_FACING, "scores", rank, frame, colour, LETTERS)
            place = points[int((len(points) - 1) * (rank + 1) / (min(len(drawn), LABELLED) + 1)) if rank < LABELLED
                           else len(points) // 2]
            text.pose.position.x, text.pose.position.y = place.tolist()
            text.pose.position.z = 0.3
            text.text = "{}  {}  {:.1f}".format(rank + 1, candidate.name, candidate.total)
            made.append(text)
    return MarkerArray(made)


def scores_of(candidates: Sequence[Candidate], chosen: Optional[Candidate], units: Dict[str, str],
              stamp: rospy.Time) -> DiagnosticArray:
    """Return the table of all candidates: level OK for the chosen one, WARN for the others, ERROR where there is none.

    Parameters
    ----------
    candidates : sequence of Candidate
        The best first.
    chosen : Candidate or None
    units : dict of str to str
        Unit of each criterion.
    stamp : rospy.Time
    """
    rows: List[DiagnosticStatus] = []
    for candidate in candidates[:SHOWN]:
        row = DiagnosticStatus(name=candidate.name[:100], hardware_id="best_path")
        if candidate.score is None:
            row.level, row.message = DiagnosticStatus.ERROR, candidate.reason[:300]
        else:
            row.level = DiagnosticStatus.OK if candidate is chosen else DiagnosticStatus.WARN
            row.message = "driven" if candidate is chosen else "not driven" if candidate.known else "a hope"
            row.values = [KeyValue("score [m]", "{:.2f}".format(candidate.total))] + [
                KeyValue("{} [{}]".format(name, units[name]), "{:.2f}".format(amount))
                for name, amount in candidate.score.amounts.items()]
        rows.append(row)
    return DiagnosticArray(header=Header(stamp=stamp), status=rows)


class Outputs:
    """Publishers of the node.

    Parameters
    ----------
    frame : str
        Of all that is published.
    units : dict of str to str
        Unit of each criterion.
    """

    def __init__(self, frame: str, units: Dict[str, str]) -> None:
        self._frame, self._units = frame, units
        self._markers = rospy.Publisher("~candidates", MarkerArray, queue_size=2, latch=True)
        self._scores = rospy.Publisher("~scores", DiagnosticArray, queue_size=2, latch=True)
        self._plan = rospy.Publisher("~plan", Path, queue_size=2, latch=True)
        self._state = rospy.Publisher("~state", String, queue_size=10, latch=True)
        self._map = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
        self._costmap = rospy.Publisher("~costmap", OccupancyGrid, queue_size=1, latch=True)
        self._paths: Dict[str, rospy.Publisher] = {}
        self._version = -1

    def state(self, text: str) -> None:
        """Publish what the node does."""
        self._state.publish(String(text))

    def choice(self, candidates: Sequence[Candidate], chosen: Optional[Candidate]) -> None:
        """Publish the candidates and the chosen one; paths of candidates that are gone become empty.

        Parameters
        ----------
        candidates : sequence of Candidate
            The best first.
        chosen : Candidate or None
        """
        stamp = rospy.get_rostime()
        self._markers.publish(markers_of(candidates, chosen, self._frame))
        self._scores.publish(scores_of(candidates, chosen, self._units, stamp))
        header = Header(frame_id=self._frame, stamp=stamp)
        self._plan.publish(self._path(None if chosen is None else chosen.plan, header))
        plans = {topic_name(candidate.name): candidate.plan for candidate in candidates[:SHOWN] if len(candidate.plan)}
        for name in set(self._paths) | set(plans):
            if name not in self._paths:
                self._paths[name] = rospy.Publisher("~plans/" + name, Path, queue_size=2, latch=True)
            self._paths[name].publish(self._path(plans.get(name), header))

    @staticmethod
    def _path(plan: Optional[FloatArray], header: Header) -> Path:
        poses = np.zeros((0, 3)) if plan is None else plan
        return path_message(poses, np.full(len(poses), header.stamp.to_sec()), header)

    def survey(self, survey: Survey) -> None:
        """Publish map and costmap, if they have changed."""
        if survey.version == self._version:
            return
        self._version = survey.version
        stamp = rospy.get_rostime()
        grid = grid_message(survey.snapshot(), stamp)
        grid.header.frame_id, grid.data = self._frame, survey.occupancy().ravel()
        self._map.publish(grid)
        if self._costmap.get_num_connections():
            inflated = grid_message(survey.inflated(), stamp)
            inflated.header.frame_id = self._frame
            self._costmap.publish(inflated)

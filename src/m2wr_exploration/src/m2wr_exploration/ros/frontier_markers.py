# SPDX-License-Identifier: BSD-3-Clause
"""Markers of frontiers: blue, green where the robot drives, red where they are set aside."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, List

import numpy as np
import rospy
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker

if TYPE_CHECKING:
    from m2wr_exploration.explorer import Explorer
    from m2wr_exploration.frontiers import View
    from m2wr_node.array_types import FloatArray


class FrontierMarkers:
    """Makes markers, and removes those that are gone."""

    def __init__(self) -> None:
        self._shown: Dict[str, int] = {}        # number of markers, by namespace

    def of(self, explorer: Explorer, namespace: str = "frontiers") -> List[Marker]:
        """Return the markers of an explorer.

        Parameters
        ----------
        explorer : Explorer
        namespace : str
            Of the markers.
        """
        view, target, now = explorer.view, explorer.target, rospy.Time.now()
        if view is None:
            return []
        found = []
        for number, frontier in enumerate(view.frontiers):
            chosen = target is not None and np.hypot(*(frontier.centre - target.centre)) < 1e-6
            aside = bool(explorer.aside.reason(frontier))
            colour = ColorRGBA(0.1, 0.8, 0.2, 1.0) if chosen else (
                ColorRGBA(0.9, 0.2, 0.1, 1.0) if aside else ColorRGBA(0.1, 0.3, 1.0, 1.0))
            found.append(_marker(view, namespace, number, frontier.points, colour, now))
        for number in range(len(view.frontiers), self._shown.get(namespace, 0)):
            gone = Marker(ns=namespace, id=number, action=Marker.DELETE)
            gone.header.frame_id, gone.header.stamp = view.costmap.frame, now
            found.append(gone)
        self._shown[namespace] = len(view.frontiers)
        return found


def _marker(view: View, namespace: str, number: int, points: FloatArray, colour: ColorRGBA, now: rospy.Time) -> Marker:
    marker = Marker(ns=namespace, id=number, type=Marker.POINTS, action=Marker.ADD, color=colour)
    marker.header.frame_id, marker.header.stamp = view.costmap.frame, now
    marker.pose.orientation.w = 1.0
    marker.scale.x = marker.scale.y = marker.scale.z = view.costmap.resolution
    marker.points = [Point(x, y, 0.0) for x, y in points.tolist()]
    return marker

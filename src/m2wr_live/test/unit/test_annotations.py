# SPDX-License-Identifier: BSD-3-Clause
"""Markers for viewers, such as frontiers, without a page."""
import math

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker

from m2wr_live.scene.annotations import MOST, Annotations


def marker(kind, points=(), name=0, **fields):
    found = Marker(type=kind, id=name, points=[Point(*point) for point in points])
    found.header.frame_id, found.scale.x, found.color.r = "map", 0.1, 1.0
    for key, value in fields.items():
        setattr(found, key, value)
    return found


def kept(*markers, now=0.0):
    annotations = Annotations()
    annotations.update(markers, now, lambda frame: np.eye(4) if frame == "map" else None)
    return annotations


def test_a_frontier_is_drawn_as_its_points():
    entry, = kept(marker(Marker.POINTS, [(1, 2, 0), (1, 3, 0)])).present(0.0)
    assert (entry.kind, entry.colour, entry.size) == ("points", (255, 0, 0), 0.1)
    assert entry.points.tolist() == [[1, 2, 0], [1, 3, 0]]


def test_a_strip_becomes_pairs_of_ends():
    entry, = kept(marker(Marker.LINE_STRIP, [(0, 0, 0), (1, 0, 0), (1, 1, 0)])).present(0.0)
    assert entry.kind == "lines" and entry.points[:, :2].tolist() == [[0, 0], [1, 0], [1, 0], [1, 1]]


def test_points_follow_the_frame_and_the_pose():
    found = marker(Marker.POINTS, [(1, 0, 0)])
    found.pose.position.y, found.pose.orientation.z, found.pose.orientation.w = 2.0, math.sqrt(0.5), math.sqrt(0.5)
    frame = np.eye(4)
    frame[0, 3] = 10.0
    annotations = Annotations()
    annotations.update([found], 0.0, lambda _: frame)
    assert annotations.present(0.0)[0].points == pytest.approx(np.array([[10.0, 3.0, 0.0]]))


def test_delete_lifetime_and_delete_all_remove_markers():
    annotations = kept(marker(Marker.SPHERE), marker(Marker.SPHERE, name=1, lifetime=rospy.Duration(2)))
    assert len(annotations.present(1.0)) == 2 and len(annotations.present(3.0)) == 1
    before = annotations.version
    annotations.update([marker(Marker.SPHERE, action=Marker.DELETEALL)], 3.0, lambda _: np.eye(4))
    assert annotations.present(3.0) == [] and annotations.version > before
    annotations.update([marker(Marker.SPHERE)], 3.0, lambda _: np.eye(4))
    annotations.update([marker(Marker.SPHERE, action=Marker.DELETE)], 3.0, lambda _: np.eye(4))
    assert annotations.present(3.0) == []


@pytest.mark.parametrize("odd", [
    marker(Marker.POINTS, [(math.nan, 0, 0)]), marker(Marker.POINTS), marker(Marker.LINE_STRIP, [(0, 0, 0)]),
    marker(99, [(0, 0, 0)]), marker(Marker.MESH_RESOURCE)])
def test_what_cannot_be_drawn_is_left_out(odd):
    assert kept(odd).present(0.0) == []


def test_a_marker_in_an_unknown_frame_is_left_out():
    found = marker(Marker.SPHERE)
    found.header.frame_id = "nowhere"
    assert kept(found).present(0.0) == []


def test_the_number_of_markers_is_bounded():
    assert len(kept(*[marker(Marker.SPHERE, name=number) for number in range(MOST + 5)]).present(0.0)) == MOST

# SPDX-License-Identifier: BSD-3-Clause
"""Ground that is not level: heights and rays against a plane, what a marker becomes."""
import math
import types

import numpy as np
import pytest
from geometry_msgs.msg import Point
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.scene.relief import MOST_FACES, read_relief
from m2wr_live.web.picking import on_ground

SIDE, HALF = 8, 2.0             # cells along a side, and half a side [m]


def height(x, y):
    return 0.3 + 0.2 * x - 0.1 * y


def marker_of(coloured=False, raised=0.0):
    """Return a slope as a list of triangles."""
    line = np.linspace(-HALF, HALF, SIDE + 1)
    points = []
    for x, right in zip(line, line[1:]):
        for y, ahead in zip(line, line[1:]):
            points += [(x, y), (right, y), (right, ahead), (x, y), (right, ahead), (x, ahead)]
    marker = Marker(type=Marker.TRIANGLE_LIST, action=Marker.ADD, points=[Point(x, y, height(x, y)) for x, y in points])
    marker.pose.orientation.w = marker.scale.x = marker.scale.y = marker.scale.z = 1.0
    marker.pose.position.z = raised
    marker.color = ColorRGBA(0.0, 1.0, 0.0, 1.0)
    marker.colors = [ColorRGBA(1.0, 0.5, 0.0, 1.0) for _ in points] if coloured else []
    return marker


@pytest.mark.parametrize("x, y", [(0.0, 0.0), (0.31, -1.7), (HALF, HALF), (-HALF, 0.5), (0.25, 0.25)])
def test_height_is_that_of_the_slope(x, y):
    assert read_relief([marker_of()]).height(x, y) == pytest.approx(height(x, y))
    assert read_relief([marker_of(), marker_of(raised=0.7)]).height(x, y) == pytest.approx(height(x, y) + 0.7)


def test_beside_the_ground_height_is_zero():
    assert read_relief([marker_of()]).height(HALF + 0.1, 0.0) == 0.0


def test_a_ray_meets_the_slope_and_beside_it_the_plane():
    relief, along = read_relief([marker_of()]), np.array((0.3, -0.1, -1.0))
    x, y, z = on_ground((-0.5, 0.4, 3.0), along, relief)
    assert z == pytest.approx(height(x, y)) and (x + 0.5, y - 0.4) == pytest.approx(((3.0 - z) * 0.3, (z - 3.0) * 0.1))
    assert on_ground((5.0, 0.0, 3.0), (0.0, 0.0, -1.0), relief) == (5.0, 0.0, 0.0)
    assert on_ground((0.0, 0.0, 3.0), (0.0, 0.0, 1.0), relief) is None
    assert on_ground((math.nan, 0.0, 3.0), (0.0, 0.0, -1.0), relief) is None


def test_the_nearer_of_two_hills_is_met():
    low, high = marker_of(), marker_of(raised=1.0)
    assert on_ground((0.0, 0.0, 9.0), (0.0, 0.0, -2.0), read_relief([low, high])) == pytest.approx((0.0, 0.0, 1.3))


def test_corners_at_one_place_are_one_vertex():
    relief = read_relief([marker_of(coloured=True)])
    assert (len(relief.vertices), len(relief.faces)) == ((SIDE + 1) ** 2, 2 * SIDE ** 2)
    assert np.all(relief.colours == (255, 128, 0)) and np.all(read_relief([marker_of()]).colours == (0, 255, 0))


@pytest.mark.parametrize("change", [
    lambda marker: setattr(marker.points[4], "z", math.nan), lambda marker: setattr(marker.color, "r", math.inf),
    lambda marker: setattr(marker.pose.position, "x", math.nan), lambda marker: setattr(marker, "points", []),
    lambda marker: setattr(marker, "type", Marker.CUBE), lambda marker: setattr(marker, "action", Marker.DELETE),
    lambda marker: setattr(marker, "points", [Point()] * (3 * MOST_FACES + 3))])
def test_ground_that_cannot_be_drawn_is_left_out(change):
    marker = marker_of()
    change(marker)
    assert read_relief([marker]) is None
    assert len(read_relief([marker, marker_of()]).faces) == 2 * SIDE ** 2


def test_a_trail_lies_on_the_ground():
    scene = LiveScene()
    scene.take_ground(MarkerArray([marker_of()]))
    scene.take_description("/robot_description", types.SimpleNamespace(
        name="cart", root="base", mounts={}, links=["base"], shapes=[], geometries={}))
    places = (0.0, 0.5, 1.0)
    for x in places:
        scene.take_links(["cart::base"], np.array([(x, 0.0, 5.0, 0.0, 0.0, 0.0, 1.0)]))
        scene.update()
    assert [point[2] for point in scene.robots["cart"].trail] == pytest.approx([height(x, 0.0) for x in places])

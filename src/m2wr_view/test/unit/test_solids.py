# SPDX-License-Identifier: BSD-3-Clause
"""Markers and descriptions as outlines."""
import numpy as np
import pytest
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker

from conftest import URDF
from m2wr_view.errors import ViewError
from m2wr_view.solids import Solids, marker_outlines, read_robot


def extent(outlines):
    low = np.min([outline.vertices.min(axis=0) - outline.radius for outline in outlines], axis=0)
    high = np.max([outline.vertices.max(axis=0) + outline.radius for outline in outlines], axis=0)
    return low.tolist() + high.tolist()


@pytest.mark.parametrize("kind, size, expected", [
    (Marker.CUBE, (2.0, 1.0, 1.0), [0.5, 0.0, 1.5, 2.0]),              # turned by a right angle
    (Marker.CYLINDER, (0.6, 0.6, 1.0), [0.7, 0.7, 1.3, 1.3]),
    (Marker.SPHERE, (1.0, 1.0, 1.0), [0.5, 0.5, 1.5, 1.5])])
def test_a_marker_has_the_outline_of_its_shape(make, kind, size, expected):
    solids = Solids()
    solids.update([make.marker(kind, size, 1.0, 1.0, 0.1, np.pi / 2)])
    assert extent(solids.blocking) == pytest.approx(expected)


def test_a_mesh_has_the_outlines_of_its_triangles(make):
    marker = make.marker(Marker.TRIANGLE_LIST, (2.0, 1.0, 1.0), 1.0, 0.0)
    marker.points = [Point(x, y, z) for z in (0.1, 3.0) for x, y in ((0, 0), (1, 0), (0, 1))]
    solids = Solids()
    solids.update([marker])
    assert len(solids.blocking) == 1 and extent(solids.blocking) == pytest.approx([1.0, 0.0, 3.0, 1.0])


def test_what_hangs_above_the_robot_does_not_block(make):
    solids = Solids()
    solids.update([make.marker(Marker.CUBE, (1.0, 1.0, 0.1), 0.0, 0.0, 1.0)])
    assert not solids.blocking and len(solids.hanging) == 1


def test_markers_move_and_go(make):
    solids = Solids()
    solids.update([make.marker(Marker.CUBE, (1, 1, 1), 5.0 * number, 0, number=number) for number in (0, 1)])
    solids.update([make.marker(Marker.CUBE, (1, 1, 1), 9, 0, number=1)])
    assert extent(solids.blocking) == pytest.approx([-0.5, -0.5, 9.5, 0.5])
    solids.update([make.marker(Marker.CUBE, (1, 1, 1), 0, 0, number=1, action=Marker.DELETE)])
    assert extent(solids.blocking) == pytest.approx([-0.5, -0.5, 0.5, 0.5])
    solids.update(make.world().markers)
    assert not solids.blocking


def test_only_changed_markers_get_new_outlines(make, monkeypatch):
    cut = []
    monkeypatch.setattr("m2wr_view.solids.marker_outlines",
                        lambda marker: cut.append(marker.id) or marker_outlines(marker))
    solids, still = Solids(), make.marker(Marker.CUBE, (1, 1, 1), 0, 0, number=0)
    for x in (3.0, 3.0, 4.0):
        solids.update(make.world(still, make.marker(Marker.CUBE, (1, 1, 1), x, 0, number=1)).markers)
    assert cut == [0, 1, 1] and extent(solids.blocking) == pytest.approx([-0.5, -0.5, 4.5, 0.5])
    mesh = make.marker(Marker.TRIANGLE_LIST, (1.0, 1.0, 1.0), 0.0, 0.0, number=2)
    for far in (1.0, 6.0):                  # only a point differs
        mesh.points = [Point(x, y, 0.1) for x, y in ((0, 0), (far, 0), (0, 1))]
        solids.update(make.world(mesh).markers)
        assert extent(solids.blocking)[2] == pytest.approx(far)


def test_a_robot_is_seen_from_above_and_knows_where_its_laser_is():
    robot = read_robot(URDF)
    assert extent(robot.footprint) == pytest.approx([-0.4, -0.2, 0.6, 0.2])
    assert robot.root == "base" and robot.mounts["laser"][:3, 3] == pytest.approx([0.5, 0.0, 0.3])


@pytest.mark.parametrize("text", ["", "<robot>", "<sdf/>", URDF.replace("1 0.4 0.2", "1 wide 0.2"),
                                  "<robot><link/></robot>"])
def test_what_is_no_description_is_refused(text):
    with pytest.raises(ViewError, match="robot_description: .*expected"):
        read_robot(text)

# SPDX-License-Identifier: BSD-3-Clause
"""Shapes read from markers, and the geometry that pages draw."""
import numpy as np
import pytest
from geometry_msgs.msg import Point
from visualization_msgs.msg import Marker

from m2wr_live.scene.shapes import UNITS, MarkerShapes, quaternions_of
from m2wr_view.frames import rotation_of


def marker(kind=Marker.CUBE, number=0, action=Marker.ADD, x=1.0, name="box"):
    made = Marker(type=kind, id=number, action=action, ns=name)
    made.header.frame_id = "/odom"
    made.pose.position.x, made.pose.orientation.w = x, 1.0
    made.scale.x, made.scale.y, made.scale.z = 1.0, 2.0, 3.0
    made.color.g, made.color.a = 1.0, 0.5
    return made


def volume(geometry):
    """Volume enclosed by triangles whose corners are counter-clockwise from outside (divergence theorem)."""
    corners = geometry.vertices[geometry.faces]
    return np.sum(np.einsum("ni,ni->n", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))) / 6.0


@pytest.mark.parametrize("kind, exact", [("box", 1.0), ("cylinder", np.pi / 4.0), ("sphere", np.pi / 6.0)])
def test_unit_shapes_are_closed_and_have_their_volume(kind, exact):
    assert volume(UNITS[kind]) == pytest.approx(exact, rel=0.05)
    edges = np.sort(np.concatenate([UNITS[kind].faces[:, pair] for pair in ((0, 1), (1, 2), (2, 0))]), axis=1)
    ends = UNITS[kind].vertices[edges]
    real = edges[np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1) > 1e-9]       # a sphere's poles are one place
    if kind != "sphere":
        assert np.all(np.unique(real, axis=0, return_counts=True)[1] == 2)


def test_quaternions_are_those_of_the_matrices():
    generator = np.random.default_rng(3)
    wxyz = generator.normal(size=(200, 4))
    wxyz[:4] = np.eye(4)
    wxyz /= np.linalg.norm(wxyz, axis=1, keepdims=True)
    found = quaternions_of(np.array([rotation_of((x, y, z, w)) for w, x, y, z in wxyz]))
    assert np.allclose(np.abs(np.sum(found * wxyz, axis=1)), 1.0, atol=1e-12)


def test_markers_are_added_changed_and_deleted_as_in_rviz():
    shapes = MarkerShapes()
    shapes.update([marker(), marker(Marker.SPHERE, 1, x=4.0)])
    assert [(shape.geometry, shape.pose[0, 3], shape.owner) for shape in shapes.shapes] == [
        ("box", 1.0, "box"), ("sphere", 4.0, "box")]
    assert shapes.frame == "odom" and shapes.shapes[0].scale == (1.0, 2.0, 3.0)
    assert shapes.shapes[0].colour == (0.0, 1.0, 0.0, 0.5)
    shapes.update([marker(x=2.0)])
    assert [shape.pose[0, 3] for shape in shapes.shapes] == [2.0, 4.0]
    shapes.update([marker(action=Marker.DELETE)])
    assert [shape.geometry for shape in shapes.shapes] == ["sphere"]
    shapes.update([marker(action=Marker.DELETEALL), marker(number=7)])
    assert [shape.geometry for shape in shapes.shapes] == ["box"]


def test_equal_meshes_share_their_triangles():
    shapes = MarkerShapes()
    meshes = [marker(Marker.TRIANGLE_LIST, number) for number in range(3)]
    for number, entry in enumerate(meshes):
        entry.points = [Point(0, 0, 0), Point(1, 0, 0), Point(0, 1, 1 if number == 2 else 0), Point(9, 9, 9)]
    shapes.update(meshes)
    assert len(shapes.geometries) == 2
    assert all(len(geometry.faces) == 1 for geometry in shapes.geometries.values())
    shapes.update([marker(Marker.TRIANGLE_LIST, 2, Marker.DELETE)])
    assert len(shapes.geometries) == 1


def test_numbers_that_are_not_finite_are_left_out():
    shapes = MarkerShapes()
    broken = marker(number=1)
    broken.pose.position.y = float("nan")
    wide = marker(number=2)
    wide.scale.x = float("inf")
    shapes.update([marker(), broken, wide])
    assert len(shapes.shapes) == 1

# SPDX-License-Identifier: BSD-3-Clause
"""Many shapes: few messages, and no more shadows than a browser without a GPU can draw."""
import numpy as np
import pytest

from m2wr_live.scene.shapes import UNITS, Shape
from m2wr_live.web.batches import MOST_SHADOWS, Batches


class Scene:
    """Counts what is added and keeps its options."""

    def __init__(self):
        self.added = {}

    def add_frame(self, name, **_):
        return name

    def add_batched_meshes_simple(self, name, _vertices, _faces, **options):
        assert name not in self.added
        self.added[name] = type("Handle", (), options)()
        return self.added[name]


def obstacles(number):
    """Boxes, cylinders and spheres in turns, in rows of 40."""
    kinds, shapes = ("box", "cylinder", "sphere"), []
    for index in range(number):
        pose = np.eye(4)
        pose[:2, 3] = index % 40, index // 40
        shapes.append(Shape(kinds[index % 3], pose, (0.3, 0.3, 0.5), (0.0, 0.8, 0.0, 1.0), "o%d" % index))
    return shapes


def drawn(number, geometries=UNITS):
    scene = Scene()
    shapes = obstacles(number)
    Batches(scene, "/world").set_shapes(shapes, geometries, np.array([shape.pose for shape in shapes]))
    return scene.added


def test_a_thousand_obstacles_are_three_meshes():
    found = drawn(1000)
    assert len(found) == 3
    assert sum(len(mesh.batched_positions) for mesh in found.values()) == 1000


@pytest.mark.parametrize("number, shadows", [(3 * MOST_SHADOWS, True), (3 * MOST_SHADOWS + 3, False)])
def test_only_so_many_shapes_cast_shadows(number, shadows):
    assert {mesh.cast_shadow for mesh in drawn(number).values()} == {shadows}


def test_both_sides_of_faces_are_drawn_of_open_meshes_only():
    opened = dict(UNITS, box=UNITS["box"]._replace(closed=False))
    assert {name: mesh.side for name, mesh in drawn(3, opened).items()} == {
        "/world/box": "double", "/world/cylinder": "front", "/world/sphere": "front"}

# SPDX-License-Identifier: BSD-3-Clause
"""Extruded outlines: closed bodies of the right volume, seen from outside, holes included."""
import math
import random

import numpy as np
import pytest

from m2wr_sim.model.mesh.polyline import extrude

SQUARE = [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]
HOLE = [(0.5, 0.5), (1.5, 0.5), (1.0, 1.5)]


def volume(vertices, triangles):
    """Return the volume that the triangles enclose; positive only where they look outwards."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


def open_area(vertices, triangles):
    """Return the vector area of the surface, zero where it is closed."""
    a, b, c = (vertices[triangles[:, corner]] for corner in range(3))
    return np.abs(0.5 * np.cross(b - a, c - a).sum(axis=0)).max()


def area(outline):
    return 0.5 * sum(x1 * y2 - x2 * y1 for (x1, y1), (x2, y2) in zip(outline, outline[1:] + outline[:1]))


def star(draw, count):
    return [(math.cos(angle) * reach, math.sin(angle) * reach) for angle, reach in (
        (2.0 * math.pi * index / count, draw.uniform(0.3, 2.0)) for index in range(count))]


@pytest.mark.parametrize("outline", [
    SQUARE, SQUARE[::-1], HOLE, [(0, 0), (3, 0), (3, 1), (1, 1), (1, 3), (0, 3)],
    [(0, 0), (2, 0), (2, 2), (1, 0.5), (0, 2)]] + [star(random.Random(seed), 5 + seed) for seed in range(20)])
def test_outline_becomes_a_closed_body_of_area_times_height(outline):
    shape = extrude([outline], 1.5)
    assert volume(*shape) == pytest.approx(1.5 * abs(area([tuple(map(float, corner)) for corner in outline])))
    assert open_area(*shape) < 1e-12
    assert shape[0][:, 2].min() == 0.0 and shape[0][:, 2].max() == 1.5


def test_an_outline_inside_another_is_a_hole():
    shape = extrude([SQUARE, HOLE], 1.0)
    assert volume(*shape) == pytest.approx(4.0 - 0.5) and open_area(*shape) < 1e-12


def test_outlines_beside_one_another_are_one_body():
    shape = extrude([SQUARE, [(x + 5.0, y - 1.0) for x, y in SQUARE]], 1.0)
    assert volume(*shape) == pytest.approx(8.0)


@pytest.mark.parametrize("outline", [[(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)], [(0.0, 0.0), (1.0, 1.0), (3.0, 3.0)]])
def test_an_outline_on_one_line_has_no_triangle(outline):
    assert len(extrude([outline], 1.0)[1]) == 0

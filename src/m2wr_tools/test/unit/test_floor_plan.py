# SPDX-License-Identifier: BSD-3-Clause
"""Floor plans: distances, and the same shapes in SDF as in the records."""
import numpy as np
import pytest

from m2wr_sim.api import read_world
from m2wr_sim.model.placed import placed_collisions
from m2wr_sim.model.types import Box, Cylinder
from m2wr_tools.buildings.floor_plan import WALL_THICKNESS, FloorPlan
from m2wr_tools.buildings.generators import generate

PLAN = FloorPlan("plan", np.array([[0.0, 0.0, 4.0, 0.0]]), np.array([False]),
                 np.array([[2.0, 3.0, 2.0, 1.0, 0.5 * np.pi]]), np.array([[6.0, 3.0, 0.5]]), np.empty((0, 2)))


@pytest.mark.parametrize("point, distance", [
    ((2.0, -1.0), 1.0 - 0.5 * WALL_THICKNESS),          # beside the wall
    ((-3.0, -4.0), 5.0 - 0.5 * WALL_THICKNESS),         # beyond its end
    ((2.0, 1.5), 0.5),                                  # in front of the box, which is turned
    ((2.0, 3.0), -0.5),                                 # in its centre
    ((6.0, 4.0), 0.5), ((6.0, 3.0), -0.5)])             # the pillar
def test_clearance_is_the_distance_to_the_nearest_surface(point, distance):
    assert PLAN.clearance(np.array([point])) == pytest.approx([distance])


def test_clearance_of_many_points_equals_that_of_each():
    plan = generate("office", np.random.default_rng(3))
    points = np.random.default_rng(4).uniform(0.0, 20.0, (5000, 2))
    many = plan.clearance(points)
    assert many[::500] == pytest.approx([plan.clearance(point[None])[0] for point in points[::500]])
    assert plan.clearance(np.empty((0, 2))).shape == (0,)


def test_sdf_has_the_shapes_of_the_plan(tmp_path):
    plan = generate("house", np.random.default_rng(1))
    path = tmp_path / "house.world"
    path.write_text(plan.sdf())
    found = {collision.name: (collision.geometry, pose) for model, collision, pose in placed_collisions(
        read_world(str(path))) if model.name == "building"}
    expected = list(plan.parts())
    assert len(found) == len(expected) > 10
    for name, shape, (position, orientation) in expected:
        geometry, pose = found[name + "_collision"]
        assert pose[0] == pytest.approx(position, abs=1e-4)
        assert abs(np.dot(pose[1], orientation)) == pytest.approx(1.0, abs=1e-6)
        if isinstance(shape, Box):
            assert geometry.size == pytest.approx(shape.size, abs=1e-4)
        else:
            assert isinstance(geometry, Cylinder) and geometry.radius == pytest.approx(shape.radius, abs=1e-4)

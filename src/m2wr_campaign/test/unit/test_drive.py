# SPDX-License-Identifier: BSD-3-Clause
"""A drive over rough ground ends in one of four ways, each from its own signs."""
import math

import numpy as np
import pytest

from m2wr_campaign.rough.drive import REACHED, SLIPPED, STUCK, TIPPED, Watch, drive, on_relief, patched_world, world_of
from m2wr_campaign.terrain.relief import Grid
from m2wr_sim.api import Sim
from m2wr_sim.geometry import quaternion_from_rpy

RADIUS = 0.1


def at(x, y=0.0, roll=0.0, yaw=0.0):
    return ((x, y, 0.1), quaternion_from_rpy(roll, 0.0, yaw))


def ended(poses, wheels, step=0.1):
    watch = Watch(RADIUS, 2.0)
    for number, (pose, angle) in enumerate(zip(poses, wheels)):
        found = watch.look(10.0 + number * step, pose, angle)
        if found is not None:
            return found
    return None


def test_a_robot_that_rolls_on_reaches_its_goal():
    found = ended([at(0.03 * n) for n in range(100)], [0.3 * n for n in range(100)])
    assert found.outcome == REACHED and found.distance == pytest.approx(2.0, abs=0.04)


def test_a_robot_on_its_side_has_tipped():
    found = ended([at(0.03 * n, roll=0.05 * n) for n in range(100)], np.zeros(100))
    assert found.outcome == TIPPED and math.radians(60.0) < found.tilt < math.radians(64.0)


@pytest.mark.parametrize("rate, outcome", [(0.3, SLIPPED), (0.02, STUCK), (0.0, STUCK)])
def test_wheels_tell_slipping_from_being_stuck(rate, outcome):
    found = ended([at(min(0.03 * n, 0.6)) for n in range(200)], [rate * n for n in range(200)])
    assert found.outcome == outcome and found.time == pytest.approx(7.0, abs=0.6)


def test_commands_turn_back_to_the_line():
    assert Watch.command(at(1.0, y=0.5))[1] < 0.0 < Watch.command(at(1.0, yaw=-0.2))[1]


def test_a_step_higher_than_the_wheels_stops_a_robot():
    grid = Grid(65, 8.0)
    heights = np.where(grid.places[0] > 1.5, 0.25, 0.0)
    with Sim(world_of(grid, heights), "m2wr", pose=(0.0, 0.0, 0.2, 0.0), sensing="off", step=0.005) as sim:
        sim.step((0.0, 0.0), 0.5)
        found = drive(sim, 3.0)
    assert found.outcome in (SLIPPED, STUCK) and found.distance < 1.5


def test_larger_wheels_get_over_what_stops_m2wr():
    outcomes = [on_relief(robot, {"fractal": 0.06, "rubble": 0.06}, 3, size=14.0, samples=129)["outcome"]
                for robot in ("m2wr", "m2wr_rough")]
    assert outcomes[1] == REACHED and outcomes[0] in (REACHED, SLIPPED, STUCK)


def test_patches_have_their_own_friction_and_the_same_ground():
    grid = Grid(33, 8.0)
    heights, which = 0.1 * np.sin(grid.places[0]), np.zeros((32, 32), np.int64)
    plain = patched_world(grid, heights, which, ("ice",)).models[0].links[0].collisions
    assert [each.name for each in plain] == ["ground"]
    which[:, 20:] = 1
    parts = patched_world(grid, heights, which, ("ice",)).models[0].links[0].collisions
    assert [(each.name, each.surface.mu) for each in parts] == [("ground", 1.0), ("ice", 0.1)]
    assert sum(len(each.geometry.triangles) for each in parts) == 2 * 32 * 32
    for each in parts:
        corners = each.geometry.vertices[each.geometry.triangles]
        assert (np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2] > 0.0).all()
        assert each.geometry.vertices[:, 2] == pytest.approx(0.1 * np.sin(each.geometry.vertices[:, 0]))
    assert parts[1].geometry.vertices[:, 0].min() == pytest.approx(grid.places[0][0, 20])

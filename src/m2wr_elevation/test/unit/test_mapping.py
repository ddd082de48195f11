# SPDX-License-Identifier: BSD-3-Clause
"""The map of a drive over rough ground agrees with the ground; a drive by the map reaches its goal."""
import math

import pytest

from m2wr_campaign.rough.drive import world_of
from m2wr_campaign.terrain.relief import Grid, heights_of
from m2wr_elevation.study.drive import to_goal
from m2wr_elevation.study.mapping import PERIOD, MappingRobot
from m2wr_sim.api import Sim


def test_heights_are_known_to_two_centimetres():
    grid = Grid(257, 16.0)
    heights = heights_of(grid, {"fractal": 0.05, "craters": 0.25}, 1001)
    with Sim(world_of(grid, heights), "m2wr_rough", pose=(0.0, 0.0, 0.5, 0.0), step=0.005) as sim:
        sim.step((0.0, 0.0), 1.0)
        robot = MappingRobot(sim)
        for number in range(60):
            robot.look()
            sim.step((0.3, 0.2 * math.sin(number / 10.0)), PERIOD)
        robot.look()
        errors = robot.errors(grid, heights)
    assert errors.rms < 0.02 and errors.share > 0.25


def test_a_drive_by_the_map_reaches_its_goal_beyond_craters():
    row = to_goal("elevation", {"craters": 0.4, "fractal": 0.03}, 4)
    assert row["outcome"] == "reached" and row["length"] < 9.0 and row["rms"] < 0.02


def test_a_planner_that_is_not_known_is_refused():
    with pytest.raises(ValueError, match='no planner "best"'):
        to_goal("best", {}, 0)

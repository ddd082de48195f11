"""Scans of a robot that rocks."""
import math

import numpy as np
import pytest

from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.level import MEMORY, LevelWatch
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.scan import LaserModel

RING = 4.0 * np.stack([np.cos(np.linspace(-1.5, 1.5, 100)), np.sin(np.linspace(-1.5, 1.5, 100))])     # end points [m]
NOD = -math.tan(0.08), 0.0


def test_a_nod_is_told_from_a_level_laser_and_from_one_that_sees_only_what_is_near():
    watch = LevelWatch(0.05)
    assert not watch.tilted((0.0, 0.0), RING, 0.0)
    assert watch.tilted(NOD, RING, 0.05)
    assert not watch.tilted(NOD, 0.1 * RING, 0.10)
    assert not watch.tilted((-0.01, 0.0), RING, 0.15)       # 4 cm up
    assert not watch.tilted(NOD, np.empty((2, 0)), 0.20)
    assert watch.tilted((0.0, 0.08), RING, 0.25)


def test_a_lasting_slope_becomes_the_usual_one():
    watch = LevelWatch(0.05)
    told = [watch.tilted(NOD, RING, stamp) for stamp in np.arange(0.0, 4.0 * MEMORY, 0.1)]
    assert told[0] and all(told[:100]) and not any(told[-10:])
    assert watch.tilted((0.0, 0.0), RING, 4.0 * MEMORY)


def test_time_that_stands_still_or_goes_back_changes_nothing():
    watch = LevelWatch(0.05)
    assert not watch.tilted((0.0, 0.0), RING, 5.0)
    assert watch.tilted(NOD, RING, 5.0) and watch.tilted(NOD, RING, 3.0) and not watch.tilted((0.0, 0.0), RING, 3.1)


def room(model, pose, nod=0.0):
    """Ranges to the walls of a room of 8 m x 6 m around the origin, or to the floor 0.3 m below where it is nearer."""
    heading = pose[2] + model.angles
    c, s = np.cos(heading), np.sin(heading)
    with np.errstate(divide="ignore"):
        walls = np.minimum((np.copysign(4.0, c) - pose[0]) / c, (np.copysign(3.0, s) - pose[1]) / s)
        floor = np.where(nod * np.cos(model.angles) > 0.0, 0.3 / np.maximum(nod * np.cos(model.angles), 1e-9), np.inf)
    return np.minimum(walls, floor)


@pytest.mark.parametrize("compatible", [False, True])
def test_a_scan_that_shows_the_floor_is_put_off_until_the_robot_is_level(compatible):
    model = LaserModel.from_message(-1.5, 1.5, math.pi / 360, 344, 0.05, 10.0)
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=3, linearUpdate=0.5, compatible=compatible)), model)
    processed = []
    for k in range(16):
        pose, nods = np.array([-1.0 + 0.1 * k, 0.2, 0.0]), 5 <= k <= 6
        ranges = room(model, pose, 0.15 if nods else 0.0)
        slope = (-math.tan(0.15), 0.0) if nods else (0.0, 0.0)
        if mapper.process(mapper.reading(ranges), pose, 0.05 * k, slope).processed:
            processed.append(k)
    assert processed == ([0, 5, 10, 15] if compatible else [0, 7, 12])
    if not compatible:
        grid = mapper.occupancy()
        rows, columns = np.nonzero(grid.data == 100)
        x, y = grid.origin[0] + grid.resolution * columns, grid.origin[1] + grid.resolution * rows
        assert np.minimum(np.abs(4.0 - np.abs(x)), np.abs(3.0 - np.abs(y))).max() < 0.11
    mapper.close()


def test_on_a_slope_without_an_end_scans_are_processed_after_twice_the_way():
    model = LaserModel.from_message(-1.5, 1.5, math.pi / 360, 344, 0.05, 10.0)
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=3, linearUpdate=0.5)), model)
    processed = []
    for k in range(23):
        pose = np.array([-1.0 + 0.1 * k, 0.2, 0.0])
        if mapper.process(mapper.reading(room(model, pose)), pose, 0.05 * k, NOD).processed:
            processed.append(k)
    assert processed == [0, 10, 20]
    mapper.close()

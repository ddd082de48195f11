# SPDX-License-Identifier: BSD-3-Clause
"""Scans of a pitching robot."""
import math

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.frontend.tilt_detection import TiltDetector
from m2wr_gmapping.mapper import Mapper

RING = 4.0 * np.stack([np.cos(np.linspace(-1.5, 1.5, 100)), np.sin(np.linspace(-1.5, 1.5, 100))])     # end points [m]
NOD = -math.tan(0.08), 0.0


def test_pitching_is_detected_unless_all_points_are_near():
    watch = TiltDetector(0.05, 10.0)
    assert not watch.is_tilted((0.0, 0.0), RING, 0.02) and not watch.is_rocking
    assert watch.is_tilted(NOD, RING, 0.02) and watch.is_rocking
    assert not watch.is_tilted(NOD, 0.1 * RING, 0.02) and not watch.is_rocking
    assert not watch.is_tilted((-0.01, 0.0), RING, 0.02)       # 4 cm up
    assert not watch.is_tilted(NOD, np.empty((2, 0)), 0.02)
    assert watch.is_tilted((0.0, 0.08), RING, 0.02)


def test_slope_of_a_ramp_becomes_the_reference():
    watch = TiltDetector(0.05, 10.0)
    count = int(40.0 * tuning.TRACKING.slope_memory)
    told = [(watch.is_tilted(NOD, RING, 0.1), watch.is_rocking) for _ in range(count)]
    is_tilted, is_rocking = np.array(told).T
    assert is_tilted[:100].all() and not is_tilted[-10:].any()
    assert is_rocking.sum() == pytest.approx(tuning.TRACKING.tilted_distance / 0.1, abs=1.0) and is_rocking[:5].all()
    assert watch.is_tilted((0.0, 0.0), RING, 0.1)


def test_repeated_pitching_does_not_become_the_reference():
    """A robot that starts and stops all the time nods one way only, yet level scans stay level and nods tilted."""
    watch = TiltDetector(0.05, 10.0)
    for k in range(600):
        nods = k % 10 in (1, 2, 3)
        assert watch.is_tilted(NOD if nods else (0.0, 0.0), RING, 0.1) == nods, k


@pytest.mark.parametrize("slope, step", [(NOD, 0.0), ((-0.34, 0.0), 0.1), ((0.0, 0.3), 0.1)])
def test_leaning_on_a_wall_is_not_a_ramp(slope, step):
    """The wheels keep turning; the robot stays there or slides along the wall, and comes down again."""
    watch = TiltDetector(0.05, 10.0)
    for _ in range(200):
        assert watch.is_tilted(slope, RING, step) and watch.is_rocking
    for share in (0.9, 0.7, 0.5):
        assert watch.is_tilted((share * slope[0], share * slope[1]), RING, 0.02) and watch.is_rocking
    assert not watch.is_tilted((0.0, 0.0), RING, 0.02) and not watch.is_rocking


def test_slightly_tilted_scan_keeps_its_level_part():
    model = LaserModel.from_message(-1.5, 1.5, math.pi / 360, 344, 0.05, 10.0, max_range=9.0, max_urange=6.0)
    rng = np.random.default_rng(1)
    reading = model.reading(rng.choice([1.0, 4.0, 8.0], 344, p=[0.7, 0.2, 0.1]) + rng.uniform(-0.2, 0.2, 344), 2, 0.0)
    watch, slope = TiltDetector(0.05, 9.0), np.array([0.02, -0.015])
    assert not watch.is_tilted(slope / 5.0, reading.points, 0.0) and watch.level_part(reading) is reading
    assert not watch.is_tilted(slope, reading.points, 0.0)
    part = watch.level_part(reading)
    level = [column for column in reading.points.T if abs(slope @ column) <= 0.05]
    assert np.array_equal(part.points.T, level) and 0 < len(level) < reading.points.shape[1]
    assert np.array_equal(part.beams.T, [row for row in reading.beams.T if abs(slope @ row[:2]) <= 0.05])
    assert part.rays.shape == reading.rays.shape and part.rays.dtype == np.float32
    for ray, hit, whole, before in zip(part.rays.T, part.ray_hits, reading.rays.T, reading.ray_hits):
        height = abs(slope @ whole)
        assert hit == (before and height <= 0.05)
        assert ray == pytest.approx(whole * min(1.0, 0.05 / max(height, 1e-9)), rel=1e-5)
    assert watch.is_tilted(10.0 * slope, reading.points, 0.0) and watch.level_part(reading) is reading


def room(model, pose, nod=0.0):
    """Ranges to the walls of a room of 8 m x 6 m around the origin, or to the floor 0.3 m below where it is nearer."""
    heading = pose[2] + model.angles
    c, s = np.cos(heading), np.sin(heading)
    with np.errstate(divide="ignore"):
        walls = np.minimum((np.copysign(4.0, c) - pose[0]) / c, (np.copysign(3.0, s) - pose[1]) / s)
        floor = np.where(nod * np.cos(model.angles) > 0.0, 0.3 / np.maximum(nod * np.cos(model.angles), 1e-9), np.inf)
    return np.minimum(walls, floor)


@pytest.mark.parametrize("compatible", [False, True])
def test_scan_of_the_floor_is_postponed(compatible):
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


def test_a_robot_that_stays_tilted_is_mapped_after_a_metre():
    model = LaserModel.from_message(-1.5, 1.5, math.pi / 360, 344, 0.05, 10.0)
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=3, linearUpdate=0.5)), model)
    processed = []
    for k in range(23):
        pose = np.array([-1.0 + 0.1 * k, 0.2, 0.0])
        if mapper.process(mapper.reading(room(model, pose)), pose, 0.05 * k, NOD).processed:
            processed.append(k)
    assert processed == [0, 10, 15, 20]
    mapper.close()

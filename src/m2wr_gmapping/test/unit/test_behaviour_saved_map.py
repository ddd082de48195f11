# SPDX-License-Identifier: BSD-3-Clause
"""Beginning on a saved map: the robot is found, old walls stay, what has changed is unlearnt."""
import numpy as np
import pytest
from PIL import Image

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.io import state
from m2wr_gmapping.io.initial_state import InitialState
from m2wr_gmapping.mapper import Mapper
from m2wr_maps import map_file
from m2wr_maps.saved_map_reader import read_map
from m2wr_maps.se2 import between, compose, inverse

VALUES = dict(particles=6, linearUpdate=0.5, angularUpdate=0.3)


@pytest.fixture(scope="module")
def plan(mapped, tmp_path_factory):
    """Name of a saved map of the whole ring, in the frame of the first pose of the drive."""
    mapper, truth, _ = mapped(laps=1.05, noise=0.0, slip=0.0)
    grid = mapper.occupancy()
    name = str(tmp_path_factory.mktemp("map") / "plan")
    map_file.save(name, grid.data, grid.resolution, [grid.origin[0], grid.origin[1], 0.0])
    mapper.close()
    return name


def begun(plan, laser, ring, start, guess, more=None, steps=1):
    """Return a mapper that has begun on the map, with the true last pose in the frame of the map."""
    config = GmappingConfig.from_mapping(dict(VALUES, **(more or {})))
    beginning, config = InitialState.from_files(config, plan, guess)
    mapper = Mapper(config, laser)
    truth = drive(1.05)
    odom = odometry(truth, np.random.default_rng(3))
    for k in range(start, start + steps):
        reading = mapper.reading(ring.ranges(truth[k], laser.angles))
        beginning.connect(mapper, reading, odom[k], 0.1 * k)
        mapper.process(reading, odom[k], 0.1 * k)
    return mapper, between(truth[0], truth[start + steps - 1])


def test_saved_map_round_trip(plan):
    saved = read_map(plan)
    grid = np.array(Image.open(plan + ".pgm"))[::-1]
    np.testing.assert_array_equal(saved.data == 100, grid == 0)
    np.testing.assert_array_equal(saved.data == 0, grid == 254)
    np.testing.assert_array_equal(saved.data == -1, grid == 205)
    assert saved.resolution == 0.05


@pytest.mark.parametrize("off", [(0.0, 0.0, 0.0), (0.7, -0.5, 0.4), (-0.6, 0.6, -0.4)])
@pytest.mark.parametrize("start", [0, 30, 120])
def test_robot_is_localised_near_the_initial_pose(plan, laser, ring, start, off):
    truth = drive(1.05)
    guess = compose(between(truth[0], truth[start]), off)
    mapper, true = begun(plan, laser, ring, start, guess)
    apart = between(true, mapper.base_poses(mapper.pose))
    assert np.hypot(apart[0], apart[1]) < 0.08 and abs(apart[2]) < 0.02
    assert (mapper.processed, len(mapper.trajectory()[0])) == (1, 1)
    mapper.close()


def test_odometry_is_the_default_initial_pose(plan, laser, ring):
    mapper, true = begun(plan, laser, ring, 0, None)
    apart = between(true, mapper.pose)
    assert np.hypot(apart[0], apart[1]) < 0.08
    mapper.close()


@pytest.mark.parametrize("no_place", [(1e200, 0.0, 0.0), (0.0, np.nan, 0.0)])
def test_refused_first_scan_starts_nothing(plan, laser, ring, no_place):
    beginning, config = InitialState.from_files(GmappingConfig.from_mapping(VALUES), plan, (0.0, 0.0, 0.0))
    mapper, pose = Mapper(config, laser), drive(1.05)[0]
    reading = mapper.reading(ring.ranges(pose, laser.angles))
    assert beginning.connect(mapper, reading, np.array(no_place), 0.0) is None
    for begin in (mapper.process, lambda *scan: mapper.begin_on(read_map(plan), np.zeros(3), *scan)):
        with pytest.raises(ValueError, match="odometry"):
            begin(reading, np.array(no_place), 0.0)
    assert mapper.filter is None and beginning.connect(mapper, reading, pose, 0.1)
    mapper.process(reading, pose, 0.1)
    assert np.hypot(*mapper.base_poses(mapper.pose)[:2]) < 0.08
    mapper.close()


def test_saved_map_stays_in_place_through_loop_closures(plan, laser, ring):
    saved = read_map(plan)
    truth = drive(1.05)
    mapper, true = begun(plan, laser, ring, 20, between(truth[0], truth[20]), steps=190)
    mapper.finish()
    apart = between(true, mapper.base_poses(mapper.pose))
    assert np.hypot(apart[0], apart[1]) < 0.1
    grid = mapper.occupancy()
    old = saved.walls().T
    cells = np.rint((old - grid.origin) / grid.resolution).astype(int)
    near = np.zeros(len(old), bool)
    for dx in (-1, 0, 1):
        for dy in (-1, 0, 1):
            near |= grid.data[cells[:, 1] + dy, cells[:, 0] + dx] == 100
    assert near.mean() > 0.99
    first, _ = begun(plan, laser, ring, 0, None)
    known = first.occupancy().data
    assert (known == 100).sum() > 0.95 * len(old)           # all of it, after one scan
    first.close()
    mapper.close()


def test_removed_obstacles_are_cleared(plan, laser, ring):
    """A wall that stands in the old map alone, across the corridor that the robot drives along."""
    saved = read_map(plan)
    truth = drive(1.05)
    wall = between(truth[0], truth[14])[:2]
    column, row = np.rint((wall - saved.origin) / saved.resolution).astype(int)
    cells = np.s_[row - 10:row + 11, column:column + 1]
    assert (saved.data[cells] == 0).all()
    saved.data[cells] = 100
    mapper = Mapper(GmappingConfig.from_mapping(dict(VALUES, linearUpdate=0.1)), laser)
    reading = mapper.reading(ring.ranges(truth[0], laser.angles))
    mapper.begin_on(saved, np.zeros(3), reading, np.zeros(3), 0.0)
    for k in range(28):
        mapper.process(mapper.reading(ring.ranges(truth[k], laser.angles)), between(truth[0], truth[k]), 0.1 * k)
    grid = mapper.occupancy()
    column, row = np.rint((wall - grid.origin) / grid.resolution).astype(int)
    assert (grid.data[row - 10:row + 11, column:column + 1] != 100).all()
    mapper.close()


def test_run_on_a_saved_map_can_be_resumed(plan, laser, ring, tmp_path):
    digests = []
    for stop in (False, True):
        mapper, _ = begun(plan, laser, ring, 0, None, steps=40)
        if stop:
            state.save(str(tmp_path / "a.state"), state.snapshot(mapper))
            mapper.close()
            mapper = state.load(str(tmp_path / "a.state")).mapper
        truth = drive(1.05)
        odom = odometry(truth, np.random.default_rng(3))
        for k in range(40, 60):
            mapper.process(mapper.reading(ring.ranges(truth[k], laser.angles)), odom[k], 0.1 * k)
        digests.append((mapper.trajectory()[1].tobytes(), mapper.occupancy().data.tobytes()))
        mapper.close()
    assert digests[0] == digests[1]


def test_compatible_mode_starts_on_a_map(plan, laser, ring):
    mapper, true = begun(plan, laser, ring, 0, None, dict(compatible=True), steps=10)
    apart = between(true, mapper.pose)
    assert np.hypot(apart[0], apart[1]) < 0.15
    mapper.close()


def test_poses_of_a_laser_beside_the_base(plan, laser, ring):
    mapper, _ = begun(plan, laser, ring, 0, None)
    assert np.allclose(mapper.base_poses(mapper.pose), compose(mapper.pose, inverse(laser.base_from_sensor)))
    mapper.close()


def test_map_and_state_together_are_refused(tmp_path):
    with pytest.raises(state.StateError, match="expected one of them"):
        InitialState.from_files(GmappingConfig.from_mapping(), "a.yaml", None, "a.state")


def test_cell_size_is_that_of_the_map(tmp_path):
    map_file.save(str(tmp_path / "a"), np.array([[100, 0]], np.int8), 0.1, [0.0, 0.0, 0.0])
    _, config = InitialState.from_files(GmappingConfig.from_mapping({"delta": 0.05}), str(tmp_path / "a.yaml"))
    assert config["delta"] == 0.1

# SPDX-License-Identifier: BSD-3-Clause
"""The whole filter on a ring of corridors with bad odometry."""
import hashlib
import math
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

from conftest import drive, odometry
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import between, compose, wrap


def errors(mapper, truth):
    """Errors (K,) [m], [rad] of the final path against the truth, both seen from their first pose."""
    stamps, poses = mapper.trajectory()
    at = np.round(np.array(stamps) / 0.1).astype(int)
    difference = between(between(truth[0], truth[at]), between(poses[0], poses))
    return np.hypot(difference[:, 0], difference[:, 1]), np.abs(difference[:, 2])


def digest(mapper):
    return hashlib.sha256(mapper.occupancy().data.tobytes() + mapper.trajectory()[1].tobytes()).hexdigest()


def test_ring_is_closed_despite_odometry_drift(mapped):
    mapper, truth, odom = mapped(laps=1.3)
    mapper.finish()
    drift = between(between(truth[0], truth[-1]), between(odom[0], odom[-1]))
    assert np.hypot(drift[0], drift[1]) > 2.0           # otherwise this shows nothing
    metres, radians = errors(mapper, truth)
    assert metres.max() < 0.15 and radians.max() < 0.03
    mapper.close()


def test_loop_closure_corrects_the_path(mapped):
    mapper, _, _ = mapped(laps=1.3)
    assert mapper.info()["links"] > 0
    mapper.close()


def test_poor_odometry_gives_a_usable_map(mapped):
    mapper, truth, _ = mapped(laps=0.6, noise=0.15, slip=0.05)
    metres, radians = errors(mapper, truth)
    assert metres.max() < 0.25 and radians.max() < 0.05
    mapper.close()


def test_map_does_not_depend_on_the_number_of_threads(mapped):
    digests = set()
    for threads in (1, 2, 1):
        mapper, _, _ = mapped(laps=1.2, seed=3, threads=threads)
        mapper.finish()
        digests.add(digest(mapper))
        mapper.close()
    assert len(digests) == 1
    mapper, _, _ = mapped(laps=1.2, seed=4)
    mapper.finish()
    assert digest(mapper) not in digests
    mapper.close()


def test_compatible_mode_neither_tracks_nor_closes_loops(mapped):
    mapper, truth, _ = mapped(laps=0.4, compatible=True, particles=6, noise=0.01, slip=0.0)
    assert mapper.tracked == 0 and mapper.info() == {}
    assert len(mapper.trajectory()[0]) == mapper.processed
    metres, _ = errors(mapper, truth)
    assert metres.max() < 0.3
    mapper.close()


def test_track_between_gives_poses_of_intermediate_scans(mapped):
    mapper, truth, _ = mapped(laps=0.3)
    assert len(mapper.trajectory()[0]) == mapper.processed + mapper.tracked > mapper.processed
    assert len(mapper.trajectory(between_too=False)[0]) == mapper.processed
    mapper.close()
    mapper, _, _ = mapped(laps=0.3, track_between=False)
    assert mapper.tracked == 0
    mapper.close()


def test_map_shows_the_walls(mapped, ring):
    mapper, truth, _ = mapped(laps=1.2)
    mapper.finish()
    grid = mapper.occupancy()
    rows, columns = np.nonzero(grid.data == 100)
    at = grid.origin + grid.resolution * np.stack([columns, rows], -1)
    at = compose(truth[0], np.column_stack([at, np.zeros(len(at))]))[:, :2]         # the map begins at the first pose
    x0, y0, x1, y1 = ring.walls.T
    along = np.stack([x1 - x0, y1 - y0], -1)
    part = np.clip(((at[:, None] - ring.walls[:, :2]) * along).sum(-1) / np.square(along).sum(-1), 0.0, 1.0)
    gap = np.linalg.norm(at[:, None] - (ring.walls[:, :2] + part[..., None] * along), axis=-1).min(axis=1)
    assert len(at) > 1000 and (gap < 0.1).mean() > 0.99
    mapper.close()


def test_the_last_map_needs_no_maps_of_particles(mapped):
    mapper, _, _ = mapped(laps=0.4)
    drawn, counted = mapper.last_map(), mapper.occupancy()
    assert np.array_equal(drawn.data, counted.data) and np.array_equal(drawn.origin, counted.origin)
    assert not mapper.particles.maps.mean.size
    mapper.close()


def test_map_from_odom_transforms_odometry_to_the_pose(mapped):
    mapper, _, odom = mapped(laps=0.3)
    found = compose(mapper.map_from_odom, odom[-1])
    assert np.allclose(found[:2], mapper.pose[:2]) and abs(wrap(found[2] - mapper.pose[2])) < 1e-9
    mapper.close()


def test_stationary_robot_changes_nothing(mapped, ring, laser):
    mapper, truth, odom = mapped(laps=0.2)
    processed, tracked, used = mapper.processed, mapper.tracked, mapper.filter.maps.compact()["mean"]
    nodes = mapper.filter.tree.depth
    reading = laser.reading(ring.ranges(truth[-1], laser.angles))
    for k in range(200):
        update = mapper.process(reading, odom[-1], 1000.0 + k)
        assert not update.processed
    assert (mapper.processed, mapper.filter.tree.depth) == (processed, nodes)
    assert len(mapper.filter.maps.compact()["mean"]) == len(used)
    assert mapper.tracked <= tracked + 1
    mapper.close()


@pytest.mark.parametrize("ranges", [np.inf, np.nan, 0.0, -1.0, 1e9])
def test_empty_scans_are_accepted(mapped, laser, ranges):
    mapper, _, odom = mapped(laps=0.1)
    for k in range(12):
        at = compose(odom[-1], [0.3 * k, 0.0, 0.0])
        update = mapper.process(laser.reading(np.full(181, ranges)), at, 500.0 + k)
        assert np.isfinite(update.pose).all()
    assert np.isfinite(mapper.entropy)
    mapper.finish()
    mapper.occupancy()
    mapper.close()


def test_non_finite_pose_is_refused(mapped, laser):
    mapper, _, odom = mapped(laps=0.1)
    before = mapper.pose
    with pytest.raises(ValueError, match="not finite"):
        mapper.process(laser.reading(np.full(181, 2.0)), [np.nan, 0.0, 0.0], 99.0)
    assert (mapper.pose == before).all()
    mapper.close()


def test_distant_robot_uses_bounded_memory(mapped, laser):
    mapper, _, odom = mapped(laps=0.1)
    for k in range(8):
        mapper.process(laser.reading(np.full(181, 3.0)), compose(odom[-1], [400.0 * k, 400.0 * k, 0.0]), 500.0 + k)
    grid = mapper.occupancy()
    assert grid.data.size <= 100000000 and mapper.filter.maps.beyond > 0
    mapper.close()


def test_path_is_that_of_the_base(mapped):
    mapper, _, _ = mapped(laps=0.1)
    model = LaserModel.from_message(-1.0, 1.0, 0.1, 21, 0.1, 9.0, ((0.3, 0.1, 0.2), (0.0, 0.0, 0.0, 1.0)))
    mapper.laser = model
    assert np.allclose(mapper.base_poses(np.zeros(3)), [-0.3, -0.1, 0.0])
    mapper.close()


def test_map_limits_do_not_change_matches(mapped):
    paths = []
    for limit in (10.0, 1.0, 37.3):
        mapper, _, _ = mapped(laps=0.4, xmin=-limit, xmax=limit, ymin=-limit, ymax=2.0 * limit)
        paths.append(mapper.trajectory()[1])
        mapper.close()
    np.testing.assert_array_equal(paths[0], paths[1])
    np.testing.assert_array_equal(paths[0], paths[2])


def test_temporal_update_counts_from_the_first_scan(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2, "temporalUpdate": 5.0}), laser)
    reading = mapper.reading(ring.ranges(drive(0.1)[0], laser.angles))
    done = [mapper.process(reading, np.zeros(3), 1e9 + at).processed for at in (0.0, 0.1, 5.0, 5.1, 10.0, 10.3)]
    assert done == [True, False, False, True, False, True]
    mapper.close()


def test_nothing_is_printed(mapped, capfd):
    mapper, _, _ = mapped(laps=0.3)
    mapper.finish()
    mapper.occupancy()
    mapper.close()
    assert capfd.readouterr() == ("", "")


def test_entropy_is_that_of_the_weights(mapped):
    mapper, _, _ = mapped(laps=0.3, particles=12, resampleThreshold=0.0)
    weights = mapper.filter.weights
    assert mapper.entropy == pytest.approx(-np.sum(weights * np.log(weights)))
    assert 0.0 < mapper.entropy <= math.log(12)
    mapper.close()


def test_memory_is_bounded_while_driving_back_and_forth(laser, ring):
    """Matching alone keeps nothing; what is registered again and again costs no further tiles."""
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 4, "linearUpdate": 100.0, "angularUpdate": 100.0}), laser)
    truth = drive(0.1)
    for k in range(120):
        pose = truth[k % 4]
        mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), pose, 0.1 * k)
    assert len(mapper.readings) == 1 and len(mapper.filter.tree.leaves) == 4 and mapper.filter.tree.depth == 1
    assert len(mapper.filter.maps.compact()["mean"]) < 4 * 400
    mapper.close()


def test_ten_thousand_particles_map():
    few = LaserModel.from_message(-1.0, 1.0, 0.25, 9, 0.1, 10.0)
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 10000, "linearUpdate": 0.1}), few)
    for k in range(3):
        mapper.process(mapper.reading(2.0 - 0.12 * k + np.zeros(9)), [0.12 * k, 0.0, 0.0], float(k))
    assert mapper.processed == 3 and abs(mapper.pose[0] - 0.24) < 0.05
    mapper.close()


def test_one_particle_maps(mapped):
    mapper, truth, _ = mapped(laps=0.3, particles=1)
    assert mapper.entropy == 0.0 and mapper.filter.n_eff == 1.0 and mapper.processed > 5
    mapper.close()


def test_run_with_constant_odometry_stays_finite(ring, laser):
    """Wheels that slip wholly: odometry says nothing has moved."""
    truth = drive(0.15)[:10]
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 5, "temporalUpdate": 0.0}), laser)
    for k, pose in enumerate(truth):
        mapper.process(mapper.reading(ring.ranges(pose, laser.angles)), np.zeros(3), 0.1 * k)
        assert np.isfinite(mapper.pose).all()
    mapper.close()


def test_odometry_of_other_number_types_is_accepted(ring, laser):
    mapper = Mapper(GmappingConfig.from_mapping({"particles": 2}), laser)
    odom = odometry(drive(0.1), np.random.default_rng(0)).astype(np.float32)
    reading = mapper.reading(tuple(ring.ranges(drive(0.1)[0], laser.angles)))
    assert mapper.process(reading, list(odom[0]), 0).processed
    mapper.close()


def test_memory_is_constant_for_a_stationary_robot(ring, laser):
    """Two thousand scans, a map of each hundredth."""
    mapper = Mapper(GmappingConfig.from_mapping(dict(particles=5, linearUpdate=0.3)), laser)
    truth, rng, held = drive(0.2), np.random.default_rng(2), []
    tracemalloc.start()
    try:
        for k in range(len(truth) + 2000):
            if k < len(truth):
                pose, ranges = truth[k], ring.ranges(truth[k], laser.angles)
            mapper.process(mapper.reading(ranges + rng.normal(0.0, 0.01, len(ranges))), pose, 0.1 * k)
            if k % 100 == 0:
                mapper.map_of(*mapper.map_request())
                held.append(tracemalloc.get_traced_memory()[0])
    finally:
        tracemalloc.stop()
        mapper.close()
    assert mapper.processed > 5
    assert max(held[3:]) - held[2] < 20000


def test_a_mapper_without_a_scan_says_so():
    mapper = Mapper(GmappingConfig.from_mapping({"threads": 1}), LaserModel.from_message(
        -1.0, 1.0, 0.1, 21, 0.1, 10.0))
    with pytest.raises(RuntimeError, match="before its first scan"):
        mapper.occupancy()
    mapper.close()


@pytest.mark.parametrize("behind, contradicted", [(5.0, True), (40.0, False)])
def test_only_recent_scans_tell_of_a_slip(behind, contradicted):
    """The path has come back to a place, with its drift; the walls there were seen ``behind`` metres of path ago."""
    laser = LaserModel.from_message(-math.pi, math.pi, math.pi / 90, 181, 0.05, 20.0)
    mapper = Mapper(GmappingConfig.from_mapping({"threads": 1}), laser)
    near, far = (mapper.reading(np.full(181, metres)) for metres in (2.0, 5.0))
    path = np.zeros((3, 3))
    path[1, 0] = 0.5 * behind
    mapper.filter = SimpleNamespace(best=0, tree=SimpleNamespace(path=lambda particle: path))
    mapper.readings = [near, mapper.reading(np.full(181, math.nan)), far]
    found = mapper._conflict_of(far)(np.zeros(3))
    assert (found.share > 0.3) == contradicted
    mapper.close()

# SPDX-License-Identifier: BSD-3-Clause
"""The whole filter on a ring of corridors with bad odometry."""
import hashlib

import numpy as np
import pytest

from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.se2 import between, compose, wrap


def errors(mapper, truth):
    """Errors (K,) [m], [rad] of the final path against the truth, both seen from their first pose."""
    stamps, poses = mapper.trajectory()
    at = np.round(np.array(stamps) / 0.1).astype(int)
    difference = between(between(truth[0], truth[at]), between(poses[0], poses))
    return np.hypot(difference[:, 0], difference[:, 1]), np.abs(difference[:, 2])


def digest(mapper):
    return hashlib.sha256(mapper.occupancy().data.tobytes() + mapper.trajectory()[1].tobytes()).hexdigest()


def test_ring_is_closed_although_odometry_is_far_off(mapped):
    mapper, truth, odom = mapped(laps=1.3)
    mapper.finish()
    drift = between(between(truth[0], truth[-1]), between(odom[0], odom[-1]))
    assert np.hypot(drift[0], drift[1]) > 2.0           # otherwise this shows nothing
    metres, radians = errors(mapper, truth)
    assert metres.max() < 0.15 and radians.max() < 0.03
    mapper.close()


def test_a_loop_is_found_and_bends_the_path(mapped):
    mapper, _, _ = mapped(laps=1.3)
    assert mapper.info()["links"] > 0
    mapper.close()


def test_poor_odometry_is_survived(mapped):
    mapper, truth, _ = mapped(laps=0.6, noise=0.15, slip=0.05)
    metres, radians = errors(mapper, truth)
    assert metres.max() < 0.25 and radians.max() < 0.05
    mapper.close()


def test_one_seed_gives_one_map_with_one_thread_and_with_two(mapped):
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


def test_compatible_takes_only_due_scans_and_neither_tracks_nor_links(mapped):
    mapper, truth, _ = mapped(laps=0.4, compatible=True, particles=6, noise=0.01, slip=0.0)
    assert mapper.tracked == 0 and mapper.info() == {}
    assert len(mapper.trajectory()[0]) == mapper.processed
    metres, _ = errors(mapper, truth)
    assert metres.max() < 0.3
    mapper.close()


def test_scans_between_have_poses_unless_switched_off(mapped):
    mapper, truth, _ = mapped(laps=0.3)
    assert len(mapper.trajectory()[0]) == mapper.processed + mapper.tracked > mapper.processed
    assert len(mapper.trajectory(between_too=False)[0]) == mapper.processed
    mapper.close()
    mapper, _, _ = mapped(laps=0.3, track_between=False)
    assert mapper.tracked == 0
    mapper.close()


def test_map_shows_the_walls_where_they_are(mapped, ring):
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


def test_map_from_odom_takes_odometry_to_the_pose(mapped):
    mapper, _, odom = mapped(laps=0.3)
    found = compose(mapper.map_from_odom, odom[-1])
    assert np.allclose(found[:2], mapper.pose[:2]) and abs(wrap(found[2] - mapper.pose[2])) < 1e-9
    mapper.close()


def test_standing_still_changes_nothing(mapped, ring, laser):
    mapper, truth, odom = mapped(laps=0.2)
    processed, tracked, tiles = mapper.processed, mapper.tracked, mapper.filter.maps.tiles_in_use
    nodes = len(mapper.filter.tree)
    reading = laser.reading(ring.ranges(truth[-1], laser.angles))
    for k in range(200):
        update = mapper.process(reading, odom[-1], 1000.0 + k)
        assert not update.processed
    assert (mapper.processed, mapper.filter.maps.tiles_in_use, len(mapper.filter.tree)) == (processed, tiles, nodes)
    assert mapper.tracked <= tracked + 1
    mapper.close()


@pytest.mark.parametrize("ranges", [np.inf, np.nan, 0.0, -1.0, 1e9])
def test_scans_that_show_nothing_are_survived(mapped, laser, ranges):
    mapper, _, odom = mapped(laps=0.1)
    for k in range(12):
        at = compose(odom[-1], [0.3 * k, 0.0, 0.0])
        update = mapper.process(laser.reading(np.full(181, ranges)), at, 500.0 + k)
        assert np.isfinite(update.pose).all()
    assert np.isfinite(mapper.entropy)
    mapper.finish()
    mapper.occupancy()
    mapper.close()


def test_a_pose_that_is_not_finite_is_refused_and_changes_nothing(mapped, laser):
    mapper, _, odom = mapped(laps=0.1)
    before = mapper.pose
    with pytest.raises(ValueError, match="not finite"):
        mapper.process(laser.reading(np.full(181, 2.0)), [np.nan, 0.0, 0.0], 99.0)
    assert (mapper.pose == before).all()
    mapper.close()


def test_a_robot_two_kilometres_away_is_bounded_in_memory(mapped, laser):
    mapper, _, odom = mapped(laps=0.1)
    for k in range(8):
        mapper.process(laser.reading(np.full(181, 3.0)), compose(odom[-1], [400.0 * k, 400.0 * k, 0.0]), 500.0 + k)
    grid = mapper.occupancy()
    assert grid.data.size <= 100000000 and mapper.filter.maps.beyond > 0
    mapper.close()


def test_off_centre_laser_moves_the_path_to_the_base(mapped):
    mapper, _, _ = mapped(laps=0.1)
    model = LaserModel.from_message(-1.0, 1.0, 0.1, 21, 0.1, 9.0, ((0.3, 0.1, 0.2), (0.0, 0.0, 0.0, 1.0)))
    mapper.laser = model
    assert np.allclose(mapper.base_poses(np.zeros(3)), [-0.3, -0.1, 0.0])
    mapper.close()

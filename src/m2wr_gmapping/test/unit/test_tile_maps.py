# SPDX-License-Identifier: BSD-3-Clause
"""Tile maps: means and hits equal those of a dictionary; copy-on-write sharing has no side effects."""
import math
from types import SimpleNamespace

import numpy as np
import pytest

from m2wr_gmapping.filter.tile_kernels import bounds, draw_field, tiles_around
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps

ROUNDED = 0.05 / 255        # a mean is rounded to a 255th of a cell by each hit, half up or down [m]


def tiles(maps, particle):
    """Tile of one particle at each place, (8 H, 8 W); -1 for none."""
    _, rows, columns = maps.table.shape
    found = np.where((maps.table[particle] >= 0)[..., None, None], maps.blocks[maps.table[particle]], -1)
    return found.swapaxes(1, 2).reshape(8 * rows, 8 * columns)


def cells(maps, particle):
    """{(column, row) on the absolute lattice: (hits, mean x, mean y)} of one particle's map."""
    found, table = {}, tiles(maps, particle)
    for ty, tx in zip(*np.nonzero(table >= 0)):
        tile = table[ty, tx]
        for cell in np.flatnonzero(maps.hits[tile]):
            x, y = tx * 16 + cell % 16, ty * 16 + cell // 16
            mean = maps.frame[:2] + (np.array([x, y]) + maps.mean[tile, cell] / 255.0) / maps.frame[2]
            key = tuple(np.round(maps.frame[:2] / 0.05 + 0.5 + [x, y]).astype(int))
            found[key] = int(maps.hits[tile, cell]), mean[0], mean[1]
    return found


def plain(scans):
    """The same from (pose, points) pairs, cell by cell; cell centres are at whole multiples of 0.05 m."""
    sums = {}
    for (x, y, theta), points in scans:
        c, s = math.cos(theta), math.sin(theta)
        for qx, qy in points.T:
            wx, wy = x + c * qx - s * qy, y + s * qx + c * qy
            entry = sums.setdefault((math.floor(wx / 0.05 + 0.5), math.floor(wy / 0.05 + 0.5)), [0, 0.0, 0.0])
            entry[0] += 1
            entry[1] += wx
            entry[2] += wy
    return {key: (n, sx / n, sy / n) for key, (n, sx, sy) in sums.items()}


def same(found, expected):
    assert found.keys() == expected.keys()
    for key, (hits, x, y) in expected.items():
        assert found[key][0] == hits and abs(found[key][1] - x) < ROUNDED and abs(found[key][2] - y) < ROUNDED


def used(maps):
    """Number of tiles that particles hold."""
    return len(maps.compact()["mean"])


def used_blocks(maps):
    """Number of blocks that particles hold."""
    return len(maps.compact()["blocks"])


def fill(maps, particle, pose, points):
    maps.register(np.array([pose], float), points, particle)


def test_registration_equals_reference():
    rng = np.random.default_rng(0)
    maps, scans = TileMaps(1, 0.05, NEVER), []
    for _ in range(5):
        pose, points = rng.uniform(-4, 4, 3), rng.uniform(-6, 6, (2, 400))
        scans.append((pose, points))
        fill(maps, 0, pose, points)
    same(cells(maps, 0), plain(scans))


@pytest.mark.parametrize("particles, points", [(1, 1), (20, 300)])
def test_scan_bounds_equal_reference(particles, points):
    rng = np.random.default_rng(points)
    poses, seen = rng.uniform(-9, 9, (particles, 3)), rng.uniform(-4, 4, (2, points))
    reach = max(math.hypot(x, y) for x, y in seen.T)
    low, high = bounds(poses, seen)
    assert low == pytest.approx([min(poses[:, 0]) - reach, min(poses[:, 1]) - reach])
    assert high == pytest.approx([max(poses[:, 0]) + reach, max(poses[:, 1]) + reach])


def test_all_particles_equal_one_after_the_other():
    rng = np.random.default_rng(4)
    poses, points = rng.uniform(-4, 4, (40, 3)), rng.uniform(-30, 30, (2, 500))
    one, all_at_once = TileMaps(40, 0.05, NEVER), TileMaps(40, 0.05, NEVER)
    for maps in (one, all_at_once):
        maps.cover(np.full(2, -60.0), np.full(2, 60.0))
    for particle, pose in enumerate(poses):
        one.register(pose[None], points, particle)
    all_at_once.register(poses, points)
    assert used(all_at_once) == used(one) > 1024          # storage had to grow on the way
    for particle in (0, 7, 39):
        assert cells(one, particle) == cells(all_at_once, particle)


def test_a_write_copies_only_its_own_block_and_tile():
    maps = TileMaps(3, 0.05, NEVER)
    everywhere, one = np.stack(np.meshgrid(np.arange(0.2, 30.0, 0.4), np.arange(0.2, 30.0, 0.4))), np.full((2, 1), 10.0)
    fill(maps, 0, (0, 0, 0), everywhere.reshape(2, -1))
    maps.resample(np.zeros(3, np.int64))
    number, blocks = used(maps), used_blocks(maps)
    assert blocks > 16 and number > 1000
    fill(maps, 1, (0, 0, 0), one)
    fill(maps, 1, (0, 0, 0), one)
    assert (used(maps), used_blocks(maps)) == (number + 1, blocks + 1)
    fill(maps, 2, (0, 0, 0), one)
    assert (used(maps), used_blocks(maps)) == (number + 2, blocks + 2)
    changed = tiles(maps, 1) != tiles(maps, 0)
    assert changed.sum() == 1 and (tiles(maps, 2) != tiles(maps, 0)).tolist() == changed.tolist()


@pytest.mark.parametrize("count", [1, 30, 80])
def test_tables_of_a_large_map_are_small(count):
    maps = TileMaps(count, 0.05, NEVER)
    assert maps.cover(np.full(2, -150.0), np.full(2, 150.0))
    assert maps.table.nbytes == count * maps.table[0].nbytes < count * 12000


def test_particles_share_until_they_write():
    rng = np.random.default_rng(1)
    maps = TileMaps(3, 0.05, NEVER)
    first, second = rng.uniform(-6, 6, (2, 300)), rng.uniform(-6, 6, (2, 300))
    fill(maps, 0, (0, 0, 0), first)
    tiles = used(maps)
    maps.resample(np.array([0, 0, 0]))
    assert used(maps) == tiles
    fill(maps, 1, (0.1, 0.2, 0.3), second)
    origin = ((0.0, 0.0, 0.0), first)
    same(cells(maps, 0), plain([origin]))
    same(cells(maps, 1), plain([origin, ((0.1, 0.2, 0.3), second)]))
    same(cells(maps, 2), plain([origin]))


@pytest.mark.parametrize("ancestors", ([0, 1, 2, 1, 1], [3, 3, 3, 3, 3], [1, 2, 0, 0, 4], [4, 1, 1], [0, 1, 2, 3, 4]))
def test_each_particle_gets_the_map_of_its_ancestor(ancestors):
    rng = np.random.default_rng(3)
    maps = TileMaps(5, 0.05, NEVER)
    for particle in range(5):
        fill(maps, particle, rng.uniform(-1, 1, 3), rng.uniform(-6, 6, (2, 100)))
    before = [cells(maps, particle) for particle in range(5)]
    maps.resample(np.array(ancestors))
    assert [cells(maps, particle) for particle in range(len(ancestors))] == [before[k] for k in ancestors]
    held = np.concatenate([tiles(maps, particle).ravel() for particle in range(len(ancestors))])
    assert used(maps) == len(np.unique(held[held >= 0]))
    assert used_blocks(maps) == len(np.unique(maps.table[maps.table >= 0]))


def test_released_maps_keep_no_tile():
    maps = TileMaps(2, 0.05, NEVER, limit=500000)
    fill(maps, 0, (0.0, 0.0, 0.0), np.array([[1.0], [2.0]]))
    fill(maps, 0, (0.0, 0.0, 0.0), np.array([[500.0], [2.0]]))
    maps.release()
    assert maps.beyond == 1 and not sum(part.size for part in (maps.table, *maps.layout[:3]))


def test_a_path_is_registered_as_scan_by_scan():
    rng = np.random.default_rng(7)
    path = rng.uniform(-3, 3, (150, 3))
    readings = [SimpleNamespace(points=rng.uniform(-20, 20, (2, count))) for count in rng.integers(0, 60, 150)]
    readings[100].points[:] = 4000.0                     # exceeds the limit: is left out, the others are not
    together, single = TileMaps(1, 0.05, NEVER), TileMaps(1, 0.05, NEVER)
    together.register_path(path, readings)
    for k, reading in enumerate(readings):
        single.register(path[k:k + 1], reading.points)
    same(cells(together, 0), cells(single, 0))
    assert together.beyond == single.beyond > 0


def test_dropped_maps_give_their_tiles_back_and_storage_grows():
    rng = np.random.default_rng(2)
    maps, scans = TileMaps(4, 0.05, NEVER), []
    for particle in range(4):
        scans.append(((0.0, 0.0, 0.1 * particle), rng.uniform(-12, 12, (2, 3000))))
        fill(maps, particle, *scans[-1])
    assert used(maps) > 1024
    for particle in range(4):
        same(cells(maps, particle), plain([scans[particle]]))
    maps.clear()
    assert used(maps) == 0


def test_frozen_cells_stay():
    maps = TileMaps(1, 0.05, 3)
    for k in range(6):
        fill(maps, 0, (0, 0, 0), np.array([[1.0 + 0.002 * k], [1.0]]))
    (hits, x, _), = cells(maps, 0).values()
    assert hits == 3 and abs(x - 1.002) < ROUNDED


@pytest.mark.parametrize("low, high", [
    ((-40.0, -3.0), (3.0, 3.0)), ((-3.0, -3.0), (9.0, 40.0)), ((-50.0, -50.0), (50.0, 50.0))])
def test_a_table_that_grows_keeps_all_maps(low, high):
    rng = np.random.default_rng(3)
    maps = TileMaps(3, 0.05, NEVER)
    for particle in range(3):
        fill(maps, particle, (0.0, 0.0, 0.1 * particle), rng.uniform(-4, 4, (2, 300)))
    before, size = [cells(maps, particle) for particle in range(3)], maps.table.size
    assert maps.cover(low, high) and maps.table.size > size
    for particle in range(3):
        found = cells(maps, particle)
        assert found.keys() == before[particle].keys()
        assert all(found[key] == pytest.approx(before[particle][key]) for key in found)


def test_table_does_not_grow_beyond_its_limit():
    maps = TileMaps(1, 0.05, NEVER, limit=500000)
    fill(maps, 0, (0, 0, 0), np.array([[1.0], [1.0]]))
    fill(maps, 0, (5000, 0, 0), np.array([[1.0], [1.0]]))
    assert maps.beyond == 1 and len(cells(maps, 0)) == 1


def test_points_outside_the_table_limit_are_ignored():
    maps = TileMaps(2, 0.05)
    assert maps.cover(np.zeros(2), np.ones(2))
    shape = maps.table.shape
    for far in (1e4, 1e9, 1e15, 1e300):
        assert not maps.cover(np.full(2, -far), np.full(2, far))
    assert maps.table.shape == shape and maps.beyond == 4


def everywhere(maps):
    return ~maps.no_tiles()


@pytest.mark.parametrize("seed", range(5))
def test_marked_tiles_cover_all_shifted_points(seed):
    rng = np.random.default_rng(seed)
    maps = TileMaps(1, 0.05)
    maps.cover(np.full(2, -12.0), np.full(2, 12.0))
    maps.register(np.zeros((1, 3)), rng.uniform(-11.0, 11.0, (2, 4000)))
    centre, points = rng.uniform(-3.0, 3.0, 3), rng.uniform(-4.0, 4.0, (2, 3))
    reach, widest, count = float(rng.uniform(0.1, 0.8)), float(rng.uniform(0.02, 0.9)), int(rng.integers(1, 12))
    marked = maps.no_tiles()
    tiles_around(centre, widest, count, points, 1, reach, maps.frame, marked)
    assert 0 < marked.sum() < marked.size       # the points are few: not all of the map is near one
    corner = np.zeros(2, np.int64)
    whole, part = (np.zeros((marked.shape[0] * 16, marked.shape[1] * 16), np.uint8) for _ in range(2))
    draw_field(maps.table[0], *maps.layout, corner, 0.05, everywhere(maps), whole)
    draw_field(maps.table[0], *maps.layout, corner, 0.05, marked, part)
    assert (whole != part).any()
    for theta in centre[2] + np.linspace(-widest, widest, 2 * count + 1):
        c, s = math.cos(theta), math.sin(theta)
        for x, y in np.array([[c, -s], [s, c]]).dot(points).T + centre[:2]:
            (left, low), (right, high) = (
                np.clip(((np.array([x, y]) + side - maps.frame[:2]) * 20.0).astype(int), 0, None)
                for side in (-reach, reach))
            np.testing.assert_array_equal(whole[low:high + 1, left:right + 1], part[low:high + 1, left:right + 1])


@pytest.mark.parametrize("seed", range(3))
def test_field_holds_the_value_of_the_nearest_mean(seed):
    rng, sigma = np.random.default_rng(seed), 0.05
    maps = TileMaps(2, 0.05)
    maps.cover(np.full(2, -3.0), np.full(2, 3.0))
    maps.register(np.array([[0.3, -0.2, 0.7]]), rng.uniform(-2.0, 2.0, (2, 60)), 1)
    corner = rng.integers(-30, 0, 2)            # outside the table
    field = np.full((270, 290), 7, np.uint8)
    draw_field(maps.table[1], *maps.layout, corner, sigma, everywhere(maps), field)
    wanted = np.zeros((274, 294))                 # with a border of two cells, which other means reach into
    for _, x, y in cells(maps, 1).values():
        at = (np.array([x, y]) - maps.frame[:2]) / 0.05 - corner
        column, row = np.floor(at).astype(int)
        for cy in range(max(row - 2, -2), min(row + 3, 272)):
            for cx in range(max(column - 2, -2), min(column + 3, 292)):
                squared = 0.05**2 * np.square(at - [cx + 0.5, cy + 0.5]).sum()
                wanted[cy + 2, cx + 2] = max(wanted[cy + 2, cx + 2], 255.0 * math.exp(-squared / sigma))
    wanted, inside = wanted[2:-2, 2:-2], np.s_[4:-4, 4:-4]      # means within two cells of the border are left out
    assert (wanted[inside] > 100).sum() > 200
    assert np.abs(field[inside] - wanted[inside]).max() < 8.0

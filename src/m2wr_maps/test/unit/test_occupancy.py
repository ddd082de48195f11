# SPDX-License-Identifier: BSD-3-Clause
"""The published map: tracing, growth, and incremental updates."""
import math

import numpy as np
import pytest

from m2wr_maps.occupancy import Occupancy


class Reading:
    def __init__(self, rays, hits=None):
        self.rays = np.asarray(rays, np.float32)
        self.ray_hits = np.ones(self.rays.shape[1], bool) if hits is None else np.asarray(hits, bool)


def line(x0, y0, x1, y1):
    """Cells of a line by the textbook, from the end with the smaller main coordinate."""
    steep = abs(y1 - y0) > abs(x1 - x0)
    a, b = ((y0, x0), (y1, x1)) if steep else ((x0, y0), (x1, y1))
    if a[0] > b[0]:
        a, b = b, a
    da, db, rise, at = b[0] - a[0], abs(b[1] - a[1]), 1 if b[1] > a[1] else -1, a[1]
    d, cells = 2 * db - da, []
    for main in range(a[0], b[0] + 1):
        cells.append((at, main) if steep else (main, at))
        if d > 0:
            at += rise
            d += 2 * (db - da)
        else:
            d += 2 * db
    return cells


def plain(path, readings, origin, shape, resolution, threshold):
    hits, visits = np.zeros(shape, int), np.zeros(shape, int)
    for (px, py, theta), reading in zip(path, readings):
        c, s = math.cos(theta), math.sin(theta)
        x0, y0 = (math.floor((p - o) / resolution + 0.5) for p, o in zip((px, py), origin))
        for (qx, qy), hit in zip(reading.rays.T.astype(float), reading.ray_hits):
            x1 = math.floor((px + c * qx - s * qy - origin[0]) / resolution + 0.5)
            y1 = math.floor((py + s * qx + c * qy - origin[1]) / resolution + 0.5)
            for x, y in line(x0, y0, x1, y1):
                if (x, y) != (x1, y1):
                    visits[y, x] += 1
            if hit:
                visits[y1, x1] += 1
                hits[y1, x1] += 1
    return np.where(visits == 0, -1, np.where(hits / np.maximum(visits, 1) > threshold, 100, 0))


def scans(seed, count=12):
    rng = np.random.default_rng(seed)
    path = np.column_stack([rng.uniform(-2, 2, (count, 2)), rng.uniform(-3, 3, count)])
    return path, [Reading(rng.uniform(-3, 3, (2, 40)), rng.random(40) < 0.8) for _ in range(count)]


def occupancy(extent=6.4):
    return Occupancy((-extent, -extent, extent, extent), 0.1, 0.25)


@pytest.mark.parametrize("seed", range(4))
def test_counts_equal_reference(seed):
    path, readings = scans(seed)
    made = occupancy()
    made.update(path, readings)
    grid = made.grid()
    assert np.array_equal(grid.data, plain(path, readings, grid.origin, grid.data.shape, 0.1, 0.25))


@pytest.mark.parametrize("reach", (3.0, 60.0, 300.0))          # within one strip, across several, beyond the size limit
def test_a_drawn_map_equals_one_from_counts(reach):
    path, readings = scans(5)
    far = Reading(np.random.default_rng(6).uniform(-reach, reach, (2, 60)))
    made, counted = (Occupancy((-6.4, -6.4, 6.4, 6.4), 0.1, 0.25, most_cells=4000000) for _ in range(2))
    path, readings = np.vstack([path, [0.1, 0.2, 0.3]]), readings + [far]
    drawn = made.draw(path, readings)
    counted.update(path, readings)
    expected = counted.grid()
    assert np.array_equal(drawn.data, expected.data) and np.array_equal(drawn.origin, expected.origin)
    assert made.beyond == counted.beyond == (reach > 100.0) and (drawn.data == 100).any()


def test_a_map_drawn_on_a_saved_one_has_its_cells():
    path, readings = scans(9)
    ground = occupancy()
    ground.update(path[:6], readings[:6])
    saved = ground.grid()
    made, counted = Occupancy.on(saved, 0.25), Occupancy.on(saved, 0.25)
    drawn = made.draw(path[6:], readings[6:])
    counted.update(path[6:], readings[6:])
    assert np.array_equal(drawn.data, counted.grid().data)


def test_incremental_map_equals_a_new_map():
    path, readings = scans(7, 30)
    kept, rng = occupancy(), np.random.default_rng(8)
    for count in (1, 2, 10, 11, 25, 30):
        for k in rng.choice(count, min(3, count), replace=False):
            path[k, :2] += rng.normal(0.0, 0.2, 2)              # poses of the past change, a few at a time
        kept.update(path[:count], readings[:count])
        grid = kept.grid()
        rebuilt = Occupancy((-6.4, -6.4, 6.4, 6.4), 0.1, 0.25)
        rebuilt.update(path[:count], readings[:count])
        fresh = rebuilt.grid()
        assert np.array_equal(grid.origin, fresh.origin) and np.array_equal(grid.data, fresh.data)


def test_unchanged_scans_are_not_traced_again():
    path, readings = scans(9, 20)
    made = occupancy()
    made.update(path[:19], readings[:19])
    made.update(path, readings)
    assert made.traced == 20
    nudged = path + [0.002, 0.0, 0.0]
    made.update(nudged, readings, (0.005, 0.005, 0.005))
    assert made.traced == 20
    made.update(nudged, readings)
    assert made.traced > 20


def test_size_is_a_multiple_of_the_patch():
    for extent, delta, cells in ((100.0, 0.05, 4000), (1.0, 0.05, 32), (50.0, 0.05, 1984)):
        assert Occupancy((-extent, -extent, extent, extent), delta, 0.25).bounds == (cells, cells)


def test_grid_grows_by_10_m_on_the_crossed_side():
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, 0.25)
    made.update(np.zeros((1, 3)), [Reading([[9.0], [0.0]])])
    grid = made.grid()
    assert grid.origin.tolist() == [-5.0, -5.0] and grid.data.shape[0] == 192
    right = grid.origin[0] + 0.05 * grid.data.shape[1]
    assert 19.0 <= right < 19.0 + 32 * 0.05 + 0.05 and grid.data.shape[1] % 32 == 0
    made.update(np.zeros((2, 3)), [Reading([[9.0], [0.0]]), Reading([[-9.0], [0.0]])])
    grid = made.grid()
    assert grid.origin[0] <= -19.0 and abs(grid.origin[0] / 0.05 - round(grid.origin[0] / 0.05)) < 1e-6
    assert (grid.data == 100).sum() == 2


@pytest.mark.parametrize("high, columns", [(9.0, 480), (9.02, 480), (9.03, 512), (10.62, 512),
                                           (10.63, 544)])
def test_grown_grid_has_the_size_of_gmapping(high, columns):
    """Cells up to 10 m beyond, counted from the first one, rounded up to patches of 32."""
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, 0.25)
    made.update(np.zeros((1, 3)), [Reading([[high], [0.0]])])
    assert made.bounds == (192, columns) and columns == 32 * math.ceil(round((high + 15.0) / 0.05) / 32)


def test_first_cell_extends_half_a_cell_outwards():
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, 0.25)
    made.update(np.zeros((1, 3)), [Reading([[-5.02, 4.57], [0.0, 0.0]])])
    assert made.bounds == (192, 192) and (made.grid().data == 100).sum() == 2


@pytest.mark.parametrize("threshold, looks", [(0.29, 100), (0.1, 30), (0.7, 10), (0.57, 100)])
def test_hit_ratio_equal_to_threshold_is_free(threshold, looks):
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, threshold)
    hits = round(threshold * looks)
    readings = [Reading([[1.0], [0.0]])] * hits + [Reading([[1.5], [0.0]], [False])] * (looks - hits)
    made.update(np.zeros((looks, 3)), readings)
    assert hits / looks == threshold and (made.grid().data == 100).sum() == 0


def test_values_are_unknown_free_and_occupied_only():
    path, readings = scans(3)
    made = occupancy()
    made.update(path, readings)
    assert set(np.unique(made.grid().data)) == {-1, 0, 100}


def test_grid_does_not_exceed_its_limit():
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, 0.25, most_cells=100000)
    made.update(np.zeros((1, 3)), [Reading([[900.0, 1.0], [0.0, 0.0]])])
    assert made.beyond and (made.grid().data == 100).sum() == 1


def test_counts_are_removed_exactly_after_growth():
    """On cell borders, where another origin would round another way."""
    rng = np.random.default_rng(3)
    made = Occupancy((-0.7, -0.7, 0.7, 0.7), 0.05, 0.25)
    path = np.column_stack([0.025 * rng.integers(-40, 40, (30, 2)), np.zeros(30)])
    readings = [Reading(0.025 * rng.integers(-20 * k, 20 * k + 1, (2, 40))) for k in range(1, 31)]
    for count in range(1, 31):
        made.update(path[:count], readings[:count])
    assert made.bounds[0] > 500                  # it has grown several times
    moved = path + [0.5, 0.0, 0.0]
    for k in range(30):                         # one after the other, so that none starts from an empty map
        made.update(np.concatenate([moved[:k + 1], path[k + 1:]]), readings)
    grid, rebuilt = made.grid(), Occupancy((-0.7, -0.7, 0.7, 0.7), 0.05, 0.25)
    rebuilt.update(moved, readings)
    fresh = rebuilt.grid()
    x, y = np.rint((fresh.origin - grid.origin) / 0.05).astype(int)
    rows, columns = fresh.data.shape
    assert made.traced == 30 + 2 * 30 and min(x, y) >= 0
    assert np.array_equal(grid.data[y:y + rows, x:x + columns], fresh.data)
    assert (grid.data >= 0).sum() == (fresh.data >= 0).sum()


def test_counts_may_exceed_two_bytes():
    made = Occupancy((-1.0, -1.0, 2.0, 1.0), 0.1, 0.25)
    wall, beyond = (Reading(np.vstack([np.full(5000, x), np.zeros(5000)])) for x in (1.0, 1.5))
    readings = [wall] * 6 + [beyond] * 14
    made.update(np.zeros((14, 3)), readings[:14])
    assert made.compact()["_counts"][..., 1].max() == 70000
    for count in (17, 20):
        made.update(np.zeros((count, 3)), readings[:count])
        found = made.grid()
        column, row = np.rint((np.array([1.0, 0.0]) - found.origin) / 0.1).astype(int)
        assert found.data[row, column:column + 6].tolist() == [100, 0, 0, 0, 0, 100]
    made.update(np.vstack([np.ones((9, 3)), np.zeros((11, 3))]), readings)
    assert made.compact()["_counts"][..., 1].max() == 55000


def test_memory_depends_on_the_observed_area():
    made = Occupancy((-200.0, -200.0, 200.0, 200.0), 0.05, 0.25)
    made.update(np.array([[-190.0, -190.0, 0.0], [190.0, 190.0, 0.0]]), [Reading([[1.0], [0.0]])] * 2)
    assert made.bounds == (8000, 8000) and (made.grid().data == 100).sum() == 2
    assert made._counts.nbytes < 1e6


@pytest.mark.parametrize("far", [1e5, 1e12, 1e200])
def test_absurd_coordinates_cost_no_time_or_memory(far):
    made = Occupancy((-5.0, -5.0, 5.0, 5.0), 0.05, 0.25, most_cells=10**6)
    near = Reading([[1.0], [0.0]])
    made.update(np.array([[0.0, 0.0, 0.0], [far, far, 0.0], [0.5, 0.0, 0.0]]), [near, near, near])
    assert made.beyond and made.bounds == (192, 192) and (made.grid().data == 100).sum() == 2
    made.update(np.zeros((4, 3)), [near] * 3 + [Reading([[min(far, 1e5)], [0.0]])])
    assert made.bounds == (192, 192) and len(made._counts) < 200


def test_origin_is_the_centre_of_the_first_cell():
    grid = Occupancy((-1.0, -1.0, 5.4, 5.4), 0.1, 0.25)
    grid.update(np.zeros((1, 3)), [Reading([[2.04], [0.0]])])
    found = grid.grid()
    row, column = np.argwhere(found.data == 100)[0]
    assert found.origin.tolist() == [-1.0, -1.0]
    assert found.origin[0] + 0.1 * column == pytest.approx(2.0) and found.origin[1] + 0.1 * row == pytest.approx(0.0)

"""The exhaustive searches against searches that try everything."""
import math

import numpy as np
import pytest

from m2wr_gmapping import correlative_kernels as ck


def room(seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([np.stack([rng.uniform(-4, 4, 60), np.full(60, 3.0)]),
                             np.stack([np.full(60, -4.0), rng.uniform(-2, 3, 60)]), rng.uniform(-3, 3, (2, 20))],
                            axis=1)
    return points, np.array([-8.0, -8.0])


def drawn(points, corner):
    raster, coarse = np.zeros((160, 160), np.uint8), np.zeros((160, 160), np.uint8)
    ck.stamp_points(np.zeros(3), points, corner, 10.0, raster)
    ck.block_maximum(raster, coarse)
    return raster, coarse


def value(points, pose, corner, raster):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0
    for qx, qy in points.T:
        x = math.floor((pose[0] + c * qx - s * qy - corner[0]) * 10.0)
        y = math.floor((pose[1] + s * qx + c * qy - corner[1]) * 10.0)
        if 0 <= x < 160 and 0 <= y < 160:
            total += int(raster[y, x])
    return total / (255.0 * points.shape[1])


def test_block_maximum_equals_its_plain_twin():
    raster = np.random.default_rng(0).integers(0, 256, (23, 31)).astype(np.uint8)
    out = np.zeros_like(raster)
    ck.block_maximum(raster, out)
    for y in range(23):
        for x in range(31):
            assert out[y, x] == raster[y:y + ck.BLOCK, x:x + ck.BLOCK].max()


@pytest.mark.parametrize("seed", range(4))
def test_bounded_search_finds_what_trying_everything_finds(seed):
    points, corner = room(seed)
    raster, coarse = drawn(points, corner)
    rng = np.random.default_rng(seed)
    centre = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.1, 0.1)])
    turns, best = np.linspace(-0.2, 0.2, 9), np.zeros(5)
    ck.search(centre, points, turns, np.ones((5, 5), np.uint8), corner, 10.0, raster, coarse, 6, 0.3, 0.9, best)
    # whole-cell offsets of the cells that the points fall into without one
    top = max(value(points, centre + [0.1 * dx, 0.1 * dy, turn], corner, raster)
              for turn in turns for dx in range(-10, 10) for dy in range(-10, 10))
    assert best[3] == pytest.approx(top, abs=0.02)
    assert np.abs(best[:2]).max() < 0.15 and abs(best[2]) < 0.06


def test_a_second_place_that_fits_as_well_is_reported():
    points = np.stack([np.linspace(-1, 1, 40), np.full(40, 0.5)])
    corner = np.array([-8.0, -8.0])
    twice = np.concatenate([points, points + [[0.0], [1.5]]], axis=1)
    raster, coarse = drawn(twice, corner)
    best, all_of_it = np.zeros(5), np.ones((11, 11), np.uint8)
    ck.search(np.zeros(3), points, np.zeros(1), all_of_it, corner, 10.0, raster, coarse, 6, 0.3, 0.9, best)
    assert best[4] > 0.9 * best[3]
    raster, coarse = drawn(points, corner)
    ck.search(np.zeros(3), points, np.zeros(1), all_of_it, corner, 10.0, raster, coarse, 6, 0.3, 0.9, best)
    assert best[4] < 0.9 * best[3]


def test_only_allowed_blocks_are_searched():
    points, corner = room(3)
    raster, coarse = drawn(points, corner)
    allowed, best = np.zeros((9, 9), np.uint8), np.zeros(5)
    allowed[4, 7] = 1                   # three blocks to the right of the place that fits
    ck.search(np.zeros(3), points, np.zeros(1), allowed, corner, 10.0, raster, coarse, 6, 0.3, 0.9, best)
    assert best[0] == pytest.approx(1.2, abs=0.21) and abs(best[1]) < 0.21 and best[3] < 0.9
    allowed[4, 4] = 1
    ck.search(np.zeros(3), points, np.zeros(1), allowed, corner, 10.0, raster, coarse, 6, 0.3, 0.9, best)
    assert np.abs(best[:2]).max() < 0.15 and best[3] > 0.95


def test_window_search_finds_the_best_and_prefers_the_middle():
    points, corner = room(9)
    raster, _ = drawn(points, corner)
    steps = np.arange(-4, 5) * 0.1
    offsets = np.array([[x, y, 0.0] for x in steps for y in steps])
    turns, best = np.array([[t, 0.0] for t in (-0.1, 0.0, 0.1)]), np.zeros(4)
    ck.search_window(np.array([0.25, -0.2, 0.1]), offsets, turns, points, 1, corner, 10.0, raster, best)
    assert np.abs(best[:2]).max() < 0.15 and abs(best[2]) < 1e-9
    penalised = offsets.copy()
    penalised[:, 2] = 10.0 * np.hypot(offsets[:, 0], offsets[:, 1])
    ck.search_window(np.array([0.25, -0.2, 0.0]), penalised, turns, points, 1, corner, 10.0, raster, best)
    assert np.allclose(best[:2], [0.25, -0.2])

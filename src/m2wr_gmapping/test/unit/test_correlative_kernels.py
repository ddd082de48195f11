# SPDX-License-Identifier: BSD-3-Clause
"""The exhaustive searches against searches that try everything."""
import math

import numpy as np
import pytest

from m2wr_gmapping.frontend import correlative_kernels as ck
from m2wr_maps.se2 import between, compose


def room(seed):
    rng = np.random.default_rng(seed)
    points = np.concatenate([np.stack([rng.uniform(-4, 4, 60), np.full(60, 3.0)]),
                             np.stack([np.full(60, -4.0), rng.uniform(-2, 3, 60)]), rng.uniform(-3, 3, (2, 20))],
                            axis=1)
    return points, np.array([-8.0, -8.0])


def drawn(points, corner):
    raster, pairs, coarse = np.zeros((3, 160, 160), np.uint8)
    ck.stamp_points(np.zeros((1, 3)), np.array([points.shape[1]]), points, corner, 10.0, raster)
    ck.block_maximum(raster, ck.BLOCK // 2, pairs)
    ck.block_maximum(raster, ck.BLOCK, coarse)
    return raster, pairs, coarse


def value(points, pose, corner, raster):
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = 0
    for qx, qy in points.T:
        x = math.floor((pose[0] + c * qx - s * qy - corner[0]) * 10.0)
        y = math.floor((pose[1] + s * qx + c * qy - corner[1]) * 10.0)
        if 0 <= x < 160 and 0 <= y < 160:
            total += int(raster[y, x])
    return total / (255.0 * points.shape[1])


def test_raster_of_several_scans_has_the_greatest_value_of_each():
    points, corner = room(1)
    poses, ends = np.array([[0.3, -0.2, 0.4], [0.0, 0.5, -1.0], [1.0, 0.0, 3.0]]), np.array([50, 50, points.shape[1]])
    raster = np.zeros((160, 160), np.uint8)
    ck.stamp_points(poses, ends, points, corner, 10.0, raster)
    each = np.zeros((3, 160, 160), np.uint8)
    for pose, first, last, one in zip(poses, [0, *ends], ends, each):
        placed = compose(pose, np.vstack([points[:, first:last], np.zeros(last - first)]).T)[:, :2].T
        ck.stamp_points(np.zeros((1, 3)), np.array([last - first]), np.ascontiguousarray(placed), corner, 10.0, one)
    assert raster.any() and (raster == each.max(axis=0)).all()


@pytest.mark.parametrize("size", [ck.BLOCK // 2, ck.BLOCK])
def test_block_maximum_equals_reference(size):
    raster = np.random.default_rng(0).integers(0, 256, (23, 31)).astype(np.uint8)
    out = np.zeros_like(raster)
    ck.block_maximum(raster, size, out)
    for y in range(23):
        for x in range(31):
            assert out[y, x] == raster[y:y + size, x:x + size].max()


@pytest.mark.parametrize("seed", range(4))
def test_bounded_search_equals_exhaustive_search(seed):
    points, corner = room(seed)
    raster, pairs, coarse = drawn(points, corner)
    rng = np.random.default_rng(seed)
    centre = np.array([*rng.uniform(-0.5, 0.5, 2), rng.uniform(-0.1, 0.1)])
    turns, best = np.linspace(-0.2, 0.2, 9), np.zeros(7)
    ck.search(centre, points, turns, np.ones((5, 5), np.uint8), corner, 10.0, raster, pairs, coarse, 6, 0.3, 0.9, 0.0,
              best)
    # whole-cell offsets of the cells that the points fall into without one
    top = max(value(points, centre + [0.1 * dx, 0.1 * dy, turn], corner, raster)
              for turn in turns for dx in range(-10, 10) for dy in range(-10, 10))
    assert best[3] == pytest.approx(top, abs=0.02)
    assert np.abs(best[:2]).max() < 0.15 and abs(best[2]) < 0.06


def test_rival_pose_is_reported():
    points = np.stack([np.linspace(-1, 1, 40), np.full(40, 0.5)])
    corner = np.array([-8.0, -8.0])
    twice = np.concatenate([points, points + [[0.0], [1.5]]], axis=1)
    raster, pairs, coarse = drawn(twice, corner)
    best, all_of_it = np.zeros(7), np.ones((11, 11), np.uint8)
    ck.search(np.zeros(3), points, np.zeros(1), all_of_it, corner, 10.0, raster, pairs, coarse, 6, 0.3, 0.9, 0.0, best)
    assert best[4] > 0.9 * best[3] and abs(best[5]) < 0.15
    assert abs(best[6] - best[1]) == pytest.approx(1.5, abs=0.15)
    raster, pairs, coarse = drawn(points, corner)
    ck.search(np.zeros(3), points, np.zeros(1), all_of_it, corner, 10.0, raster, pairs, coarse, 6, 0.3, 0.9, 0.0, best)
    assert best[4] < 0.9 * best[3]


@pytest.mark.parametrize("seed", range(4))
def test_places_below_the_least_score_are_left_out(seed):
    points, corner = room(seed)
    rasters, turns, best = drawn(points, corner), np.linspace(-0.2, 0.2, 9), np.zeros((3, 7))
    for least, out in ((0.0, best[0]), (0.9, best[1]), (1.01, best[2])):
        ck.search(np.zeros(3), points, turns, np.ones((5, 5), np.uint8), corner, 10.0, *rasters, 6, 0.3, 0.9, least,
                  out)
    assert best[0, 3] > 0.9 and (best[0] == best[1]).all() and best[2, 3] == best[2, 4] == 0.0


@pytest.mark.parametrize("seed", range(8))
def test_rival_is_apart_from_the_best_place(seed):
    rng = np.random.default_rng(seed)
    points, corner = rng.uniform(-3.0, 3.0, (2, 40)), np.array([-8.0, -8.0])
    copies = [points + rng.uniform(-1.5, 1.5, (2, 1)) for _ in range(3)]
    rasters, best = drawn(np.concatenate(copies, axis=1), corner), np.zeros(7)
    ck.search(np.zeros(3), points, np.zeros(1), np.ones((11, 11), np.uint8), corner, 10.0, *rasters, 6, 0.3, 0.9, 0.0,
              best)
    scores = {(dx, dy): value(points, [0.1 * dx, 0.1 * dy, 0.0], corner, rasters[0])
              for dx in range(-22, 22) for dy in range(-22, 22)}
    at = tuple(np.round(10.0 * best[:2]).astype(int))
    assert best[3] == pytest.approx(max(scores.values())) == pytest.approx(scores[at])
    apart = [score for (dx, dy), score in scores.items() if max(abs(dx - at[0]), abs(dy - at[1])) > 6]
    assert (best[4] > 0.0) == (max(apart) >= 0.9 * best[3])
    if best[4]:
        other = tuple(np.round(10.0 * best[5:]).astype(int))
        assert scores[other] == pytest.approx(best[4]) and max(abs(other[0] - at[0]), abs(other[1] - at[1])) > 6


def test_search_is_limited_to_allowed_blocks():
    points, corner = room(3)
    raster, pairs, coarse = drawn(points, corner)
    allowed, best = np.zeros((9, 9), np.uint8), np.zeros(7)
    allowed[4, 7] = 1                   # three blocks to the right of the place that fits
    ck.search(np.zeros(3), points, np.zeros(1), allowed, corner, 10.0, raster, pairs, coarse, 6, 0.3, 0.9, 0.0, best)
    assert best[0] == pytest.approx(1.2, abs=0.21) and abs(best[1]) < 0.21 and best[3] < 0.9
    allowed[4, 4] = 1
    ck.search(np.zeros(3), points, np.zeros(1), allowed, corner, 10.0, raster, pairs, coarse, 6, 0.3, 0.9, 0.0, best)
    assert np.abs(best[:2]).max() < 0.15 and best[3] > 0.95


def test_unknown_cells_do_not_change_the_rating():
    points, corner = room(5)
    raster, *_ = drawn(points[:, points[0] < 1.0], corner)
    seen = np.zeros_like(raster)
    ck.mark_seen(np.zeros(3), points[:, points[0] < 1.0], corner, 10.0, seen)
    centre, turns = np.array([0.1, -0.2, 0.03]), np.array([-0.05, 0.0, 0.05])
    allowed = np.ones((9, 9), np.uint8)
    allowed[0] = 0
    rating, turn = np.empty((2, 9, 9))
    ck.survey(centre, points, turns, allowed, corner, 10.0, raster, seen, 2, 0.0, rating, turn)
    for row in range(9):
        for column in range(9):
            found = []
            for angle in turns:
                total = 0.0
                for q in points.T:
                    c, s = math.cos(centre[2] + angle), math.sin(centre[2] + angle)
                    x = math.floor((centre[0] + c * q[0] - s * q[1] - corner[0]) * 10.0) + column - 4
                    y = math.floor((centre[1] + s * q[0] + c * q[1] - corner[1]) * 10.0) + row - 4
                    if raster[y, x] or seen[y, x]:
                        total += 3.0 * raster[y, x] / 255.0 - 2.0
                found.append(total / points.shape[1])
            best = max(0.0, *found) if row else 0.0
            assert rating[row, column] == pytest.approx(best)
            assert not best or int(turn[row, column]) == int(np.argmax(found))
    assert rating.max() > 0.3           # otherwise this shows nothing


def test_rays_mark_traversed_cells():
    seen = np.zeros((40, 40), np.uint8)
    ck.mark_seen(np.array([1.05, 1.05, 0.0]), np.array([[2.0, 0.0], [0.0, 9.0]]), np.zeros(2), 10.0, seen)
    expected = np.zeros_like(seen)
    expected[10, 10:31] = expected[10:, 10] = 1
    assert np.array_equal(seen, expected)


@pytest.mark.parametrize("seed", range(3))
def test_rays_are_clipped_to_the_raster(seed):
    rng = np.random.default_rng(seed)
    small, large = np.zeros((20, 30), np.uint8), np.zeros((400, 400), np.uint8)
    rays = rng.uniform(-15.0, 15.0, (2, 50))
    pose = np.array([*rng.uniform(-2.0, 5.0, 2), rng.uniform(-3.0, 3.0)])
    ck.mark_seen(pose, rays, np.zeros(2), 10.0, small)
    ck.mark_seen(pose, rays, np.array([-20.0, -20.0]), 10.0, large)
    assert small.any() and (small != large[200:220, 200:230]).mean() < 0.01     # rounding at the edges of cells


def test_window_search_prefers_the_centre_on_ties():
    points, corner = room(9)
    raster, *_ = drawn(points, corner)
    steps = np.arange(-4, 5) * 0.1
    offsets = np.array([[x, y, 0.0] for x in steps for y in steps])
    turns, best = np.array([[t, 0.0] for t in (-0.1, 0.0, 0.1)]), np.zeros(4)
    ck.search_window(np.array([0.25, -0.2, 0.1]), offsets, turns, points, 1, corner, 10.0, raster, best)
    assert np.abs(best[:2]).max() < 0.15 and abs(best[2]) < 1e-9
    penalised = offsets.copy()
    penalised[:, 2] = 10.0 * np.hypot(offsets[:, 0], offsets[:, 1])
    ck.search_window(np.array([0.25, -0.2, 0.0]), penalised, turns, points, 1, corner, 10.0, raster, best)
    assert np.allclose(best[:2], [0.25, -0.2])


@pytest.mark.parametrize("count", [0, 1, 300])
def test_add_points_equals_reference(count):
    rng = np.random.default_rng(count)
    eye, pose, points = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3), rng.uniform(-6, 6, (2, count))
    out = np.zeros((2, count + 5))
    end = ck.add_points(eye, pose, points, 5.0, out, 2)
    seen = [between(eye, compose(pose, [x, y, 0.0]))[:2] for x, y in points.T]
    wanted = [point for point in seen if np.hypot(*point) < 5.0]
    assert end == 2 + len(wanted) and not out[:, :2].any() and not out[:, end:].any()
    assert np.allclose(out[:, 2:end].T, np.array(wanted).reshape(-1, 2))
    assert count < 300 or 0 < len(wanted) < count

# SPDX-License-Identifier: BSD-3-Clause
"""The matcher's kernels against slow plain twins."""
import math

import numpy as np
import pytest

from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.frontend import hill_climb_kernels as hk
from m2wr_gmapping.frontend import match_kernels as mk

SETTINGS = np.array([0.05, 0.01, 8, 0.05, 0.05, 0.075, 0.0])


def cloud(seed, count=150):
    """End points along two walls, and a map of the same walls."""
    rng = np.random.default_rng(seed)
    points = np.concatenate([np.stack([rng.uniform(-3, 3, count), np.full(count, 2.0)]),
                             np.stack([np.full(count, 3.0), rng.uniform(-3, 2, count)])], axis=1)
    points += rng.normal(0.0, 0.01, points.shape)
    maps = TileMaps(1, 0.05, NEVER)
    maps.cover(points.min(axis=1), points.max(axis=1))
    maps.register(np.zeros((1, 3)), points)
    normals = np.concatenate([np.tile([[0.0], [1.0]], count), np.tile([[1.0], [0.0]], count)], axis=1)
    beams = np.empty((mk.BEAM_ROWS, points.shape[1]))
    beams[:2], beams[2:4] = points, normals
    beams[mk.ARM_N] = normals[1] * points[0] - normals[0] * points[1]
    beams[mk.ARM_T] = normals[0] * points[0] + normals[1] * points[1]
    beams[mk.SLIDE] = 0.02
    return maps, beams


def matched(maps, beams, start, prediction, prior, settings=SETTINGS):
    """Result row of a match in the only map."""
    rows = np.zeros((1, mk.RESULT_SIZE))
    mk.match_particles(np.array([start], float), np.array([prediction], float), 0, 1, beams, maps.table, *maps.layout,
                       np.full(3, prior), settings, -math.inf, rows)
    return rows[0]


def slow_nearest(maps, x, y, half=1):
    """Squared distance [m^2] from a point to the nearest mean in its neighbourhood, cell by cell; None without one."""
    fx, fy = (np.array([x, y]) - maps.frame[:2]) * maps.frame[2]
    best = None
    for jy in range(math.floor(fy) - half, math.floor(fy) + half + 1):
        for jx in range(math.floor(fx) - half, math.floor(fx) + half + 1):
            if not (0 <= jx < maps.table.shape[2] * 128 and 0 <= jy < maps.table.shape[1] * 128):
                continue
            block = maps.table[0, jy // 128, jx // 128]
            tile = -1 if block < 0 else maps.blocks[block, jy // 16 % 8, jx // 16 % 8]
            cell = (jy % 16) * 16 + jx % 16
            if tile < 0 or not maps.hits[tile, cell]:
                continue
            mx, my = np.array([jx, jy]) + maps.mean[tile, cell] / 255.0
            d2 = ((fx - mx)**2 + (fy - my)**2) / maps.frame[2]**2
            best = d2 if best is None else min(best, d2)
    return best


def slow_rating(maps, beams, pose, half=1):
    score = likelihood = 0.0
    found = 0
    for qx, qy in beams[:2].T:
        c, s = math.cos(pose[2]), math.sin(pose[2])
        d2 = slow_nearest(maps, pose[0] + c * qx - s * qy, pose[1] + s * qx + c * qy, half)
        if d2 is None:
            likelihood -= 0.5 / 0.075
        else:
            found += 1
            score += math.exp(-d2 / 0.05)
            likelihood -= d2 / 0.075
    return score, likelihood, found


@pytest.mark.parametrize("pose", [(0, 0, 0), (0.03, -0.02, 0.01), (0.4, 0.3, -0.2), (90.0, 0, 0), (-3.2, 4.1, 3.0)])
def test_rating_equals_reference(pose):
    maps, beams = cloud(1)
    row = np.zeros(mk.RESULT_SIZE)
    predictions = np.array([pose], float)
    mk.match_particles(np.zeros((1, 3)), predictions, 0, 1, beams, maps.table, *maps.layout,
                       np.ones(3), SETTINGS, np.inf, row[None])         # a score out of reach: the prediction stands
    assert (row[:3] == pose).all() and not row[mk.INFORMATION:].any()
    assert np.allclose(row[3:6], slow_rating(maps, beams, pose), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("half", [0, 1, 2])
def test_hill_climb_score_equals_reference(half):
    maps, beams = cloud(2)
    settings = np.array([0.05, 0.05, 0, 0.05, 0.075, half, 1e9])        # a score out of reach: the pose stays
    results = np.zeros((1, mk.RESULT_SIZE))
    pose = np.array([[0.06, -0.03, 0.02]])
    hk.climb_poses(pose, 0, 1, beams, maps.table, *maps.layout, settings, results)
    assert np.allclose(results[0, :3], pose) and np.allclose(results[0, 3:6], slow_rating(maps, beams, pose[0], half))


@pytest.mark.parametrize("start", [(0.03, 0.02, 0.01), (-0.04, 0.03, -0.02), (0.0, 0.0, 0.0)])
def test_both_matchers_recover_the_pose(start):
    maps, beams = cloud(3)
    starts, results = np.array([start]), np.zeros((1, mk.RESULT_SIZE))
    row = matched(maps, beams, start, start, 1e-6)
    assert np.abs(row[:2]).max() < 0.005 and abs(row[2]) < 0.002
    hk.climb_poses(starts, 0, 1, beams, maps.table, *maps.layout,
                   np.array([0.05, 0.05, 5, 0.05, 0.075, 1, 0.0]), results)
    assert np.abs(results[0, :2]).max() < 0.01 and abs(results[0, 2]) < 0.005


def test_slow_steps_are_extrapolated():
    """Each step is a fifth of the way that is left: the third pose is the end of that way."""
    end, pose, before = np.array([0.02, -0.01, 0.005]), np.zeros(3), np.zeros(6)
    for number in range(3):
        mk._advance(0.2 * (end - pose), 4.0, number == 0, pose, before)
    assert pose == pytest.approx(end, abs=1e-9)


def test_an_extrapolation_is_limited_to_a_cell():
    pose, before = np.zeros(3), np.zeros(6)
    mk._advance(np.array([0.02, 0.0, 0.01]), 4.0, True, pose, before)
    mk._advance(np.array([0.02, 0.0, 0.00999]), 4.0, False, pose, before)
    plain = np.array([0.04, 0.0, 0.01999])
    assert math.hypot(pose[0] - plain[0], 2.0 * (pose[2] - plain[2])) == pytest.approx(0.05)
    assert before[3:] == pytest.approx(plain)


@pytest.mark.parametrize("seed", range(6))
def test_a_match_among_furniture_converges(seed):
    """450 end points on 150 legs of chairs, from 2.3 degrees and 3 cm beside the pose."""
    rng = np.random.default_rng(seed)
    points = np.repeat(rng.uniform(-4.0, 4.0, (2, 150)), 3, axis=1) + rng.normal(0.0, 0.06, (2, 450))
    maps = TileMaps(1, 0.05, NEVER)
    maps.cover((-5.0, -5.0), (5.0, 5.0))
    maps.register(np.zeros((1, 3)), points)
    angles = rng.uniform(-math.pi, math.pi, 450)
    nx, ny = np.cos(angles), np.sin(angles)
    beams = np.vstack([points, nx, ny, ny * points[0] - nx * points[1], nx * points[0] + ny * points[1],
                       np.full(450, 0.98)])
    settings = SETTINGS.copy()
    settings[mk.ROUNDS] = 8
    found = matched(maps, beams, (0.02, -0.02, 0.04), (0.0, 0.0, 0.04), 1.0, settings)
    assert found[:3] == pytest.approx(np.zeros(3), abs=5e-4)


def test_information_is_large_across_walls_and_small_along_one():
    maps, beams = cloud(4)
    one_wall = np.ascontiguousarray(beams[:, :150])         # along x
    row = matched(maps, one_wall, np.zeros(3), np.zeros(3), 1e-6)
    xx, yy = row[mk.INFORMATION], row[mk.INFORMATION + 3]
    assert yy > 30.0 * xx > 0.0


def slow_information(maps, beams, pose, free):
    """Upper triangle of the sum of J^T W J over the beams with a partner, one after the other."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    total = np.zeros((3, 3))
    for qx, qy, nx, ny, arm_n, arm_t, slide in beams.T:
        d2 = slow_nearest(maps, pose[0] + c * qx - s * qy, pose[1] + s * qx + c * qy)
        if d2 is not None:
            u = d2 / SETTINGS[mk.NARROW]
            w = 1.0 / (1.0 + u * (1.0 + u * (0.5 + u / 6.0)))
            across, along = np.array([nx, ny, arm_n]), np.array([-ny, nx, arm_t])
            total += w * (np.outer(across, across) + max(slide - free, 0.0) * np.outer(along, along))
    return total[np.triu_indices(3)] / SETTINGS[mk.SPREAD]**2


@pytest.mark.parametrize("count, free", [(3, 0.0), (64, 0.01), (65, 0.0), (200, 0.02)])     # less and more than a block
def test_information_equals_reference(count, free):
    maps, beams = cloud(6, count)
    settings, start = SETTINGS.copy(), [0.01, -0.02, 0.01]
    settings[mk.FREE] = free
    row = matched(maps, beams, start, start, 100.0, settings)
    wanted = slow_information(maps, beams, row[:3], free)
    assert np.allclose(row[mk.INFORMATION:], wanted, rtol=1e-2, atol=1e-2 * np.abs(wanted).max())
    assert row[3:6] == pytest.approx(slow_rating(maps, beams, row[:3]), rel=1e-2)


def test_match_particles_equals_single_matches():
    maps, beams = cloud(7)
    shifted = TileMaps(3, 0.05, NEVER)
    shifted.cover((-4.0, -4.0), (4.0, 4.0))
    for particle in range(3):
        shifted.register(np.array([[0.02 * particle, -0.01, 0.0]]), np.ascontiguousarray(beams[:2]), particle)
    rng = np.random.default_rng(7)
    starts, predictions = rng.normal(0.0, 0.02, (3, 3)), rng.normal(0.0, 0.02, (3, 3))
    results, row = np.full((3, mk.RESULT_SIZE), np.nan), np.zeros((1, mk.RESULT_SIZE))
    mk.match_particles(starts, predictions, 1, 3, beams, shifted.table, *shifted.layout,
                       np.full(3, 50.0), SETTINGS, 0.0, results)
    assert np.isnan(results[0]).all()
    for particle in (1, 2):
        mk.match_particles(starts[particle:], predictions[particle:], 0, 1, beams, shifted.table[particle:],
                           *shifted.layout, np.full(3, 50.0), SETTINGS, -math.inf, row)
        assert (results[particle] == row[0]).all()
    assert abs(results[2, 0] - results[1, 0]) > 0.01


def test_prior_constrains_unobserved_directions():
    maps, beams = cloud(5)
    empty = np.empty((mk.BEAM_ROWS, 0))
    start, held = [0.2, -0.1, 0.1], [0.0, 0.0, 3.1]
    row = matched(maps, empty, start, start, 1.0)
    assert np.allclose(row[:3], start) and row[mk.FOUND] == 0
    row = matched(maps, empty, held, [0.0, 0.0, 3.1 + 2 * math.pi], 1.0)
    assert np.allclose(row[:3], held)                       # a turn more is the same heading

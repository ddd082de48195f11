"""Loops on made-up logs that nothing was chosen by: a wide one is closed, a place that only looks the same is not."""
import math

import numpy as np
import pytest

from m2wr_gmapping import graph_kernels, place_search
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.mapper import Mapper
from m2wr_gmapping.pose_graph import optimise
from m2wr_gmapping.scan import LaserModel
from m2wr_gmapping.se2 import between, compose

STEP = 0.25
LASER = LaserModel.from_message(-math.pi / 2, math.pi / 2, math.pi / 120, 121, 0.05, 10.0)


def box(x, y, width, depth):
    a, b, c, d = x - width / 2, y - depth / 2, x + width / 2, y + depth / 2
    return [(a, b, c, b), (c, b, c, d), (c, d, a, d), (a, d, a, b)]


def ring(rng, half=18.0, width=2.6):
    """Walls (S, 4) of a square ring of corridors with cupboards here and there, and the way round it and a bit more."""
    walls = box(0.0, 0.0, 2 * half + width, 2 * half + width) + box(0.0, 0.0, 2 * half - width, 2 * half - width)
    for side in range(4):
        at = -half + 2.0
        while at < half - 2.0:
            wide, deep = rng.uniform(0.4, 1.2), rng.uniform(0.2, 0.5)
            away = half + rng.choice((-1.0, 1.0)) * (width - deep) / 2
            walls += box(at, away * (-1) ** (side // 2), wide, deep) if side % 2 else box(
                away * (-1) ** (side // 2), at, deep, wide)
            at += rng.uniform(3.0, 8.0)
    corners = [(-half, -half), (half, -half), (half, half), (-half, half)]
    return np.array(walls), corners + corners[:2] + [(half, 0.0)]


def aisles(length=16.0, aisle=2.4, shelf=0.8, rows=4):
    """Walls of a hall with equal shelves, and the way up and down its aisles, each of them once."""
    pitch, walls = aisle + shelf, []
    for row in range(rows - 1):
        y = aisle + row * pitch + shelf / 2
        walls += box(length / 2, y, length, shelf)
        for x in np.arange(0.0, length + 0.1, 4.0):
            walls += box(x, y + shelf / 2 + 0.1, 0.1, 0.1) + box(x, y - shelf / 2 - 0.1, 0.1, 0.1)
    walls += box(length / 2, (rows * pitch - shelf) / 2, length + 6.0, rows * pitch - shelf)
    way, left = [], True
    for row in range(rows):
        y = aisle / 2 + row * pitch
        way += [(-1.5, y), (length + 1.5, y)][::1 if left else -1]
        left = not left
    return np.array(walls), way


def drive(way):
    """True poses (K, 3) along a way, turning on the spot at its corners."""
    poses = []
    for (ax, ay), (bx, by) in zip(way[:-1], way[1:]):
        heading, length = math.atan2(by - ay, bx - ax), math.hypot(bx - ax, by - ay)
        if poses:
            turn = (heading - poses[-1][2] + math.pi) % (2 * math.pi) - math.pi
            poses += [(ax, ay, poses[-1][2] + part * turn) for part in np.linspace(0.25, 1.0, 4)]
        poses += [(ax + part * (bx - ax), ay + part * (by - ay), heading)
                  for part in np.arange(STEP, length, STEP) / length]
    return np.array(poses)


def ranges(walls, pose):
    dx, dy = np.cos(pose[2] + LASER.angles)[:, None], np.sin(pose[2] + LASER.angles)[:, None]
    x0, y0, x1, y1 = (walls - np.tile(pose[:2], 2)).T
    ex, ey = x1 - x0, y1 - y0
    with np.errstate(divide="ignore", invalid="ignore"):
        cross = dx * ey - dy * ex
        along, part = (x0 * ey - y0 * ex) / cross, (x0 * dy - y0 * dx) / cross
    return np.where((along > 0) & (part >= 0) & (part <= 1), along, np.inf).min(axis=1)


def odometry(truth, rng, way, turn):
    """Odometry whose scale is wrong by ``way`` and whose heading wanders, by ``turn`` a square root of a metre."""
    poses, rate = [np.zeros(3)], 0.0
    for a, b in zip(truth[:-1], truth[1:]):
        step = between(a, b)
        rate = 0.98 * rate + rng.normal(0.0, 0.2 * turn)
        size = math.hypot(step[0], step[1])
        poses.append(compose(poses[-1], step * [1.0 + way, 1.0, 1.0] + [0.0, 0.0, rate * size]))
    return np.array(poses)


def mapped(world, seed, way=0.02, turn=0.1, **parameters):
    """A mapper after a drive, and the truth at its nodes."""
    rng = np.random.default_rng(seed)
    walls, corners = world(rng) if world is ring else world()
    truth = drive(corners)
    odom = odometry(truth, rng, way, turn)
    values = dict(particles=4, linearUpdate=0.5, angularUpdate=0.4, maxUrange=6.0, maxRange=8.0, srr=0.01, srt=0.02,
                  str=0.01, stt=0.02, xmin=-1.0, ymin=-1.0, xmax=1.0, ymax=1.0)
    mapper = Mapper(GmappingConfig.from_mapping(dict(values, **parameters)), LASER)
    for k, (pose, at) in enumerate(zip(truth, odom)):
        mapper.process(mapper.reading(ranges(walls, pose) + rng.normal(0.0, 0.015, len(LASER.angles))), at, 0.1 * k)
    mapper.finish()
    nodes = np.round(np.array(mapper.stamps) / 0.1).astype(int)
    return mapper, truth[nodes]


def apart(mapper, truth):
    """Errors (P,) [m] of relative poses of places that were met again."""
    path = mapper.filter.tree.path(mapper.filter.best)
    old, new = np.argwhere(np.triu(np.hypot(*(truth[:, None] - truth)[..., :2].transpose(2, 0, 1)) < 1.0, 60)).T
    error = between(between(truth[old], truth[new]), between(path[old], path[new]))
    return np.hypot(error[:, 0], error[:, 1])


def false_links(mapper, truth):
    found = [(old, new, between(between(truth[old], truth[new]), measured))
             for old, new, measured, _ in mapper._loops._links]
    return [(old, new) for old, new, error in found if math.hypot(error[0], error[1]) > 1.0]


def test_a_wide_loop_is_closed():
    open_mapper, truth = mapped(ring, 11, loop_closing=False)
    assert apart(open_mapper, truth).max() > 1.0          # otherwise this shows nothing
    mapper, truth = mapped(ring, 11)
    assert apart(mapper, truth).max() < 0.4 and mapper.info()["links"] > 5
    assert not false_links(mapper, truth)


def test_an_aisle_that_looks_like_another_is_not_taken_for_it():
    mapper, truth = mapped(aisles, 12)
    assert mapper.info()["wide_searches"] + mapper.info()["searches"] > 5 and not false_links(mapper, truth)
    path = mapper.filter.tree.path(mapper.filter.best)
    error = between(between(truth[0], truth[-1]), between(path[0], path[-1]))
    assert math.hypot(error[0], error[1]) < 1.2


@pytest.mark.parametrize("seed", range(5))
def test_drift_is_that_of_the_best_way_through_the_graph(seed):
    rng = np.random.default_rng(seed)
    path, variances = np.cumsum(rng.normal(0.0, 1.0, (30, 3)), axis=0), rng.uniform(0.0, 0.1, 30)
    links = rng.integers(0, 30, (seed, 2))
    edges = {}
    for k in range(1, 30):
        size = math.hypot(*(path[k] - path[k - 1])[:2])
        lever = size * math.hypot(*(path[-1] - 0.5 * (path[k] + path[k - 1]))[:2])
        edges[k - 1, k] = edges[k, k - 1] = np.array([lever, variances[k], size])
    for a, b in links:
        edges[a, b] = edges[b, a] = np.zeros(3)
    best = {29: np.zeros(3)}
    for _ in range(60):                 # Bellman and Ford
        for (a, b), cost in edges.items():
            if a in best and (b not in best or best[a][0] + cost[0] < best[b][0] - 1e-12):
                best[b] = best[a] + cost
    out = np.empty((30, 3))
    graph_kernels.drift(path, variances, links.astype(np.int64).reshape(-1, 2), out)
    assert np.allclose(out, [best[k] for k in range(30)])


def test_a_loop_that_is_far_off_is_closed_with_a_kernel_that_narrows():
    truth = [np.zeros(3)]
    for _ in range(199):
        truth.append(compose(truth[-1], [0.5, 0.0, 2 * math.pi / 200]))
    truth = np.array(truth)
    pairs = np.array([(k, k + 1) for k in range(199)] + [(0, 199)])
    measured = between(truth[pairs[:, 0]], truth[pairs[:, 1]])
    measured[:-1, 2] += 0.003
    start = [np.zeros(3)]
    for step in measured[:-1]:
        start.append(compose(start[-1], step))
    assert np.hypot(*(np.array(start) - truth)[-1, :2]) > 4.0
    information = np.tile(np.diag(1.0 / np.square([0.01, 0.01, 0.004])), (200, 1, 1))
    robust = np.arange(200) == 199
    found, weights = optimise(start, pairs, measured, information, robust, 12.0, True)
    assert weights[-1] > 0.5 and np.hypot(*(found - truth)[:, :2].T).max() < 0.2


def test_what_cannot_be_seen_through_speaks_against_a_place():
    near, far = (np.array([(x, -5.0, x, 5.0)]) for x in (2.0, 5.0))
    readings = [LASER.reading(np.minimum(ranges(wall, np.zeros(3)), 9.0)) for wall in (near, far, near)]
    path, along = np.zeros((3, 3)), np.array([0.0, 20.0, 40.0])
    scene = place_search.Scene(path, along, readings, np.array([0, 1]), np.zeros(3), np.zeros(3))
    row = np.zeros(13)
    assert place_search.looked_through(scene, row, np.array([0])) == 0.0
    assert place_search.looked_through(scene, row, np.array([1])) > 0.4

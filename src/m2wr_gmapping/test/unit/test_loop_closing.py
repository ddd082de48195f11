# SPDX-License-Identifier: BSD-3-Clause
"""Loops on made-up logs that nothing was chosen by: a wide one is closed, a place that only looks the same is not."""
import math

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.backend import drift_kernels, loop_closing, place_check, place_match, place_query, place_search
from m2wr_gmapping.backend.loop_extension import LoopExtension
from m2wr_gmapping.backend.loop_graph import LoopGraph
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.backend.step_history import StepHistory
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import between, compose
from m2wr_node.thread_team import ThreadTeam
from wall_ranges import ranges

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


def odometry(truth, rng, way, turn):
    """Odometry whose scale is wrong by ``way`` and whose heading wanders, by ``turn`` a square root of a metre."""
    poses, rate = [np.zeros(3)], 0.0
    for a, b in zip(truth[:-1], truth[1:]):
        step = between(a, b)
        rate = 0.98 * rate + rng.normal(0.0, 0.2 * turn)
        size = math.hypot(step[0], step[1])
        poses.append(compose(poses[-1], step * [1.0 + way, 1.0, 1.0] + [0.0, 0.0, rate * size]))
    return np.array(poses)


def mapped(world, seed, way=0.02, turn=0.1, finish=True, **parameters):
    """A mapper after a drive, and the truth at its nodes."""
    rng = np.random.default_rng(seed)
    walls, corners = world(rng) if world is ring else world()
    truth = drive(corners)
    odom = odometry(truth, rng, way, turn)
    values = dict(particles=4, linearUpdate=0.5, angularUpdate=0.4, maxUrange=6.0, maxRange=8.0, srr=0.01, srt=0.02,
                  str=0.01, stt=0.02, xmin=-1.0, ymin=-1.0, xmax=1.0, ymax=1.0)
    mapper = Mapper(GmappingConfig.from_mapping(dict(values, **parameters)), LASER)
    for k, (pose, at) in enumerate(zip(truth, odom)):
        seen = ranges(walls, pose, LASER.angles) + rng.normal(0.0, 0.015, len(LASER.angles))
        mapper.process(mapper.reading(seen), at, 0.1 * k)
    if finish:
        mapper.finish()
    nodes = np.round(np.array(mapper.stamps) / 0.1).astype(int)
    return mapper, truth[nodes]


def apart(mapper, truth):
    """Errors (P,) [m] of relative poses of loop closures."""
    path = mapper.filter.tree.path(mapper.filter.best)
    old, new = np.argwhere(np.triu(np.hypot(*(truth[:, None] - truth)[..., :2].transpose(2, 0, 1)) < 1.0, 60)).T
    error = between(between(truth[old], truth[new]), between(path[old], path[new]))
    return np.hypot(error[:, 0], error[:, 1])


def false_links(mapper, truth):
    found = [(old, new, between(between(truth[old], truth[new]), measured))
             for old, new, measured, _ in mapper._loops.graph.links]
    return [(old, new) for old, new, error in found if math.hypot(error[0], error[1]) > 1.0]


@pytest.fixture(scope="module")
def open_ring():
    """A mapper that has closed no loop, after a drive round a ring and a bit more, and the truth at its nodes."""
    mapper, truth = mapped(ring, 11, turn=0.4, loop_closing=False)
    assert apart(mapper, truth).max() > 0.2          # otherwise this shows nothing
    return mapper, truth


def test_wide_loop_is_closed_over_its_full_length(open_ring):
    mapper, truth = mapped(ring, 11, turn=0.4, finish=False)
    assert apart(mapper, truth).max() < 0.1 and not false_links(mapper, truth)
    along = distances_along(truth)
    again = along[[new for new in range(len(truth)) if along[new] > 60.0
                   and np.hypot(*(truth[along < 60.0] - truth[new])[:, :2].T).min() < 0.5]]
    linked = along[[link[1] for link in mapper._loops.graph.links]]
    assert linked.min() < again.min() + 5.0 and len(linked) > 15


def graph_of(mapper):
    """A graph without links of a mapper's path, the path, and its readings."""
    path = mapper.filter.tree.path(mapper.filter.best)
    graph = LoopGraph(FastMatcher(mapper.config, ThreadTeam(1)), mapper.config["delta"], history_of(len(path)))
    return graph, path, mapper.readings


def history_of(nodes):
    """Steps to that many nodes, each observed by its scan."""
    history, row = StepHistory(), np.zeros(mk.RESULT_SIZE)
    row[mk.INFORMATION:] = 2e4, 0.0, 0.0, 2e4, 0.0, 2e4
    for _ in range(nodes - 1):
        history.next_record()
        history.set_information(row, np.full(3, 0.02**2))
    return history


@pytest.mark.parametrize("nodes_before_end", [20, 100])
def test_loop_closure_is_extended_along_the_loop(open_ring, nodes_before_end):
    mapper, truth = open_ring
    graph, path, readings = graph_of(mapper)
    new = len(path) - nodes_before_end
    old = int(np.argmin(np.hypot(*(truth[:150] - truth[new])[:, :2].T)))
    link = (old, new, between(truth[old], truth[new]), np.diag(1.0 / np.square([0.02, 0.02, 0.008])))
    graph.links.append(link)
    along, drifted = distances_along(truth), truth.copy()
    drifted[200:, :2] += 0.04 * np.abs(along[new] - along[200:, None])      # the more, the farther from the link
    growth = LoopExtension(graph)
    growth.start_at([link])
    growth.advance(Route(drifted, along, readings), 1000)
    assert not growth.frontiers and growth.has_moved
    again = along[[new for new in range(200, len(truth))
                   if np.hypot(*(truth[:150] - truth[new])[:, :2].T).min() < 0.5]]
    linked = np.sort(along[[new for _, new, _, _ in graph.links]])
    reach = 2 * tuning.LOOPS.spacing
    assert linked[0] < again[0] + reach and linked[-1] > again[-1] - reach      # both ways from the first one
    gaps = np.diff(linked)
    assert tuning.LOOPS.every <= gaps.min() and gaps.max() <= 2 * tuning.LOOPS.spacing    # none twice, no two left out
    for first, second, measured, _ in graph.links[1:]:
        error = between(between(truth[first], truth[second]), measured)
        assert math.hypot(error[0], error[1]) < 0.2 and abs(error[2]) < 0.02


def test_wrong_loop_closure_is_not_extended(open_ring):
    mapper, truth = open_ring
    graph, path, readings = graph_of(mapper)
    link = (10, len(path) - 20, np.array([3.0, 0.0, 1.0]), np.diag(1.0 / np.square([0.02, 0.02, 0.008])))
    graph.links.append(link)
    growth = LoopExtension(graph)
    growth.start_at([link])
    growth.advance(Route(path, distances_along(path), readings), 1000)
    assert not growth.frontiers
    for first, second, measured, _ in graph.links[1:]:      # none, or right ones that the search found by itself
        error = between(between(truth[first], truth[second]), measured)
        assert math.hypot(error[0], error[1]) < 0.3 and abs(error[2]) < 0.03


def test_old_places_are_searched_again(open_ring):
    mapper, truth = open_ring
    graph, path, readings = graph_of(mapper)
    correct = truth.copy()
    away = np.array([0.6, 0.3, 0.0])                # a closure elsewhere has left the new part that far beside
    new = distances_along(truth) > 100.0
    correct[new] = compose(away, correct[new])
    old = int(np.argmin(np.hypot(*(truth[:150] - truth[-1])[:, :2].T)))
    graph.links.append((old, len(path) - 1, between(correct[old], correct[-1]), np.eye(3)))
    growth = LoopExtension(graph)
    growth.schedule_review(distances_along(correct))
    growth.advance(Route(correct, distances_along(correct), readings), 1000)
    assert growth.has_moved and growth.has_large_shift and len(graph.links) > 10
    for first, second, measured, _ in graph.links[1:]:
        error = between(between(truth[first], truth[second]), measured)
        assert math.hypot(error[0], error[1]) < 0.3


@pytest.fixture
def searched(monkeypatch):
    """Function: results of wide searches one metre apart, as (rival, correction); returns which were accepted."""
    def run(results):
        matcher = FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1))
        closer = loop_closing.LoopCloser(matcher, 0.05, StepHistory())
        poses = np.array([[float(k), 0.0, 0.0] for k in range(len(results) + 1)])
        accepted = []
        for k, (rival, correction) in enumerate(results, 1):
            move = np.array([0.0, correction, 0.0])
            found = loop_closing.Candidate(40.0 + k, (0, k, None, None), compose(move, poses[k]), move, False,
                                           1.0 - rival)
            monkeypatch.setattr(closer, "_wide_candidate", lambda *_, found=found: found)
            scene = place_search.Scene(poses[:k + 1], 40.0 + np.arange(k + 1.0), [], 1, None, None)
            accepted.append(closer._search_wide(scene, np.array([0])))
        return accepted, closer
    return run


@pytest.mark.parametrize("rivals, accepted_at", [
    ([0.4], 1), ([0.7, 0.7], 2), ([0.8, 0.8, 0.8], 3), ([0.89] * 5, 5), ([0.7, 0.9], None), ([0.91] * 5, None)])
def test_similar_places_need_more_candidates(searched, rivals, accepted_at):
    accepted, closer = searched([(rival, 2.0) for rival in rivals])
    assert accepted == [k == accepted_at for k in range(1, len(rivals) + 1)]
    assert len(closer.graph.links) == (accepted_at or 0)


def test_only_candidates_that_agree_add_up(searched):
    accepted, closer = searched([(0.7, 2.0), (0.7, 5.0), (0.7, -3.0), (0.7, 5.2)])
    assert accepted == [False, False, False, True]
    assert [link[1] for link in closer.graph.links] == [2, 4] and closer.graph.rejected == [(0, 1), (0, 3)]


def test_place_that_agrees_with_the_path_needs_no_other(searched):
    accepted, closer = searched([(0.91, 0.2)])
    assert accepted == [True] and len(closer.graph.links) == 1


def test_frontiers_drop_corrections_that_the_path_contains():
    closer = loop_closing.LoopCloser(FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), 0.05, history_of(41))
    path = np.array([[0.5 * k, 0.0, 0.0] for k in range(41)])
    correction = np.array([0.0, 0.3, 0.0])
    closer._accept_links([(0, 40, np.array([20.0, 0.3, 0.0]), np.diag([1e6, 1e6, 1e2]))], 20.0)
    closer._extension._frontiers = [front[:3] + (correction,) for front in closer._extension._frontiers]
    bent = closer.recalibrate(path)
    assert bent[-1, 1] == pytest.approx(0.3, abs=0.05) and closer._extension.frontiers == 2
    assert not any(front[3].any() for front in closer._extension._frontiers)


def corridor(passages, length=70.0, width=2.0):
    """Walls of a corridor along x with passages 1.5 m wide and 5 m deep on both sides at the places ``passages``."""
    walls = []
    for side in (-1, 1):
        at, y, out = -5.0, side * width / 2, side * (width / 2 + 5.0)
        for x in passages:
            walls += [(at, y, x, y), (x, y, x, out), (x, out, x + 1.5, out), (x + 1.5, out, x + 1.5, y)]
            at = x + 1.5
        walls.append((at, y, length, y))
    return np.array(walls)


@pytest.mark.parametrize("passages", [(10.0, 15.0, 18.0), ()])
def test_longer_segment_resolves_similar_places(passages):
    truth = np.zeros((61, 3))
    truth[:, 0] = np.arange(61) * 0.5
    rng = np.random.default_rng(5)
    walls = corridor(passages)
    seen = [LASER.reading(np.minimum(ranges(walls, pose, LASER.angles), 6.0)
                          + rng.normal(0.0, 0.01, len(LASER.angles))) for pose in truth]
    path = np.concatenate([truth, truth])
    path[61:] = compose([0.7, 1.5, 0.02], path[61:])
    along = np.concatenate([truth[:, 0], truth[:, 0] + 100.0])
    old = np.arange(61)
    scene = place_search.Scene(path, along, seen + seen, 61, np.full(122, 5.0), np.full(122, 0.15))
    found = place_search.wide_search(scene, old)
    if passages:
        assert found.reach == tuning.SEARCH.long_path and np.abs(found.pose - truth[-1]).max() < 0.3
    else:
        assert found is None                # nothing tells along a plain corridor


def passage(seed, length=34.0, depth=0.25):
    """Walls of a corridor along x, closed at its far end, with niches of all widths here and there."""
    rng, walls = np.random.default_rng(seed), [(length, -1.0, length, 1.0)]
    for side in (-1.0, 1.0):
        at, x = -14.0, -14.0 + rng.uniform(2.0, 6.0)
        while x < length - 3.0:
            out, end = side * (1.0 + depth), x + rng.uniform(0.5, 2.5)
            walls += [(at, side, x, side), (x, side, x, out), (x, out, end, out), (end, out, end, side)]
            at, x = end, end + rng.uniform(2.0, 7.0)
        walls.append((at, side, length, side))
    return np.array(walls)


def come_back(seed, first, last, beside, depth=0.25):
    """A scene: a corridor looked at from x = 0 on, and a way from ``first`` to ``last``, thought to be ``beside``."""
    rng, walls = np.random.default_rng(seed), passage(seed, depth=depth)
    truth = np.zeros((61 + int(round(2 * (last - first))) + 1, 3))
    truth[:61, 0], truth[61:, 0] = np.arange(61) * 0.5, np.arange(first, last + 0.1, 0.5)
    seen = [LASER.reading(np.minimum(ranges(walls, pose, LASER.angles), 6.0)
                          + rng.normal(0.0, 0.01, len(LASER.angles))) for pose in truth]
    path, along = truth.copy(), np.concatenate([truth[:61, 0], truth[61:, 0] - first + 100.0])
    path[61:] = compose(beside, path[61:])
    shift = np.full(len(path), 6.0)
    return place_search.Scene(path, along, seen, 61, shift, np.full(len(path), 0.15)), truth[-1]


@pytest.mark.parametrize("last", [3.0, 4.0, 5.0])
def test_segment_from_unknown_area_is_not_shifted(last):
    places = []
    for seed in range(10):      # half of these segments fit best about 7 m farther, where all of the corridor is known
        scene, truth = come_back(seed, last - 10.0, last, [1.5, 1.0, 0.0], depth=1.0)
        place = place_search.wide_search(scene, np.arange(61))
        places.append(np.abs(place.pose - truth)[:2].max() if place is not None else 0.0)
    assert max(places) < 0.4


def test_nodes_with_common_drift_are_not_old():
    scene, _ = come_back(0, 0.0, 20.0, [1.5, 1.0, 0.0])
    scene.shift[:40] = 0.5
    assert np.array_equal(place_search._older_nodes(scene, 10.0, 100.0, 2.0), np.arange(40, 61))
    assert np.array_equal(place_search._older_nodes(scene, 10.0, 100.0), np.arange(61))


def test_coarsely_similar_place_is_rated_lower():
    (scene, truth), old = come_back(2, 5.0, 15.0, [0.0, 0.0, 0.0]), np.arange(61)
    query = place_query.thinned(place_query.query_points(scene, 10.0), 240)
    other, own = place_search._ratings(truth + [3.0, 0.0, 0.0], old, truth, old, query, scene)
    assert 0.0 <= other < 0.9 * own <= 0.9
    other, own = place_search._ratings(truth, old, truth, old, query, scene)
    assert other == own


def test_similar_place_that_free_space_excludes_leaves_evidence(monkeypatch):
    scene, truth = come_back(2, 1.0, 11.0, [1.5, 1.0, 0.02])
    expected, found = place_search.wide_search(scene, np.arange(61)), []
    assert expected is not None and expected.rival < 0.9
    excluded = np.append(truth, (1.1, 0.0, 0.0, 0.0))       # by its end points it would fit better
    monkeypatch.setattr(place_search, "_excluded_place", lambda *_: (excluded, np.arange(61)))
    for ratings in ((0.0, 0.8), (0.5, 0.8), (0.75, 0.8)):
        monkeypatch.setattr(place_search, "_ratings", lambda *_, found=ratings: found)
        found.append(place_search.wide_search(scene, np.arange(61)))
    assert found[0].rival == pytest.approx(0.2) and found[1].rival == pytest.approx(0.7) and found[2] is None


def test_fine_raster_resolves_shallow_niches():
    found = []
    for last in np.arange(11.0, 28.0, 1.0):
        scene, truth = come_back(2, last - 10.0, last, [1.5, 1.0, 0.02])
        place = place_search.wide_search(scene, np.arange(61))
        if place is not None:
            assert np.abs(place.pose - truth)[:2].max() < 0.4
            found.append(place.reach)
    assert found.count(tuning.SEARCH.path) >= 3
    scene, truth = come_back(2, 5.0, 15.0, [1.5, 1.0, 0.02], depth=0.0)
    assert place_search.wide_search(scene, np.arange(61)) is None


def test_scans_of_a_segment_are_merged():
    walls = np.array(box(0.0, 0.0, 8.0, 5.0))
    path = np.array([(0.1 * k, 0.05 * k, 0.2 * k) for k in range(10)])
    readings = [LASER.reading(ranges(walls, pose, LASER.angles)) for pose in path]
    scene = place_search.Scene(path, np.arange(10) * 0.2, readings, 1, np.zeros(10), np.zeros(10))
    beams = place_match.merged_beams(scene, 1.0)
    x, y = compose(path[-1], np.stack([beams[mk.QX], beams[mk.QY], np.zeros(beams.shape[1])], -1))[:, :2].T
    assert np.maximum(np.abs(x) / 4.0, np.abs(y) / 2.5).max() < 1.001 and beams.shape[1] > 150
    far = np.hypot(beams[mk.QX], beams[mk.QY]) > 1.0
    assert (np.minimum(np.abs(np.abs(x) - 4.0), np.abs(np.abs(y) - 2.5)) < 1e-6).all() and far.any()
    turned = compose([0.0, 0.0, path[-1, 2]], np.stack([beams[mk.NX], beams[mk.NY], np.zeros(beams.shape[1])], -1))
    is_observed = np.hypot(beams[mk.NX], beams[mk.NY]) > 0.5
    assert (np.abs(turned[is_observed, :2]).max(axis=1) > 0.99).mean() > 0.9       # normals stand on the walls
    assert np.allclose(beams[mk.ARM_N], beams[mk.NY] * beams[mk.QX] - beams[mk.NX] * beams[mk.QY])
    assert np.allclose(beams[mk.ARM_T], beams[mk.NX] * beams[mk.QX] + beams[mk.NY] * beams[mk.QY])


@pytest.mark.parametrize("end, holds", [(60.0, False), (3.0, True)])
def test_noise_along_a_plain_wall_gives_no_information(end, holds):
    rng, walls = np.random.default_rng(4), corridor(())
    walls = np.concatenate([walls, [(end, -1.0, end, 1.0)]])
    path = np.zeros((9, 3))
    path[:, 0] = np.arange(9) * 0.25
    seen = [LASER.reading(np.minimum(ranges(walls, pose, LASER.angles), 6.0)
                          + rng.normal(0.0, 0.03, len(LASER.angles)))
            for pose in path]
    scene = place_search.Scene(path, distances_along(path), seen, 8, np.ones(9), np.ones(9))
    matcher = FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1))
    _, row, _, heard = place_match.fine_match(matcher, 0.05, scene, np.arange(8), path[-1])
    assert heard[0] <= row[mk.INFORMATION] * 1.001 and heard[3] == pytest.approx(row[mk.INFORMATION + 3], rel=0.1)
    assert (heard[0] > 0.5 * row[mk.INFORMATION]) == holds and np.linalg.eigvalsh(
        [[heard[0], heard[1], heard[2]], [heard[1], heard[3], heard[4]], [heard[2], heard[4], heard[5]]])[0] > -1e-6


def test_similar_aisles_are_not_confused():
    mapper, truth = mapped(aisles, 12)
    assert mapper.info()["wide_searches"] + mapper.info()["searches"] > 5 and not false_links(mapper, truth)
    path = mapper.filter.tree.path(mapper.filter.best)
    error = between(between(truth[0], truth[-1]), between(path[0], path[-1]))
    assert math.hypot(error[0], error[1]) < 1.2


@pytest.mark.parametrize("seed", range(5))
def test_drift_follows_the_shortest_path_in_the_graph(seed):
    rng = np.random.default_rng(seed)
    path, variances, walk = np.cumsum(rng.normal(0.0, 1.0, (30, 3)), axis=0), rng.uniform(0.0, 0.1, 30), 0.02
    links, source = rng.integers(0, 30, (seed, 2)), (29, 29, 0, 12, 20)[seed]
    edges = {}
    for k in range(1, 30):
        turn = walk * math.hypot(*(path[k] - path[k - 1])[:2])
        lever = turn * math.hypot(*(path[source] - 0.5 * (path[k] + path[k - 1]))[:2])**2
        edges[k - 1, k] = edges[k, k - 1] = np.array([lever, variances[k], turn])
    for a, b in links:
        edges[a, b] = edges[b, a] = np.zeros(3)
    best = {source: np.zeros(3)}
    for _ in range(60):                 # Bellman and Ford
        for (a, b), cost in edges.items():
            if a in best and (b not in best or best[a][0] + cost[0] < best[b][0] - 1e-12):
                best[b] = best[a] + cost
    out = np.empty((30, 3))
    drift_kernels.drift(path, variances, walk, links.astype(np.int64).reshape(-1, 2), source, out)
    assert np.allclose(out, [best[k] for k in range(30)])


def test_occlusion_rejects_a_place():
    near, far = (np.array([(x, -5.0, x, 5.0)]) for x in (2.0, 5.0))
    readings = [LASER.reading(np.minimum(ranges(wall, np.zeros(3), LASER.angles), 9.0)) for wall in (near, far, near)]
    path, along = np.zeros((3, 3)), np.array([0.0, 20.0, 40.0])
    scene = place_search.Scene(path, along, readings, 2, np.zeros(3), np.zeros(3))
    pose = np.zeros(3)
    assert place_check.occlusion_conflict(scene, pose, np.array([0])) == 0.0
    assert place_check.occlusion_conflict(scene, pose, np.array([1])) > 0.4

# SPDX-License-Identifier: BSD-3-Clause
"""A robot that is carried and turned in a plain corridor: noticed later, by the places that it sees a second time."""
import math
from types import SimpleNamespace

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.backend import loop_closing, place_search, turned_path
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.frontend.occlusion import Conflict
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.frontend.scan_gaps import ScanGaps
from m2wr_gmapping.mapper import Mapper
from m2wr_maps.se2 import between, compose
from wall_ranges import ranges

LASER = LaserModel.from_message(-math.pi / 2, math.pi / 2, math.pi / 120, 121, 0.05, 8.0)
HALF, BEGIN, PLAIN, END = 1.1, -40.0, 16.0, 90.0        # half width of the corridor; it is plain from PLAIN to END [m]
START, PLACE, STEP, MISSING = -35.0, 30.0, 0.1, 10      # of the drive, of the turn [m]; number of missing scans
STILL = tuning.TURNS.half_turn      # time in which a person can turn the robot [s]


def corridor(rng):
    """Walls (S, 4) of a corridor along x that has niches before ``PLAIN``."""
    walls = [(BEGIN, -HALF, BEGIN, HALF), (END, -HALF, END, HALF)]
    for side in (-HALF, HALF):
        at, x = BEGIN, BEGIN + rng.uniform(1.0, 4.0)
        while x < PLAIN - 2.0:
            out, width = side * (1.0 + rng.uniform(0.3, 1.0)), rng.uniform(0.6, 2.0)
            end = x + width
            walls += [(at, side, x, side), (x, side, x, out), (x, out, end, out), (end, out, end, side)]
            at, x = end, end + rng.uniform(1.0, 5.0)
        walls.append((at, side, END, side))
    return np.array(walls)


def drive(turn, askew):
    """True poses (K, 3): along the corridor, then turned by ``turn`` and ``askew``, and on; number of the turn."""
    there = np.zeros((int((PLACE - START) / STEP), 3))
    there[:, 0] = START + STEP * np.arange(len(there))
    after = np.zeros((500, 3))
    after[:, 0] = STEP * np.arange(len(after))
    last = there[-1] + [0.0, 0.0, turn]
    return np.concatenate([there, [last + [0.0, 0.0, askew]], compose(last, after)]), len(there)


def mapped(turn, askew, missing, seed=3):
    """The mapper after a drive whose odometry knows nothing of the turn, and the last true pose."""
    rng = np.random.default_rng(seed)
    walls, (truth, turned) = corridor(rng), drive(turn, askew)
    odom = [truth[0]]
    for k in range(1, len(truth)):
        step = between(truth[k - 1], truth[k]) if k != turned else np.zeros(3)
        odom.append(compose(odom[-1], step * [1.01, 1.0, 1.0]))
    mapper = Mapper(GmappingConfig.from_mapping(dict(
        particles=4, threads=1, linearUpdate=0.5, angularUpdate=0.4, xmin=-1.0, ymin=-1.0, xmax=1.0, ymax=1.0)), LASER)
    for k, (pose, at) in enumerate(zip(truth, odom)):
        seen = ranges(walls, pose, LASER.angles) + rng.normal(0.0, 0.01, len(LASER.angles))
        mapper.process(mapper.reading(seen), at, 0.1 * (k + (missing if k >= turned else 0)))
    return mapper, truth[-1]


@pytest.mark.parametrize("turn, askew", [(math.pi, math.radians(10.0)), (-math.pi, math.radians(-12.0))])
def test_turn_in_a_plain_corridor_is_found_later(turn, askew):
    mapper, last = mapped(turn, askew, MISSING)
    assert np.hypot(*(mapper.pose - last)[:2]) < 0.3
    assert abs(math.remainder(mapper.pose[2] - last[2], 2.0 * math.pi)) < 0.05
    assert not mapper._history.doubtful


def test_a_turn_that_was_contradicted_is_not_tried_again(monkeypatch):
    tried = []
    monkeypatch.setattr(loop_closing, "is_consistent", lambda graph, route, node: bool(tried.append(node)))
    mapper, last = mapped(math.pi, math.radians(10.0), MISSING)
    assert tried == [mapper._history.doubtful[0][0]] and not mapper._history.doubtful[0][1][0]
    assert abs(math.remainder(mapper.pose[2] - last[2] - math.pi, 2.0 * math.pi)) < 0.05


@pytest.mark.parametrize("askew, missing, doubtful", [
    (0.0, 0, 0), (0.0, 1, 0), (0.0, MISSING, 1), (0.17, 0, 0), (0.17, MISSING, 1)])
def test_without_a_turn_the_path_goes_straight_on(askew, missing, doubtful):
    """Only a slip while scans are missing is doubtful, and stays so as long as no place is seen again.

    A gap alone is doubtful if it is rare enough: it is the only one in some 600 scans.
    """
    mapper, last = mapped(0.0, askew, missing)
    assert np.hypot(*(mapper.pose - last)[:2]) < 1.0 and abs(mapper.pose[2]) < 0.02
    assert len(mapper._history.doubtful) == doubtful


@pytest.mark.parametrize("size, turned, alike", [
    ((6.0, 6.0), 0.0, [True, True, True]), ((8.0, 4.0), 0.0, [True, False, False]),
    ((6.0, 6.0), 1.4, [True, True, False]), ((6.0, 6.0), -3.0, [False, True, True])])
def test_a_square_room_looks_alike_after_a_quarter_turn(size, turned, alike):
    """Where a turn was noticed, the turn back is none of them."""
    x, y = 0.5 * np.array(size)
    walls = np.array([(-x, -y, x, -y), (x, -y, x, y), (x, y, -x, y), (-x, y, -x, -y)])
    laser = LaserModel.from_message(-math.pi, math.pi, math.pi / 120, 241, 0.05, 8.0)
    path = np.zeros((6, 3))
    path[:, 0] = np.linspace(-1.0, 0.0, 6)
    seen = [laser.reading(ranges(walls, pose, laser.angles)) for pose in path]
    assert list(turned_path.looks_alike(path, seen, turned)) == alike


@pytest.mark.parametrize("turn", [math.pi, 0.5 * math.pi, -0.5 * math.pi, 3.0])
def test_fixed_point_tells_where_the_robot_was_turned(turn):
    path = np.array([[0.5 * k, 1.0, 0.0] for k in range(41)])
    place = np.append(path[20, :2], 0.0)
    correction = compose(compose(place, [0.0, 0.0, turn]), [-place[0], -place[1], 0.0])
    shift = np.full(len(path), 0.5)
    alike = np.array([abs(turn - angle) < 0.5 for angle in turned_path.RIGHT_ANGLES])
    doubts = [(5, alike), (20, alike), (30, alike), (21, ~alike)]
    assert turned_path.turned_node(path, doubts, correction, shift) == 20
    assert turned_path.turned_node(path, doubts[-1:], correction, shift) is None     # not alike after this turn
    doubts = [(5, alike), (30, alike)]
    assert turned_path.turned_node(path, doubts, correction, shift) is None
    shift[5] = 15.0     # so much drift may have moved the place
    assert turned_path.turned_node(path, doubts, correction, shift) == 5


#: A graph that places no node after the turn.
NOT_PLACED = SimpleNamespace(scene=lambda *_: (None, np.zeros(0, int), None))


def drifting(shift):
    """A graph whose nodes have drifted by at most ``shift`` [m] and 0.1 rad against the first 41."""
    def scene(route, node):
        count = node + 1
        return (place_search.Scene(route.path[:count], route.along[:count], route.readings[:count], 41,
                                   np.full(count, shift), np.full(count, 0.1)), np.arange(41), np.zeros(0, int))
    return SimpleNamespace(scene=scene)


@pytest.mark.parametrize("aside, shift, wanted", [
    (0.0, 0.5, True), (1.5, 0.5, False), (0.8, 0.3, False), (0.8, 1.2, True)])
def test_path_through_walls_is_not_consistent(aside, shift, wanted):
    """Unless it has drifted so far, and its scans fit where they do not look through walls."""
    rng = np.random.default_rng(1)
    walls = corridor(rng)
    truth = np.zeros((41, 3))
    truth[:, 0] = START + 0.5 * np.arange(41)
    seen = [LASER.reading(ranges(walls, pose, LASER.angles)) for pose in truth]
    path = np.concatenate([truth, truth + [0.0, aside, 0.0]])
    along = np.concatenate([distances_along(truth), 30.0 + distances_along(truth)])
    route = Route(path, along, seen + seen)
    assert turned_path.is_consistent(drifting(shift), route, 41) == wanted
    assert turned_path.is_consistent(NOT_PLACED, route, 41)


@pytest.mark.parametrize("few, wanted", [(True, True), (False, False)])
def test_a_scan_counts_by_what_it_has_in_view(few, wanted, monkeypatch):
    """One of five contradicts. It is a passer-by if it has hardly anything in view."""
    found = iter([Conflict(0, 50, 1, 50)] * 4 + [Conflict(0, 0, 3, 3) if few else Conflict(90, 100, 90, 100)])
    monkeypatch.setattr(turned_path, "conflict_with_nearest", lambda *_: next(found))
    path = np.zeros((7, 3))
    path[:, 0] = turned_path.SEARCH.near_path * np.arange(7)
    monkeypatch.setattr(turned_path.place_search, "near_search", lambda *_: (None, False))
    graph = SimpleNamespace(scene=lambda *_: (None, np.zeros(1, int), None))
    assert turned_path.is_consistent(graph, Route(path, path[:, 0].copy(), [None] * 7), 1) == wanted


@pytest.mark.parametrize("stamps, noticed", [
    ((0.0, 0.1, 0.2, 0.3), False), ((0.0, 0.1, 0.2, 0.4), True), ((0.0, 0.1, 0.2, 0.33), False), ((0.0, 5.0), False)])
def test_missing_scans_are_noticed(stamps, noticed):
    gaps = ScanGaps()
    for stamp in stamps:
        gaps.add(stamp)
    assert (gaps.surprise > 0.0) == noticed
    gaps.restart()
    assert gaps.surprise == 0.0


def test_a_gap_surprises_more_if_it_is_long_or_rare():
    def surprise(length, often):
        gaps, stamp = ScanGaps(), 0.0
        for k in range(600):
            stamp += 0.2 if often and k % 10 == 9 else 0.1
            gaps.add(stamp)
        gaps.restart()
        gaps.add(stamp + length)
        return gaps.surprise

    assert surprise(0.11, often=False) == surprise(0.11, often=True) == 0.0
    assert surprise(0.4, often=False) > 6.0 > surprise(0.4, often=True) > surprise(0.2, often=True) > 0.0
    assert surprise(1.2, often=True) > 6.0


@pytest.mark.parametrize("slips, allowed", [(0, True), (40, False)])
def test_frequent_slips_beside_frequent_gaps_are_no_turn(slips, allowed):
    gaps, stamp = ScanGaps(), 0.0
    for k in range(300):
        stamp += 0.2 if k % 10 == 9 else 0.1
        gaps.add(stamp)
        gaps.allow_turn(k < slips, STILL)
        gaps.restart()
    gaps.add(stamp + 0.2)
    assert gaps.allow_turn(True, STILL) == allowed
    assert not gaps.allow_turn(True, 0.9 * STILL)


@pytest.mark.parametrize("carried", [False, True])
def test_a_robot_that_is_carried_into_another_room_is_doubtful(carried):
    """Without any gap between the scans: those of the new room look through walls of the old one, and fit nowhere."""
    rooms = [np.array([(-x, -y, x, -y), (x, -y, x, y), (x, y, -x, y), (-x, y, -x, -y), (-x, -y, -x + cut, y)])
             for x, y, cut in ((4.0, 1.5, 1.0), (2.2, 6.0, 3.0))]
    mapper = Mapper(GmappingConfig.from_mapping(dict(
        particles=4, threads=1, linearUpdate=0.5, angularUpdate=0.4, xmin=-1.0, ymin=-1.0, xmax=1.0, ymax=1.0)), LASER)
    for k in range(30):
        odom = np.array([0.1 * k - 2.0, 0.0, 0.0])
        is_away = carried and k >= 15
        seen = ranges(rooms[int(is_away)], odom - is_away * np.array([1.0, 0.3, 0.0]), LASER.angles)
        mapper.process(mapper.reading(seen), odom, 0.1 * k)
    assert bool(mapper._history.doubtful) == carried
    mapper.close()

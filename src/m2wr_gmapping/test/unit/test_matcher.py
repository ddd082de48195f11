# SPDX-License-Identifier: BSD-3-Clause
"""What a match makes of a direction in which its scan says nothing."""
import math
from types import SimpleNamespace

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_gmapping.config import GmappingConfig
from m2wr_gmapping.filter.tile_maps import NEVER, TileMaps
from m2wr_gmapping.frontend.matcher import (
    DOUBTFUL,
    LARGE_SLIP,
    NO_PRIOR,
    NO_SLIP,
    SLIP,
    UNEXPLAINED,
    FastMatcher,
    occlusion_cost,
)
from m2wr_gmapping.frontend.occlusion import NO_CONFLICT, Conflict
from m2wr_gmapping.frontend.scan import LaserModel
from m2wr_gmapping.frontend.track import Request
from m2wr_maps.se2 import compose
from m2wr_node.thread_team import ThreadTeam

LASER = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 180, 181, 0.05, 20.0, max_urange=6.0)
STILL = tuning.TURNS.half_turn      # time in which a person can turn the robot [s]
WANTED, START = np.array([0.5, 0.0, 0.0]), np.array([0.47, 0.02, 0.01])


def seen(x, end, laser=LASER, heading=0.0):
    """Reading from the middle of a corridor 2 m wide, ``x`` [m] along it, of which a wall is the end at ``end`` [m]."""
    angles = laser.angles + heading
    with np.errstate(divide="ignore"):
        return laser.reading(np.minimum(1.0 / np.abs(np.sin(angles)), np.where(
            np.cos(angles) > 1e-9, (end - x) / np.cos(angles), np.inf)))


def corridor(end, particles):
    """Matcher, maps of a scan from where the corridor begins, and a reading half a metre further."""
    matcher, maps = FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), TileMaps(particles, 0.05, NEVER)
    first = seen(0.0, end)
    maps.cover((-8.0, -8.0), (8.0, 8.0))
    for particle in range(particles):
        maps.register(np.zeros((1, 3)), first.points, particle)
    return matcher, maps, seen(0.5, end)


@pytest.mark.parametrize("end, along", [(60.0, 0.45), (3.0, 0.5)])
def test_particles_keep_odometry_along_a_plain_wall(end, along):
    """Odometry is 5 cm short: the end of the corridor tells of it, plain walls do not."""
    matcher, maps, reading = corridor(end, 3)
    predictions = np.tile([0.45, 0.0, 0.0], (3, 1))
    rows = matcher.match(maps, reading, np.tile(START, (3, 1)), predictions, np.full(3, 10.0), 0.0)
    assert rows[:, 0] == pytest.approx(np.full(3, along), abs=0.005)
    assert np.abs(rows[:, 1:3]).max() < 0.01


@pytest.mark.parametrize("end", [60.0, 3.0])
def test_tracking_keeps_odometry_along_a_plain_wall(end):
    matcher, maps, reading = corridor(end, 1)
    ask = Request(START, WANTED, np.full(3, 0.1), np.full(2, 0.2), WANTED)
    row, slip, _ = matcher.track(maps, 0, reading, ask, False, 1.0, lambda pose: NO_CONFLICT, STILL)
    assert row[:3] == pytest.approx(WANTED, abs=0.005) and slip == NO_SLIP


@pytest.mark.parametrize("denied, found", [
    (Conflict(90, 100, 90, 100), LARGE_SLIP), (Conflict(0, 100, 90, 100), DOUBTFUL), (NO_CONFLICT, NO_SLIP)])
def test_few_beams_show_a_turn_that_older_scans_demand(denied, found):
    """The match of 26 beams is worth less than the improbability of a slip; what older scans have seen is not.

    Odometry has missed 35 degrees, which is twice the window of a small slip. A person who comes hides older walls, but
    then no ray of the new scan passes through them.
    """
    matcher, maps, _ = corridor(3.0, 1)
    true, told = -math.radians(35.0), np.zeros(3)
    few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 36, 37, 0.05, 20.0, max_urange=6.0)
    reading = seen(0.0, 3.0, few, true)
    ask = Request(told, told, np.full(3, 1e-3), np.array([0.2, 0.3]), told)

    def conflict(pose):
        return denied if abs(pose[2] - true) > 0.1 else NO_CONFLICT
    row, slip, _ = matcher.track(maps, 0, reading, ask, False, 0.0, conflict, STILL)
    assert slip == found
    assert row[2] == pytest.approx(true if found == LARGE_SLIP else 0.0, abs=0.02)


@pytest.mark.parametrize("share, rotated, found", [(1.0, 35.0, LARGE_SLIP), (0.0, 35.0, NO_SLIP), (1.0, 0.0, NO_SLIP)])
def test_a_scan_that_suddenly_fits_nothing_shows_a_turn(share, rotated, found):
    """Without any conflict: the robot has turned, or looks into an unknown area, where no match is expected."""
    matcher, maps, _ = corridor(3.0, 1)
    true, told = -math.radians(rotated), np.zeros(3)
    few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 72, 73, 0.05, 20.0, max_urange=6.0)
    ask = Request(told, told, np.full(3, 1e-3), np.array([0.2, 0.3]), told)
    row, slip, _ = matcher.track(maps, 0, seen(0.0, 3.0, few, true), ask, False, share, lambda pose: NO_CONFLICT,
                                 STILL)
    assert slip == found and row[2] == pytest.approx(true if found == LARGE_SLIP else 0.0, abs=0.02)


@pytest.mark.parametrize("conflict, found", [
    (NO_CONFLICT, DOUBTFUL), (Conflict(0, 100, 90, 100), DOUBTFUL), (Conflict(90, 100, 90, 100), UNEXPLAINED)])
def test_a_scan_of_an_unknown_area_is_no_turn(conflict, found):
    """Nothing of it fits, wherever the robot would look. Only walls that it looks through show that it was moved."""
    matcher, maps, _ = corridor(3.0, 1)
    ranges = 1.5 + 0.4 * np.random.default_rng(1).random(len(LASER.angles))
    here = np.array([5.0, 5.0, 0.0])
    ask = Request(here, here, np.full(3, 1e-3), np.array([0.2, 0.3]), here)
    row, slip, _ = matcher.track(maps, 0, LASER.reading(ranges), ask, False, 1.0, lambda pose: conflict, STILL)
    assert slip == found and row[:3] == pytest.approx([5.0, 5.0, 0.0])


@pytest.fixture
def followed():
    """Function: what 37 beams tell, scan after scan, for rotations (told, true) of the robot on the spot."""
    matcher, maps, _ = corridor(3.0, 1)
    few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 36, 37, 0.05, 20.0, max_urange=6.0)

    def follow(conflict, *turns):
        rival, before, found = None, 0.0, []
        for told, true in turns:
            expected = np.array([0.0, 0.0, told])
            ask = Request(expected, expected, np.full(3, 1e-4), np.array([0.2, 0.3]), expected)
            rival, before = rival and rival.moved([0.0, 0.0, told - before]), told
            row, slip, rival = matcher.track(maps, 0, seen(0.0, 3.0, few, true), ask, False, 1.0, conflict, STILL,
                                             rival)
            found.append((slip, round(float(row[2]), 1) + 0.0))
        return found
    return follow


def test_evidence_of_consecutive_scans_for_a_slip_adds_up(followed):
    """37 beams are not enough for a slip of 15 degrees; two such scans are, if they agree on it."""
    slip = -math.radians(15.0)

    def conflict(pose):
        return Conflict(30, 100, 0, 100) if pose[2] > -0.1 else NO_CONFLICT
    assert followed(conflict, (0.0, slip), (-0.2, slip - 0.2)) == [(DOUBTFUL, 0.0), (SLIP, round(slip - 0.2, 1))]
    # a scan without a slip ends the evidence
    assert followed(conflict, (0.0, slip), (0.0, 0.0), (0.0, slip)) == [
        (DOUBTFUL, 0.0), (NO_SLIP, 0.0), (DOUBTFUL, 0.0)]


def test_evidence_of_consecutive_scans_for_a_turn_adds_up(followed):
    turn = -math.radians(35.0)
    assert followed(lambda pose: NO_CONFLICT, (0.0, turn), (0.12, turn + 0.12)) == [
        (DOUBTFUL, 0.0), (LARGE_SLIP, round(turn + 0.12, 1))]


def test_a_turn_that_was_found_needs_no_further_evidence(followed):
    """The third scan is from the place of the second; until odometry has moved on, the turn is not confirmed."""
    turn = -math.radians(35.0)
    found = followed(lambda pose: NO_CONFLICT, (0.0, turn), (0.12, turn + 0.12), (0.13, turn + 0.13))
    assert found[2] == (LARGE_SLIP, round(turn + 0.13, 1))
    # unless the scan fits by odometry
    assert followed(lambda pose: NO_CONFLICT, (0.0, turn), (0.12, turn + 0.12), (0.13, 0.13))[2] == (NO_SLIP, 0.1)


@pytest.mark.parametrize("before", [True, False])
def test_a_robot_may_be_turned_before_it_drives_or_after(before):
    """It crosses the corridor between two scans. If it was turned first, odometry has its direction wrong."""
    matcher, maps, _ = corridor(3.0, 1)
    anchor, driven, turn = np.array([0.0, -0.6, 0.5 * math.pi]), [1.2, 0.0, 0.0], [0.0, 0.0, -math.radians(100.0)]
    told = compose(anchor, driven)
    true = compose(compose(anchor, turn), driven) if before else compose(told, turn)
    ask = Request(told, told, np.full(3, 1e-3), np.array([0.2, 0.3]), anchor)
    angles = LASER.angles + true[2]
    with np.errstate(divide="ignore"):
        ranges = np.minimum(np.minimum((1.0 - true[1]) / np.maximum(np.sin(angles), 1e-9),
                                       (1.0 + true[1]) / np.maximum(-np.sin(angles), 1e-9)),
                            np.where(np.cos(angles) > 1e-9, (3.0 - true[0]) / np.cos(angles), np.inf))

    def conflict(pose):
        return NO_CONFLICT if abs(pose[2] - true[2]) < 0.3 else Conflict(90, 100, 90, 100)
    row, slip, _ = matcher.track(maps, 0, LASER.reading(ranges), ask, True, 1.0, conflict, 2.0 * STILL)
    assert slip == LARGE_SLIP and row[1:3] == pytest.approx(true[1:], abs=0.05)


@pytest.mark.parametrize("conflict, found", [
    (Conflict(0, 100, 60, 100), DOUBTFUL), (Conflict(60, 100, 60, 100), SLIP)])
def test_a_person_in_front_is_no_slip(conflict, found):
    """After a slip of 20 degrees more of the beams would fit than without it, but not 80 % of them."""
    matcher, maps, _ = corridor(3.0, 1)
    slipped = -math.radians(20.0)
    ranges = np.hypot(*seen(0.0, 3.0, LASER, slipped).rays).astype(float)
    ranges[115:] *= np.random.default_rng(3).uniform(0.4, 0.9, len(ranges) - 115)
    ask = Request(np.zeros(3), np.zeros(3), np.full(3, 1e-4), np.array([0.2, 0.3]), np.zeros(3))
    _, slip, _ = matcher.track(maps, 0, LASER.reading(ranges), ask, False, 0.0,
                               lambda pose: NO_CONFLICT if abs(pose[2] - slipped) < 0.1 else conflict, 0.0)
    assert slip == found


def test_scans_from_one_place_are_one_observation(followed):
    assert followed(lambda pose: NO_CONFLICT, *[(0.0, -math.radians(35.0))] * 4) == [(DOUBTFUL, 0.0)] * 4


def test_a_slip_while_driving_is_noticed_by_the_match_alone():
    """No surface is looked through, and no score is expected: the robot drives. The slip explains all beams."""
    matcher, maps, _ = corridor(3.0, 1)
    slipped = -math.radians(15.0)
    ask = Request(np.zeros(3), np.zeros(3), np.full(3, 1e-4), np.array([0.2, 0.3]), np.zeros(3))
    row, slip, _ = matcher.track(maps, 0, seen(0.0, 3.0, LASER, slipped), ask, False, 0.0, lambda pose: NO_CONFLICT,
                                 0.0)
    assert slip == SLIP and row[2] == pytest.approx(slipped, abs=0.02)


def test_fewer_beams_than_one_observation_decide_nothing():
    matcher, maps, _ = corridor(3.0, 1)
    few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 8, 9, 0.05, 20.0, max_urange=6.0)
    ask = Request(np.zeros(3), np.zeros(3), np.full(3, 1e-4), np.array([0.2, 0.3]), np.zeros(3))
    _, slip, rival = matcher.track(maps, 0, seen(0.0, 3.0, few, -math.radians(15.0)), ask, False, 1.0,
                                   lambda pose: Conflict(9, 9, 9, 9), STILL)
    assert slip == NO_SLIP and rival is None


@pytest.mark.parametrize("heading", [-35.0, 0.0])
@pytest.mark.parametrize("scans, slip", [(2, LARGE_SLIP), (1, NO_SLIP)])
def test_too_few_beams_leave_a_turn_as_it_is(heading, scans, slip):
    """They neither end a turn that was found, nor decide about one that was not, even if they fit by odometry."""
    matcher, maps, _ = corridor(3.0, 1)
    turn, told, rival = -math.radians(35.0), 0.0, None
    for count, true in [(37, turn), (37, turn + 0.12)][:scans] + [(9, math.radians(heading) + 0.12)]:
        few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / (count - 1), count, 0.05, 20.0,
                                      max_urange=6.0)
        ask = Request(*[np.array([0.0, 0.0, told])] * 2, np.full(3, 1e-4), np.array([0.2, 0.3]), np.zeros(3))
        before = rival
        row, found, rival = matcher.track(maps, 0, seen(0.0, 3.0, few, true), ask, False, 1.0,
                                          lambda pose: NO_CONFLICT, STILL, rival)
        told, rival = 0.12, rival and rival.moved([0.0, 0.0, 0.12 - told])
    assert found == slip and before is not None and rival.evidence == before.evidence
    assert row[2] == pytest.approx(turn + 0.12 if slip == LARGE_SLIP else 0.12, abs=0.05)


def room_with_cupboard():
    """Matcher, map of a room of 6 m by 2 m from its middle, and a function that returns its scan at a heading.

    The room looks alike after half a turn, but for a cupboard ahead.
    """
    matcher, maps = FastMatcher(GmappingConfig.from_mapping({}), ThreadTeam(1)), TileMaps(1, 0.05, NEVER)
    laser = LaserModel.from_message(-math.pi, math.pi, math.pi / 180, 361, 0.05, 20.0, max_urange=6.0)

    def scan(heading):
        angles = laser.angles + heading
        with np.errstate(divide="ignore"):
            found = np.minimum(1.0 / np.abs(np.sin(angles)), 3.0 / np.abs(np.cos(angles)))
        is_ahead = np.cos(angles - 0.3) > math.cos(0.3)
        return laser.reading(np.where(is_ahead, 0.7 * found, found))
    maps.cover((-8.0, -8.0), (8.0, 8.0))
    maps.register(np.zeros((1, 3)), scan(0.0).points, 0)
    return matcher, maps, scan


@pytest.mark.parametrize("headings, slip", [((math.pi,), SLIP), ((1.8, math.pi), LARGE_SLIP)])
def test_a_slip_does_not_end_a_turn_that_goes_further(headings, slip):
    """After half a turn a slip of 0.45 rad explains more than 80 % of the beams."""
    matcher, maps, scan = room_with_cupboard()
    ask, rival = Request(*[np.array([0.0, 0.0, 0.45])] * 2, np.full(3, 1e-3), np.array([0.3, 0.5]), np.zeros(3)), None
    for true in headings:
        def conflict(pose, true=true):
            return NO_CONFLICT if math.cos(pose[2] - true) > 0.9 else Conflict(30, 100, 30, 100)
        row, found, rival = matcher.track(maps, 0, scan(true), ask, False, 1.0, conflict, STILL, rival)
    assert found == slip
    assert abs(math.remainder(row[2] - (math.pi if slip == LARGE_SLIP else 0.0), 2.0 * math.pi)) < 0.02


@pytest.mark.parametrize("still, found", [(1.0, LARGE_SLIP), (0.05, DOUBTFUL), (0.0, DOUBTFUL)])
def test_a_robot_that_drives_on_has_not_turned_on_the_spot(still, found):
    """Where a person hides all walls, a scan fits best wherever the robot looks at other ones."""
    matcher, maps, _ = corridor(3.0, 1)
    few = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 72, 73, 0.05, 20.0, max_urange=6.0)
    ask = Request(np.zeros(3), np.zeros(3), np.full(3, 1e-3), np.array([0.2, 0.3]), np.zeros(3))
    _, slip, _ = matcher.track(maps, 0, seen(0.0, 3.0, few, -math.radians(35.0)), ask, False, 1.0,
                               lambda pose: NO_CONFLICT, still)
    assert slip == found


def test_conflict_by_occlusion_costs_its_log_likelihood_ratio():
    assert occlusion_cost(0.15, 100) == 0.0
    assert occlusion_cost(1.0, 100) == pytest.approx(10.0 * math.log(1.0 / 0.15))
    costs = [occlusion_cost(share, 100) for share in np.linspace(0.15, 1.0, 20)]
    assert (np.diff(costs) > 0.0).all()


@pytest.mark.parametrize("deviations, along", [
    (NO_PRIOR, 0.5), (np.array([0.2, 0.2]), 0.5), (np.array([0.02, 0.2]), 0.1)])
def test_a_search_weighs_scan_and_prior_as_a_match_does(deviations, along):
    """The end of the corridor tells where the robot is; a prior of 2 cm outweighs it."""
    matcher, maps, reading = corridor(3.0, 1)
    found = matcher.search(maps, 0, reading, np.array([0.1, 0.0, 0.0]), np.array([0.6, 0.3]), deviations)
    assert found == pytest.approx([along, 0.0, 0.0], abs=0.06)


def test_far_end_points_do_not_change_a_search():
    """They are outside of its field, and would only ask for smaller steps of rotation."""
    far = LaserModel.from_message(-0.5 * math.pi, 0.5 * math.pi, math.pi / 180, 181, 0.05, 80.0, max_urange=80.0)
    matcher, maps, _ = corridor(60.0, 1)
    reading = seen(0.5, 60.0, far)
    beams = reading.beams[:, np.hypot(*reading.beams[:2]) <= tuning.SEARCH.reach]
    assert beams.shape[1] < reading.beams.shape[1]
    found = [matcher.search(maps, 0, scan, START, np.array([0.2, 0.3]), NO_PRIOR)
             for scan in (reading, SimpleNamespace(beams=np.ascontiguousarray(beams)))]
    np.testing.assert_array_equal(*found)

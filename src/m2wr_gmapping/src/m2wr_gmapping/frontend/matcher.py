# SPDX-License-Identifier: BSD-3-Clause
"""Scan matcher of the particle filter."""
from __future__ import annotations

import functools
import math
from typing import TYPE_CHECKING, Callable, List, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.filter.tile_kernels import draw_field, tiles_around
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend import tracking_kernels as tk
from m2wr_gmapping.frontend.correlative_kernels import search_window
from m2wr_gmapping.frontend.information_kernels import fuse_all
from m2wr_gmapping.frontend.occlusion import MOST_CONFLICT, NO_CONFLICT, Conflict
from m2wr_gmapping.frontend.standstill import turn_cost
from m2wr_maps.se2 import between, compose

if TYPE_CHECKING:
    from m2wr_gmapping.config import GmappingConfig
    from m2wr_gmapping.filter.tile_maps import TileMaps
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_gmapping.frontend.track import Request
    from m2wr_node.array_types import FloatArray, Vector
    from m2wr_node.thread_team import ThreadTeam

NARROW = tuning.MATCHING.narrow
SEARCH_STEP = math.sqrt(NARROW)         # of the window search [m]
BASIN = np.array(tuning.MATCHING.basin)      # [m, rad]
WINDOW_MOST = np.array(tuning.MATCHING.search_most)
NO_PRIOR = np.array([math.inf, math.inf])
TURN_WINDOW = np.array([tuning.MATCHING.search_most[0], math.pi / tuning.SLIPS.sectors])    # [m, rad]
NO_SLIP, DOUBTFUL, SLIP, LARGE_SLIP, UNEXPLAINED = range(5)


#: Centre of a search (3,) [m, m, rad], its half widths (2,) [m, rad], and the motion that leads there.
Place = Tuple["FloatArray", "FloatArray", "Motion"]


class Motion(NamedTuple):
    """A motion that odometry has not measured, as a hypothesis.

    Attributes
    ----------
    turned : bool
        Whether a person has turned the robot on the spot; else its wheels have slipped.
    least_share : float
        Least score per beam of a scan at a pose after it.
    most_conflict : float
        Greatest share of end points that may be in conflict with older scans.
    still : float
        Time in which it may have happened [s].
    tries : float
        Logarithm of the number of hypotheses that are tried.
    """

    turned: bool
    least_share: float
    most_conflict: float = 1.0
    still: float = math.inf
    tries: float = 0.0

    def cost(self, angle: float) -> float:
        """Return the negative logarithm of its probability if it turned the robot by an angle [rad]."""
        return self.tries + turn_cost(angle, self.still)


class Rival(NamedTuple):
    """A match after a motion that odometry has not measured.

    Attributes
    ----------
    row : (13,) float64
        Result row; it begins with the pose in ``map`` [m, m, rad].
    evidence : float
        Logarithm of how much better it explains the consecutive scans so far than the pose by odometry.
    surplus : float
        Evidence beyond that which an improbable motion needs.
    motion : Motion
        What has happened.
    earlier : float
        Evidence of scans from other places. Scans from one place depend on each other: only the best of them counts.
    since : (3,) float64
        Motion by odometry since the first scan from the present place [m, m, rad].
    """

    row: FloatArray
    evidence: float
    surplus: float
    motion: Motion
    earlier: float
    since: FloatArray

    def moved(self, step: FloatArray) -> Rival:
        """Return it after a step (3,) of odometry [m, m, rad]."""
        row, since = self.row.copy(), compose(self.since, step)
        row[:3] = compose(row[:3], step)
        if math.hypot(since[0], since[1]) > BASIN[0] or abs(since[2]) > BASIN[1]:
            return self._replace(row=row, earlier=self.evidence, since=np.zeros(3))
        return self._replace(row=row, since=since)


class FastMatcher:
    """Gauss-Newton on point-to-line distances, with a window search after long or doubtful steps.

    Parameters
    ----------
    config : GmappingConfig
    workers : ThreadTeam
    """

    def __init__(self, config: GmappingConfig, workers: ThreadTeam) -> None:
        self._workers = workers
        self._settings = np.zeros(mk.MATCH_SETTINGS)
        self._settings[mk.WIDE], self._settings[mk.NARROW] = tuning.MATCHING.wide, NARROW
        self._settings[mk.ROUNDS] = tuning.MATCHING.rounds
        self._settings[mk.SPREAD] = tuning.MATCHING.beam_deviation
        self._settings[mk.SIGMA], self._settings[mk.LSIGMA] = config["sigma"], config["lsigma"]
        self._settings[mk.FREE] = tuning.SCANS.slide
        self._near_settings = self._settings.copy()
        self._near_settings[mk.WIDE] = NARROW

    def match(self, maps: TileMaps, reading: ScanReading, starts: FloatArray, predictions: FloatArray,
              prior: FloatArray, minimum_score: float) -> FloatArray:
        """Match one scan in the map of every particle.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        reading : ScanReading
            The scan.
        starts : (N, 3) float64
            Start poses in ``map``.
        predictions : (N, 3) float64
            Poses predicted by odometry.
        prior : (3,) float64
            Inverse variances along the axes of the prediction.
        minimum_score : float
            A particle whose match has this score or less keeps its prediction, without information.

        Returns
        -------
        (N, 13) float64
            Result rows of ``match_kernels``.
        """
        results, beams = np.empty((len(starts), mk.RESULT_SIZE)), reading.beams
        least = min(minimum_score, tuning.MATCHING.score * beams.shape[1])
        settings = self._near_settings

        def work(first: int, last: int) -> None:
            mk.match_particles(starts, predictions, first, last, beams, maps.table, *maps.layout, prior, settings,
                               least, results)

        self._workers.run(work, len(starts))
        fuse_all(results, predictions, prior)
        return results

    def match_one(self, maps: TileMaps, particle: int, beams: FloatArray, start: FloatArray, prediction: FloatArray,
                  prior: FloatArray) -> FloatArray:
        """Match in the map of one particle.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        particle : int
            Index of the particle.
        beams : (7, B) float64
            End points of the scan, in the layout of ``match_kernels``.
        start : (3,) float64
            Start pose in ``map``.
        prediction : (3,) float64
            Pose predicted by odometry.
        prior : (3,) float64
            Inverse variances along the axes of the prediction.

        Returns
        -------
        (13,) float64
            Result row of ``match_kernels``.
        """
        rows = np.empty((1, mk.RESULT_SIZE))
        mk.match_particles(start[None], prediction[None], 0, 1, beams, maps.table[particle:particle + 1], *maps.layout,
                           prior, self._settings, -math.inf, rows)
        return rows[0]

    def _match(self, maps: TileMaps, particle: int, reading: ScanReading, start: FloatArray, expected: FloatArray,
               variances: FloatArray, near: bool = False) -> Tuple[FloatArray, float, float]:
        """Return the match with odometry in the map of one particle, its cost and pull; see ``match_with_odometry``.

        With ``near`` it begins with the last width of the robust kernel.
        """
        row = np.empty(mk.RESULT_SIZE)
        cost, pull = tk.match_with_odometry(
            start, expected, variances, reading.beams, maps.table[particle:particle + 1], *maps.layout,
            self._near_settings if near else self._settings, row)
        return row, cost, pull

    def track(self, maps: TileMaps, particle: int, reading: ScanReading, ask: Request, long: bool, share: float,
              conflict: Callable[[FloatArray], Conflict], still: float,
              rival: Optional[Rival] = None) -> Tuple[FloatArray, int, Optional[Rival]]:
        """Match in the map of one particle, and detect slip of odometry.

        The scan is first matched with the prior of odometry. If it does not fit well after a long step, the window that
        the prior leaves is searched. If it is doubtful then, or fits less than half, two kinds of motion are tried that
        odometry has not measured: a slip of the wheels, and a turn on the spot by a person. Such a motion must explain
        the scan better by its own improbability. How well a pose explains a scan includes what older scans say against
        it, see ``occlusion_cost``: a scan with few beams could not outweigh that improbability by its match alone. The
        evidence of consecutive scans adds up, as in a sequential test (Wald 1945): a motion is improbable once, not for
        each scan after it.

        A match is doubtful if older scans contradict it, if it is far from odometry, or if a scan suddenly fits
        nothing although the last one did. Unless both scans contradict each other, or odometry, the area may be
        unknown or hidden by a person, so that a slip must fit well. Turns are tried only if a scan is contradicted or
        fits nothing, and no slip makes it fit well, unless the scan before has shown a turn: a person may still be
        turning the robot. Fewer beams than count as one independent observation decide nothing: a turn that was found
        before them still holds.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        particle : int
            Index of the particle.
        reading : ScanReading
            The scan.
        ask : Request
            Start of the match and pose by odometry.
        long : bool
            Whether the step since the last match was so long that a match may converge to a wrong pose.
        share : float
            Score per beam that is expected without a slip, from 0 to 1.
        conflict : callable
            Returns for a pose the end points that conflict with older scans; see ``occlusion``.
        still : float
            Time in which the wheels were at rest and the robot may have been turned [s].
        rival : Rival, optional
            That of the scan before, moved by odometry.

        Returns
        -------
        row : (13,) float64
            Result row.
        slip : int
            NO_SLIP, SLIP, or LARGE_SLIP for a turn on the spot. If none of them explains a doubtful match:
            UNEXPLAINED if older scans contradict it as clearly as a slip is improbable, otherwise DOUBTFUL.
        rival : Rival or None
            For the next scan.
        """
        row, cost, pull = self._near_odometry(maps, particle, reading, ask, long)
        count = reading.beams.shape[1]
        good, denied = tuning.MATCHING.good_share * count, _denial(conflict, row, count)
        doubtful = denied.share > MOST_CONFLICT or pull >= tuning.MATCHING.certain**2
        is_lost = row[mk.SCORE] < tuning.SLIPS.lost * share * count
        fits = row[mk.SCORE] >= tuning.SLIPS.lost * count
        if count < tuning.MATCHING.dependent:
            return (row, NO_SLIP, rival) if rival is None or rival.surplus <= 0.0 else (rival.row, LARGE_SLIP, rival)
        if fits and not doubtful:
            return row, NO_SLIP, None
        contradiction = occlusion_cost(denied.mutual, count)
        unaided = cost + contradiction
        demanded = denied.mutual > MOST_CONFLICT or pull >= tuning.MATCHING.certain**2
        places = self._slips(ask, tuning.SLIPS.lost if demanded else tuning.MATCHING.good_share, rival)
        found = self._best_rival(maps, particle, reading, ask, places, row, unaided, conflict, rival)
        is_contradicted = (denied.share > MOST_CONFLICT or is_lost) and row[mk.SCORE] < good
        was_turned = rival is not None and rival.motion.turned
        if is_contradicted and still > 0.0 and (found is None or found.row[mk.SCORE] < good or was_turned):
            # the more directions are tried, the more is needed; a scan that fits nothing is improbable enough
            tries = 0.0 if is_lost else math.log(math.pi / np.minimum(WINDOW_MOST, ask.window)[1])
            motion = Motion(True, tuning.MATCHING.good_share, max(MOST_CONFLICT, 0.5 * denied.share), still, tries)
            turned = self._best_rival(maps, particle, reading, ask, _turns(ask, motion), row, unaided,
                                      conflict, rival)
            if turned is not None and (found is None or turned.surplus > found.surplus):
                found = turned
        if found is not None and found.surplus > 0.0:
            return (found.row, LARGE_SLIP, found) if found.motion.turned else (found.row, SLIP, None)
        if is_contradicted and contradiction > tuning.SLIPS.cost:
            return row, UNEXPLAINED, found
        return row, NO_SLIP if found is None and not (doubtful or is_lost) else DOUBTFUL, found

    def _near_odometry(self, maps: TileMaps, particle: int, reading: ScanReading, ask: Request,
                       long: bool) -> Tuple[FloatArray, float, float]:
        """Return the match with the prior of odometry, its cost, and its pull as of ``tracking_kernels.cost_of``.

        Most scans fit at once. After a long step the window of the prior is searched for the others.
        """
        expected, variances = ask.expected, ask.variances
        row, best, pull = self._match(maps, particle, reading, ask.start, expected, variances)
        if not long or row[mk.SCORE] >= tuning.MATCHING.good_share * reading.beams.shape[1]:
            return row, best, pull
        deviations = np.sqrt([variances[:2].max(), variances[2]])
        window = np.minimum(tuning.MATCHING.certain * deviations, WINDOW_MOST)
        if (window > BASIN).any():
            begin = self.search(maps, particle, reading, expected, window, deviations)
            other = self._match(maps, particle, reading, begin, expected, variances)
            if other[1] < best:
                return other
        return row, best, pull

    @staticmethod
    def _slips(ask: Request, least_share: float, before: Optional[Rival]) -> List[Place]:
        """Return where the robot may be after a slip: beside the pose by odometry, or where it already was found."""
        window = np.minimum(WINDOW_MOST, ask.window)
        motion = Motion(False, least_share)
        places = [(ask.expected, window, motion)]
        if np.abs(between(ask.expected, ask.start)).max() > tuning.SLIPS.left[0]:
            places.append((ask.start, window, motion))      # a continuous slip has already moved it
        if before is not None:
            places.append((before.row[:3], window, before.motion))
        return places

    def _best_rival(self, maps: TileMaps, particle: int, reading: ScanReading, ask: Request, places: List[Place],
                    row: FloatArray, unaided: float, conflict: Callable[[FloatArray], Conflict],
                    before: Optional[Rival]) -> Optional[Rival]:
        """Return the match with the greatest surplus of evidence, or None if none is better than ``unaided``.

        A result within the window of the rival of the scan before has its evidence, too.
        """
        count, found = reading.beams.shape[1], None
        for centre, window, motion in places:
            deviations = window / tuning.DRIFT.deviations
            variances = np.square(deviations)[[0, 0, 1]]
            matches = []
            if not motion.turned:
                matches.append(self._match(maps, particle, reading, row[:3], centre, variances, near=True))
            if not matches or matches[0][0][mk.SCORE] < tuning.MATCHING.good_share * count:
                begin = self.search(maps, particle, reading, centre, window, deviations)
                matches.append(self._match(maps, particle, reading, begin, centre, variances))
            for other, cost, _ in matches:
                if cost >= unaided or other[mk.SCORE] < motion.least_share * count:
                    continue
                against = conflict(other[:3]) if motion.turned else _denial(conflict, other, count)
                cost += occlusion_cost(against.mutual, count)
                evidence, earlier, since = max(0.0, unaided - cost), 0.0, np.zeros(3)
                if before is not None and before.motion.turned == motion.turned \
                        and (np.abs(between(before.row[:3], other[:3])) <= window[[0, 0, 1]]).all():
                    earlier, since = before.earlier, before.since
                    evidence = earlier + max(evidence, before.evidence - earlier)
                surplus = evidence - motion.cost(between(ask.expected, other[:3])[2])
                if evidence > 0.0 and against.share <= motion.most_conflict \
                        and (found is None or surplus > found.surplus):
                    found = Rival(other, evidence, surplus, motion, earlier, since)
        return found

    def search(self, maps: TileMaps, particle: int, reading: ScanReading, prediction: FloatArray,
               window: Vector, deviations: Vector) -> FloatArray:
        """Search a window around the prediction for the most probable pose.

        Parameters
        ----------
        maps : TileMaps
            Maps of the particles.
        particle : int
            Index of the particle.
        reading : ScanReading
            The scan.
        prediction : (3,) float64
            Pose predicted by odometry.
        window : (2,) float64
            Half widths [m, rad].
        deviations : (2,) float64
            Standard deviations of the prediction [m, rad]; infinite ones for a window without a prior.

        Returns
        -------
        (3,) float64
        """
        beams = reading.beams
        reach = np.hypot(beams[mk.QX], beams[mk.QY])
        near = reach <= tuning.SEARCH.reach         # farther ones are outside of the field
        if 0 < near.sum() < len(near):
            beams, reach = np.compress(near, beams, axis=1), reach[near]
        turns = _outwards(window[1], SEARCH_STEP / max(float(reach.mean()), 1.0))
        # a prior's cost per beam, as a share of the greatest cost of a beam
        penalty = 0.5 / (reading.beams.shape[1] * tuning.MATCHING.beam_cost)
        turns = np.stack([turns, penalty * np.square(turns / deviations[1])], -1)
        squares = _squares(int(np.ceil(window[0] / SEARCH_STEP)))
        offsets = squares.copy()
        offsets[:, 2] = penalty * squares[:, 2] / deviations[0]**2
        farthest = float(offsets[-1, :2].max())
        half = int((min(float(reach.max()), tuning.SEARCH.reach) + farthest) * maps.frame[2]) + 3
        corner = np.floor((prediction[:2] - maps.frame[:2]) * maps.frame[2]).astype(np.int64) - half
        field = np.empty((2 * half + 1, 2 * half + 1), np.uint8)
        stride = max(1, beams.shape[1] // tuning.MATCHING.search_beams)
        wanted = maps.no_tiles()
        tiles_around(prediction, float(turns[-1, 0]), len(turns) // 2, beams, stride, farthest, maps.frame, wanted)
        draw_field(maps.table[particle], *maps.layout, corner, tuning.MATCHING.wide, wanted, field)
        best = np.empty(4)
        search_window(prediction, offsets, turns, beams, stride, maps.frame[:2] + corner / maps.frame[2],
                      maps.frame[2], field, best)
        return best[:3]


def _turns(ask: Request, motion: Motion) -> List[Place]:
    """Return where the robot may be after a turn on the spot: many rooms look alike after a quarter or half a turn.

    It may have been turned before it drove, or after. The middle between both ends is searched.
    """
    places, driven = [], ask.expected - ask.anchor
    for k in range(1, tuning.SLIPS.sectors):        # 0: a slip
        angle = 2.0 * math.pi * k / tuning.SLIPS.sectors
        first = compose([*ask.anchor[:2], angle], driven)
        places.append((np.append(0.5 * (first[:2] + ask.expected[:2]), ask.expected[2] + angle), TURN_WINDOW, motion))
    return places


def _denial(conflict: Callable[[FloatArray], Conflict], match: FloatArray, count: int) -> Conflict:
    """Return how older scans contradict a match; one with too few partners is in an unknown area, or contradicted."""
    return conflict(match[:3]) if match[mk.SCORE] < tuning.MATCHING.good_share * count else NO_CONFLICT


def occlusion_cost(share: float, count: int) -> float:
    """Return what a conflict by occlusion adds to the negative log-likelihood of a pose.

    It is the log-likelihood ratio of ``share`` against the greatest share at a right pose, for binomial counts:
    ``count`` times their Kullback-Leibler divergence. Neighbouring beams depend on each other as in a match.

    Parameters
    ----------
    share : float
        Mutual conflict, see ``Conflict``.
    count : int
        Beams of the scan.
    """
    if share <= MOST_CONFLICT:
        return 0.0
    kept = (1.0 - share) * math.log((1.0 - share) / (1.0 - MOST_CONFLICT)) if share < 1.0 else 0.0
    return count / tuning.MATCHING.dependent * (share * math.log(share / MOST_CONFLICT) + kept)


def _outwards(half_width: float, step: float) -> FloatArray:
    """Return multiples of ``step`` up to ``half_width``, from 0 outwards."""
    numbers = np.arange(2 * int(np.ceil(half_width / step)) + 1)
    return np.where(numbers % 2, -1, 1) * ((numbers + 1) // 2) * step


@functools.lru_cache(maxsize=16)
def _squares(count: int) -> FloatArray:
    """Return x, y and squared length of the offsets within ``count`` steps, from the centre outwards; read only."""
    steps = _outwards(count * SEARCH_STEP, SEARCH_STEP)
    offsets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    squared = np.square(offsets).sum(axis=1)
    return np.column_stack([offsets, squared])[np.argsort(squared, kind="stable")]

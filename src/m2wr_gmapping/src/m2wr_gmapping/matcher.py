"""Matching scans with particles' maps: the fast matcher."""
import functools
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.correlative_kernels import search_window
from m2wr_gmapping.scan import SLIDE_STRAIGHT
from m2wr_gmapping.se2 import between
from m2wr_gmapping.tile_kernels import draw_field, tiles_around

WIDE, NARROW = 0.05, 0.01       # squared widths of the robust kernel, first and last [m^2]
ROUNDS, PARTICLE_ROUNDS = 8, 6    # searches for partners, for a pose from odometry and for one that is tracked already
SPREAD = 0.05                   # standard deviation of one beam for the information matrix [m]
GOOD_SHARE = 0.8                # share of the beams' best possible score below which a match is doubted
SEARCH_BEAMS = 60               # beams used by the window search
SEARCH_REACH = 12.0             # farther end points take no part in the window search [m]
SEARCH_STEP = 0.08              # step of the window search [m]
SEARCH_PENALTY = 0.06           # taken off a beam's mean score at the edge of the window
DEPENDENT = 10.0                # beams of one scan err together: as if there were that many fewer
WINDOW_DEVIATIONS = 3.0         # half width of the search, in deviations of the odometry
WINDOW_LEAST = np.array([0.1, 0.1])     # a smaller window needs no search: the match converges from there [m, rad]
WINDOW_MOST = np.array([0.8, 0.9])      # a search beyond would take longer than a scan may [m, rad]
PULL = 9.0                      # squared deviations by which a match may move off odometry without being doubted
SLIP_DEVIATIONS = 2.0           # half width of the search after a slip, in deviations of a slip
SLIP_COST = 6.0                 # minus the logarithm of how often odometry slips
MINIMUM_SCORE_CAP = 0.5         # of the beams: a minimumScore above that asks for more than most good matches have


@dataclass(frozen=True)
class Expectation:
    """Where odometry has a scan.

    Attributes
    ----------
    pose : (3,) float64
        In ``map``.
    variances : (3,) float64
        Along the pose's axes [m^2, m^2, rad^2].
    slip_window : (2,) float64
        How far a slip may have led aside [m, rad].
    long : bool
        Whether the step since the last match was so long that a match may be caught beside the right place.
    good_share : float
        Share of the beams' best possible score below which the match is doubted.
    """

    pose: np.ndarray
    variances: np.ndarray
    slip_window: np.ndarray
    long: bool
    good_share: float


class FastMatcher:
    """Gauss-Newton on point-to-line distances, with a window search where that is not enough.

    Parameters
    ----------
    config : GmappingConfig
    workers : Workers
    """

    def __init__(self, config, workers):
        self._workers = workers
        self._settings = np.zeros(mk.MATCH_SETTINGS)
        self._settings[mk.WIDE], self._settings[mk.NARROW] = WIDE, NARROW
        self._settings[mk.ROUNDS], self._settings[mk.SPREAD] = ROUNDS, SPREAD
        self._settings[mk.SIGMA], self._settings[mk.LSIGMA] = config["sigma"], config["lsigma"]
        self._settings[mk.FREE] = SLIDE_STRAIGHT
        self._particle_settings = self._settings.copy()
        self._particle_settings[mk.WIDE], self._particle_settings[mk.ROUNDS] = NARROW, PARTICLE_ROUNDS

    def match(self, maps, reading, starts, predictions, prior, minimum_score):
        """Match one scan in the map of every particle.

        Parameters
        ----------
        maps : TileMaps
        reading : ScanReading
        starts, predictions : (N, 3) float64
            Where the search begins, and what the prior holds it to.
        prior : (3,) float64
            Inverse variances along the prediction's axes.
        minimum_score : float
            A particle whose match scores this or less keeps its prediction.

        Returns
        -------
        (N, 13) float64
            Result rows of ``match_kernels``.
        """
        results = np.empty((len(starts), mk.RESULT_SIZE))
        numbers = np.arange(len(starts))

        def work(first, last):
            mk.match_poses(starts, predictions, first, last, numbers, reading.beams, maps.table, maps.mean, maps.hits,
                           maps.frame, prior, self._particle_settings, results)

        self._workers.run(work, len(starts))
        threshold = min(minimum_score, MINIMUM_SCORE_CAP * reading.beams.shape[1])
        for particle in np.flatnonzero(results[:, mk.SCORE] <= threshold):
            row = results[particle]
            row[:3] = predictions[particle]
            row[mk.INFORMATION:] = 0.0
            mk.rate_pose(row[0], row[1], row[2], reading.beams, maps.table[particle], maps.mean, maps.hits, maps.frame,
                         self._settings, row)
        return results

    def match_one(self, maps, particle, reading, start, prediction, prior):
        """Match in one particle's map; returns its result row (13,)."""
        results = np.empty((1, mk.RESULT_SIZE))
        mk.match_poses(np.array([start]), np.array([prediction]), 0, 1, np.array([particle]), reading.beams, maps.table,
                       maps.mean, maps.hits, maps.frame, prior, self._settings, results)
        return results[0]

    def track(self, maps, particle, reading, start, expectation):
        """Match in one particle's map, and tell whether odometry has slipped.

        The scan is first matched with what odometry says and how far that is to be trusted, searching the window that
        this leaves.  If the match is doubtful, a slip that odometry knows nothing of is tried as well; it must explain
        so much more of the scan as a slip is rare.

        Parameters
        ----------
        start : (3,) float64
            Where the match begins.
        expectation : Expectation

        Returns
        -------
        row : (13,) float64
            Result row.
        slipped : bool
        """
        beams = reading.beams.shape[1]
        expected, variances = expectation.pose, expectation.variances
        row = self.match_one(maps, particle, reading, start, expected, 1.0 / variances)
        best = _cost(row, expected, variances)
        if expectation.long:
            window = np.minimum(WINDOW_DEVIATIONS * np.sqrt([variances[:2].max(), variances[2]]), WINDOW_MOST)
        if expectation.long and (window > WINDOW_LEAST).any():
            found = self.search(maps, particle, reading, expected, window)
            other = self.match_one(maps, particle, reading, found, expected, 1.0 / variances)
            cost = _cost(other, expected, variances)
            if cost < best:
                row, best = other, cost
        if row[mk.SCORE] >= expectation.good_share * beams and _pull(row, expected, variances) < PULL:
            return row, False
        slipped, window = False, np.minimum(WINDOW_MOST, expectation.slip_window)
        wide = np.square(window / SLIP_DEVIATIONS)[[0, 0, 1]]
        for begin in (row[:3], self.search(maps, particle, reading, expected, window)):
            other = self.match_one(maps, particle, reading, begin, expected, 1.0 / wide)
            cost = _cost(other, expected, wide) + SLIP_COST
            if cost < best:
                row, best, slipped = other, cost, True
        return row, slipped

    def search(self, maps, particle, reading, prediction, window):
        """Return the pose (3,) of the best score within a window around the prediction."""
        beams = reading.beams
        reach = np.hypot(beams[mk.QX], beams[mk.QY])
        turns = _outwards(window[1], SEARCH_STEP / max(float(reach.mean()), 1.0))
        turns = np.stack([turns, SEARCH_PENALTY * np.square(turns / window[1])], -1)
        squares = _squares(int(np.ceil(window[0] / SEARCH_STEP)))
        offsets = squares.copy()
        offsets[:, 2] = SEARCH_PENALTY * squares[:, 2] / window[0]**2
        farthest = float(offsets[-1, :2].max())
        half = int((min(float(reach.max()), SEARCH_REACH) + farthest) * maps.frame[2]) + 3
        corner = np.floor((prediction[:2] - maps.frame[:2]) * maps.frame[2]).astype(np.int64) - half
        field = np.empty((2 * half + 1, 2 * half + 1), np.uint8)
        stride = max(1, beams.shape[1] // SEARCH_BEAMS)
        wanted = np.zeros(maps.table.shape[1:], bool)
        tiles_around(prediction, float(turns[-1, 0]), len(turns) // 2, beams, stride, farthest, maps.frame, wanted)
        draw_field(maps.table[particle], maps.mean, maps.hits, maps.frame, corner, WIDE, wanted, field)
        best = np.empty(4)
        search_window(prediction, offsets, turns, beams, stride, maps.frame[:2] + corner / maps.frame[2],
                      maps.frame[2], field, best)
        return best[:3]


def _pull(row, expected, variances):
    """Squared distance of a match from what was expected, in the expectation's deviations."""
    (x, y, turn), (xx, yy, tt) = between(expected, row[:3]).tolist(), variances.tolist()
    return x * x / xx + y * y / yy + turn * turn / tt


def _cost(row, expected, variances):
    """Negative logarithm of the probability of a match, but for a constant."""
    return float(row[mk.COST]) / DEPENDENT + 0.5 * _pull(row, expected, variances)


def _outwards(half_width, step):
    """Return multiples of ``step`` up to ``half_width``, from 0 outwards."""
    numbers = np.arange(2 * int(np.ceil(half_width / step)) + 1)
    return np.where(numbers % 2, -1, 1) * ((numbers + 1) // 2) * step


@functools.lru_cache(maxsize=16)
def _squares(count):
    """Return x, y and squared length of the offsets within ``count`` steps, from the middle outwards; read only."""
    steps = _outwards(count * SEARCH_STEP, SEARCH_STEP)
    offsets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    squared = np.square(offsets).sum(axis=1)
    return np.column_stack([offsets, squared])[np.argsort(squared, kind="stable")]

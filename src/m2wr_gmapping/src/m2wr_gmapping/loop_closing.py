"""Meeting old parts of the map again: finding the place, and bending the trajectory so that both agree."""
import numpy as np

from m2wr_gmapping import correlative_kernels as ck
from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.matcher import DEPENDENT
from m2wr_gmapping.pose_graph import optimise
from m2wr_gmapping.se2 import between, compose, inverse, wrap
from m2wr_gmapping.tile_maps import NEVER, TileMaps

OLD = 12.0                  # a node that many metres of path back is old [m]
SEARCH_EVERY = 1.0          # path between two searches while nothing was found [m]
LINK_EVERY = 2.0            # path between two links in a part that is met again [m]
DRIFT_FLOOR, DRIFT_SHARE, DRIFT_MOST = 0.5, 0.04, 5.0      # half width of the search by path since the last link [m]
TURN_FLOOR, TURN_SHARE, TURN_MOST = 0.1, 0.008, 0.5        # likewise [rad]
RASTER = 0.1                # cell of the search raster [m]
REFERENCE_NODES = 24        # old scans that make the raster
QUERY_PATH, QUERY_POINTS = 3.0, 160     # path whose scans are searched together [m]; points used of them
QUERY_REACH = 12.0          # farther end points take no part: they would make the raster large [m]
RASTER_SCORE = 0.6          # least share of the best possible score
APART_CELLS, APART_TURN = 6, 0.3        # a rival is that far from the best
RIVAL = 0.92                # a rival of that share of the best makes the place ambiguous
FINE_REACH = 5.0            # old nodes that near to the found pose make the map of the fine match [m]
FINE_SHARE, FINE_FOUND = 0.5, 0.6       # least score and partners of the fine match, as shares of the beams
FEWEST_BEAMS = 30
FINE_PRIOR = np.array([0.3, 0.3, 0.15])  # how far the fine match may be from the coarse one [m, m, rad]
SURE = np.array([0.35, 0.35, 0.1])      # a correction up to this needs no second search to confirm it [m, m, rad]
AGREE = np.array([0.25, 0.25, 0.08])    # two corrections of one loop agree within this [m, m, rad]
LINK_FLOOR = np.square([0.02, 0.02, 0.008])     # variance that no link beats [m^2, m^2, rad^2]
STEP_FLOOR = np.square([0.01, 0.01, 0.004])     # nor any step from one node to the next
BEND = np.array([0.04, 0.04, 0.01])     # nodes that move by more are worth a new map [m, m, rad]
OUTLIER = 12.0              # squared residual of a link, in covariances, that halves its weight


def inverse_symmetric(h):
    """Inverse (3, 3) of a symmetric matrix given as xx, xy, xt, yy, yt, tt; calling the library costs more."""
    a, b, c, d, e, f = (float(value) for value in h)
    p, q, r = d * f - e * e, c * e - b * f, b * e - c * d
    by = 1.0 / (a * p + b * q + c * r)
    xy, xt, yt = q * by, r * by, (b * c - a * e) * by
    return np.array([[p * by, xy, xt], [xy, (a * f - c * c) * by, yt], [xt, yt, (a * d - b * b) * by]])


def covariance(information, deviations, floor):
    """Covariance (3, 3) of a match.

    Parameters
    ----------
    information : (6,) float64
        Upper triangle of the scan's information.
    deviations : (3,) float
        Of a prior.
    floor : (3,) float
        Variances added in the end.
    """
    h = np.asarray(information, float) / DEPENDENT
    h[[0, 3, 5]] += 1.0 / np.square(deviations)
    found = inverse_symmetric(h)
    found[[0, 1, 2], [0, 1, 2]] += floor
    return found


def information_of(information, deviations, floor):
    """Inverse (3, 3) of ``covariance``."""
    return inverse_symmetric(covariance(information, deviations, floor)[np.triu_indices(3)])


class LoopCloser:
    """The best particle's path as a graph, with links between nodes far apart in time.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of the fine match [m].
    """

    def __init__(self, matcher, resolution):
        self._matcher, self._resolution = matcher, resolution
        self._steps = []                    # measured pose of each node from the one before, [0] unused
        self._step_information = []
        self._links = []                    # (old node, new node, measured, information)
        self._pending = None
        self._searched_at = self._linked_at = 0.0
        self.searches = self.closures = 0

    @property
    def links(self):
        """Number of links found."""
        return len(self._links)

    def add_step(self, information, deviations):
        """Say how well the newest node is known from the one before (see ``covariance``)."""
        self._step_information.append(information_of(information, deviations, STEP_FLOOR))

    def _remember_steps(self, path):
        for k in range(len(self._steps), len(path)):
            self._steps.append(between(path[k - 1], path[k]) if k else np.zeros(3))

    def look(self, path, readings):
        """Search for the newest node's place among old nodes; return a corrected path (K, 3) or None.

        Parameters
        ----------
        path : (K, 3) float64
            Best particle's poses at all processed scans.
        readings : sequence of K ScanReading
        """
        moved = np.hypot(np.diff(path[:, 0]), np.diff(path[:, 1]))
        along = np.concatenate([[0.0], np.cumsum(moved)])
        here = along[-1]
        if here - self._searched_at < SEARCH_EVERY or here - self._linked_at < LINK_EVERY:
            return None
        drift = here - self._linked_at
        window = min(DRIFT_FLOOR + DRIFT_SHARE * drift, DRIFT_MOST)
        turn = min(TURN_FLOOR + TURN_SHARE * drift, TURN_MOST)
        distance = np.hypot(path[:, 0] - path[-1, 0], path[:, 1] - path[-1, 1])
        old = np.flatnonzero((here - along > OLD) & (distance < window + 2.0))
        if not len(old) or readings[-1].beams.shape[1] < FEWEST_BEAMS:
            return None
        self._searched_at = here
        self.searches += 1
        found = self._find(path, along, readings, old[np.argsort(distance[old], kind="stable")], window, turn)
        if found is None:
            self._pending = None
            return None
        return self._judge(path, here, *found)

    def _find(self, path, along, readings, old, window, turn):
        """Return (old node, pose of the newest node, information) or None."""
        pose = path[-1]
        near = old[:4 * REFERENCE_NODES]
        reference = near[::max(1, len(near) // REFERENCE_NODES)]
        query = self._query(path, along, readings)
        if query.shape[1] < FEWEST_BEAMS:
            return None
        best = _coarse_search(pose, query, path, reference, readings, window, turn)
        if best[3] < RASTER_SCORE or best[4] > RIVAL * best[3]:
            return None
        distance = np.hypot(path[old, 0] - best[0], path[old, 1] - best[1])
        order = np.argsort(distance, kind="stable")
        around = old[order][distance[order] < FINE_REACH][:REFERENCE_NODES]
        if not len(around):
            return None
        maps = TileMaps(1, self._resolution, NEVER)
        for node in around:
            _write(maps, path[node], readings[node])
        row = self._matcher.match_one(maps, 0, readings[-1], best[:3], best[:3], 1.0 / np.square(FINE_PRIOR))
        beams = readings[-1].beams.shape[1]
        if row[mk.SCORE] < FINE_SHARE * beams or row[mk.FOUND] < FINE_FOUND * beams:
            return None
        return int(around[0]), row[:3].copy(), information_of(row[mk.INFORMATION:], FINE_PRIOR, LINK_FLOOR)

    @staticmethod
    def _query(path, along, readings):
        """End points (2, Q) of the newest scans, in the newest node's frame."""
        parts = []
        for node in range(len(path) - 1, -1, -1):
            if along[-1] - along[node] > QUERY_PATH:
                break
            x, y, theta = between(path[-1], path[node])
            c, s = np.cos(theta), np.sin(theta)
            px, py = readings[node].points
            parts.append(np.stack([x + c * px - s * py, y + s * px + c * py]))
        points = np.concatenate(parts, axis=1)
        points = points[:, np.square(points).sum(axis=0) < QUERY_REACH**2]
        return np.ascontiguousarray(points[:, ::max(1, points.shape[1] // QUERY_POINTS)])

    def _judge(self, path, here, node, pose, information):
        """Take a link at once if it changes little, else when a second one agrees; return a corrected path or None."""
        link = (node, len(path) - 1, between(path[node], pose), information)
        change = np.abs(pose - path[-1])
        change[2] = abs(wrap(pose[2] - path[-1, 2]))
        if (change > SURE).any():
            if self._pending is None:
                self._pending = link, compose(pose, inverse(path[-1]))
                return None
            first, correction = self._pending
            expected = compose(correction, path[-1])
            if (np.abs(between(expected, pose)) > AGREE).any():
                self._pending = link, compose(pose, inverse(path[-1]))
                return None
            self._links.append(first)
        self._pending = None
        self._links.append(link)
        self._linked_at = here
        if (change <= BEND).all():
            return None
        return self.solve(path)

    def solve(self, path):
        """Return the path (K, 3) that fits all steps and links best, or None where it hardly moves."""
        if not self._links:
            return None
        self._remember_steps(path)
        count = len(path)
        chain = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
        pairs = np.concatenate([chain, np.array([link[:2] for link in self._links])])
        measured = np.concatenate([np.array(self._steps[1:]), np.array([link[2] for link in self._links])])
        information = np.concatenate([np.array(self._step_information[:count - 1]),
                                      np.array([link[3] for link in self._links])])
        robust = np.arange(len(pairs)) >= count - 1
        bent, self.link_weights = optimise(path, pairs, measured, information, robust, OUTLIER)
        shift = np.abs(bent - path)
        shift[:, 2] = np.abs(wrap(bent[:, 2] - path[:, 2]))
        if (shift <= BEND).all():
            return None
        self.closures += 1
        return bent


def _write(maps, pose, reading):
    """Register a scan in a scratch map."""
    if reading.points.shape[1]:
        reach = float(np.hypot(reading.points[0], reading.points[1]).max())
        maps.cover(pose[:2] - reach, pose[:2] + reach)
        maps.register(0, pose, reading.points)


def _coarse_search(pose, query, path, reference, readings, window, turn):
    """Search the query around ``pose`` in a raster of the reference nodes' end points; ``best`` of the kernel."""
    radius = float(np.hypot(query[0], query[1]).max()) + window + 1.0
    corner = pose[:2] - radius
    cells = int(2.0 * radius / RASTER) + 2
    raster, coarse = np.zeros((cells, cells), np.uint8), np.empty((cells, cells), np.uint8)
    for node in reference:
        ck.stamp_points(path[node], readings[node].points, corner, 1.0 / RASTER, raster)
    ck.block_maximum(raster, coarse)
    typical = max(1.0, float(np.hypot(query[0], query[1]).mean()))
    count = int(np.ceil(turn * typical / RASTER))
    turns = np.arange(-count, count + 1) * (RASTER / typical)
    best = np.empty(5)
    blocks = int(np.ceil(window / RASTER / ck.BLOCK))
    ck.search(pose, query, turns, blocks, corner, 1.0 / RASTER, raster, coarse, APART_CELLS, APART_TURN, RIVAL, best)
    return best

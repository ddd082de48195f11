"""Meeting old parts of the map again: finding the place, and bending the trajectory so that both agree."""
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping import graph_kernels, place_search
from m2wr_gmapping import match_kernels as mk
from m2wr_gmapping.matcher import DEPENDENT
from m2wr_gmapping.pose_graph import optimise
from m2wr_gmapping.se2 import between, compose, inverse, wrap

OLD = 12.0                  # a node that many metres of path back is old [m]
SEARCH_EVERY = 1.0          # path between two searches while nothing was found [m]
LINK_EVERY = 2.0            # path between two links in a part that is met again [m]
WIDE_EVERY, WIDE_AGAIN = 1.0, 0.7       # path between two wide searches, and after one that has found something [m]
SHIFT_FLOOR, TURN_FLOOR = 0.5, 0.1      # least half width of a search [m], [rad]
HEADING_DRIFT = 0.0005      # what a heading drifts that only scans hold, along a way without an end of it [rad/m]
DEVIATIONS = 2.5            # half width of the search, in deviations of the drift
NEAR = 2.0                  # what has drifted by less is searched with the newest scans alone [m]
SHIFT_MOST, TURN_MOST = 30.0, 0.6       # widest search [m], [rad]
BESIDE = 2.0                # an old place is met again that far beside the path [m]
FEWEST_BEAMS = 30
SURE = np.array([0.35, 0.35, 0.1])      # a correction up to this needs no second search to confirm it [m, m, rad]
AGREE = np.array([0.25, 0.25, 0.08])    # two corrections of one loop agree within this [m, m, rad]
WIDE_AGREE = np.array([0.5, 0.5, 0.08])     # likewise, of a loop that a wide search has found
WIDE_SUPPORT, WIDE_FINDS = 2.5, 3       # path [m] along which, and times that wide searches must find the same
CLEAR_SCORE, CLEAR_SUPPORT = 0.8, 1.0   # two finds with such a score need less of it [m]
LITTLE = 6.0                # or where no more than that has drifted [m]
UNHELD = np.array([10.0, 10.0, 1.0])    # deviations where nothing is known [m, m, rad]
WIDE_MEMORY = 12.0          # path after which what was found once is forgotten [m]
HELD_SHARE = 0.085          # a wide find must be held across its best direction by that share of what it is along it
THROUGH_MOST = 0.15         # share of surfaces looked through that a place may have
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


@dataclass(frozen=True)
class _Find:
    """What a wide search has found: place on the way, link, what takes the path there, score, possible drift [m]."""

    along: float
    link: tuple
    correction: np.ndarray
    score: float
    drift: float


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
        self._step_variances = [0.0]        # of the place by the step to each node [m^2]
        self._pending, self._finds = None, []   # a link that waits for a second one; wide finds that agree so far
        self._searched_at = self._linked_at = self._wide_at = 0.0
        self.searches = self.wide_searches = self.closures = 0

    @property
    def links(self):
        """Number of links found."""
        return len(self._links)

    def add_step(self, information, deviations):
        """Say how well the newest node is known from the one before (see ``covariance``)."""
        found = covariance(information, deviations, STEP_FLOOR)
        self._step_information.append(inverse_symmetric(found[np.triu_indices(3)]))
        self._step_variances.append(float(found[0, 0] + found[1, 1]))

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
        close = here - self._searched_at >= SEARCH_EVERY and here - self._linked_at >= LINK_EVERY
        found_last = bool(self._finds) and self._finds[-1].along == self._wide_at
        wide = here - self._wide_at >= (WIDE_AGAIN if found_last else WIDE_EVERY)
        if not (close or wide) or readings[-1].beams.shape[1] < FEWEST_BEAMS:
            return None
        old = np.flatnonzero(here - along > OLD)
        if not len(old):
            return None
        scene = place_search.Scene(path, along, readings, old, *self._drift(path))
        met = old[scene.distance[old] < place_search.BEYOND * scene.shift[old] + BESIDE]
        near, far = met[scene.shift[met] <= NEAR], met[scene.shift[met] > NEAR]
        bends = close and len(near) > 0 and self._look_near(scene, near)
        leads_far = wide and len(far) > 0 and self._look_wide(scene, far)
        return self.solve(path, leads_far) if bends or leads_far else None

    def _drift(self, path):
        """Return how far the newest node may have drifted from each node, (K,) [m] and (K,) [rad]."""
        out = np.empty((len(path), 3))
        links = np.array([link[:2] for link in self._links], np.int64).reshape(-1, 2)
        graph_kernels.drift(path, np.array(self._step_variances), links, out)
        shift = SHIFT_FLOOR + DEVIATIONS * (HEADING_DRIFT * out[:, 0] + np.sqrt(out[:, 1]))
        turn = TURN_FLOOR + DEVIATIONS * HEADING_DRIFT * out[:, 2]
        return np.minimum(shift, SHIFT_MOST), np.minimum(turn, TURN_MOST)

    def _look_near(self, scene, old):
        """Search close to the newest node; return whether a link was found that changes the path."""
        path, here = scene.path, scene.along[-1]
        self._searched_at = here
        self.searches += 1
        pose, ambiguous = place_search.near_search(scene, old)
        found = None if pose is None else place_search.fine_match(self._matcher, self._resolution, scene, old, pose)
        if found is None:
            self._pending = None
            return False
        node, row, _ = found
        pose, link = row[:3], _link(path, node, row, ambiguous)
        change = _change(path, pose)
        if (change > SURE).any():
            if ambiguous:
                return False
            correction = compose(pose, inverse(path[-1]))
            first, self._pending = self._pending, (link, correction)
            if first is None or (np.abs(between(compose(first[1], path[-1]), pose)) > AGREE).any():
                return False
            self._links.append(first[0])
        self._take([link], here)
        return bool((change > BEND).any())

    def _look_wide(self, scene, old):
        """Search wherever the newest node may have drifted from; return whether links were found that change the path.

        A false link is worse than a missing one. What is found must be the only place that fits, no other place may
        look like it, neither scan may look through what the other one saw, the scan must hold it in both directions,
        and later searches must find the same.
        """
        path, here = scene.path, scene.along[-1]
        self._wide_at = here
        self.wide_searches += 1
        pose, score = place_search.wide_search(scene, old)
        found = None if pose is None else place_search.fine_match(self._matcher, self._resolution, scene, old, pose)
        if found is None or place_search.looked_through(scene, *found[1:]) > THROUGH_MOST:
            return False
        node, row, _ = found
        pose, h = row[:3].copy(), row[mk.INFORMATION:]
        weak, strong = np.linalg.eigvalsh([[h[0], h[1]], [h[1], h[3]]])
        slides = weak < HELD_SHARE * strong
        link, change = _link(path, node, row, slides), _change(path, pose)
        if (change <= SURE).all():
            self._take([link], here)
            return bool((change > BEND).any())
        if slides:
            return False
        self._finds = [find for find in self._finds if here - find.along < WIDE_MEMORY]
        drift = float(scene.shift[old].max())
        self._finds.append(_Find(here, link, compose(pose, inverse(path[-1])), score, drift))
        agree = [find for find in self._finds
                 if (np.abs(between(compose(find.correction, path[-1]), pose)) <= WIDE_AGREE).all()]
        support, clear = here - agree[0].along, len(agree)
        if drift > LITTLE:
            clear = sum(find.score > CLEAR_SCORE for find in agree)
        if not ((clear >= 2 and support >= CLEAR_SUPPORT) or (len(agree) >= WIDE_FINDS and support >= WIDE_SUPPORT)):
            return False
        self._take([find.link for find in agree], here)
        return True

    def conclude(self, path):
        """No search follows: believe the newest find, if it is clear and not far off; then ``solve``."""
        moved = float(np.hypot(np.diff(path[:, 0]), np.diff(path[:, 1])).sum())
        last = self._finds[-1] if self._finds else None
        if last is not None and moved - last.along < WIDE_EVERY and last.score > CLEAR_SCORE and last.drift <= LITTLE:
            self._take([last.link], last.along)
            return self.solve(path, True)
        return self.solve(path)

    def _take(self, links, here):
        self._links.extend(links)
        self._pending, self._finds, self._linked_at = None, [], here

    def solve(self, path, opened=False):
        """Return the path (K, 3) that fits all steps and links best, or None where it hardly moves.

        ``opened``: whether there are new links that lead far, see ``pose_graph``.
        """
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
        bent, self.link_weights = optimise(path, pairs, measured, information, robust, OUTLIER, opened)
        shift = np.abs(bent - path)
        shift[:, 2] = np.abs(wrap(bent[:, 2] - path[:, 2]))
        if (shift <= BEND).all():
            return None
        self.closures += 1
        return bent


def _link(path, node, row, slides=False):
    """Old node, newest node, measured pose and information of a match; none along the direction in which it slides."""
    found = covariance(row[mk.INFORMATION:], UNHELD if slides else place_search.FINE_PRIOR, LINK_FLOOR)
    if slides:
        _, axes = np.linalg.eigh(found[:2, :2])
        found[:2, :2] += UNHELD[0]**2 * np.outer(axes[:, 1], axes[:, 1])
    return node, len(path) - 1, between(path[node], row[:3]), inverse_symmetric(found[np.triu_indices(3)])


def _change(path, pose):
    """How far (3,) a pose is from that of the newest node."""
    change = np.abs(pose - path[-1])
    change[2] = abs(wrap(pose[2] - path[-1, 2]))
    return change

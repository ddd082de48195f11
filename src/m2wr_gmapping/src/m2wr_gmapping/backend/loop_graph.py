# SPDX-License-Identifier: BSD-3-Clause
"""The best particle's path as a graph: steps, links between nodes far apart in time, and the path that fits them."""
import numpy as np

from m2wr_gmapping.backend import drift_kernels, place_match, place_search
from m2wr_gmapping.backend.pose_graph import optimise
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.track_layout import BIAS_CHANGES, BIAS_INFORMATION, BIAS_VARIANCE, DEPENDENT, TRACK_ROWS
from m2wr_gmapping.se2 import between, compose, wrap

OLD = 12.0                  # a node that many metres of path back is old [m]
SHIFT_FLOOR, TURN_FLOOR = 0.5, 0.1      # least half width of a search [m], [rad]
HEADING_DRIFT = 0.0005      # what a heading drifts that only scans hold, along a way without an end of it [rad/m]
DEVIATIONS = 2.5            # half width of the search, in deviations of the drift
NEAR = 2.0                  # what has drifted by less is searched with the newest scans alone [m]
SHIFT_MOST, TURN_MOST = 30.0, 0.6       # widest search [m], [rad]
BESIDE = 2.0                # an old place is met again that far beside the path [m]
UNHELD = np.array([10.0, 10.0, 1.0])    # deviations where nothing is known [m, m, rad]
LINK_FLOOR = np.square([0.02, 0.02, 0.008])     # variance that no link beats [m^2, m^2, rad^2]
STEP_FLOOR = np.square([0.01, 0.01, 0.004])     # nor any step from one node to the next
BEND = np.array([0.04, 0.04, 0.01])     # nodes that move by more are worth a new map [m, m, rad]
SURE = np.array([0.35, 0.35, 0.1])      # a correction up to this needs no second search to confirm it [m, m, rad]
AGREE = np.array([0.25, 0.25, 0.08])    # two corrections of one loop agree within this [m, m, rad]
HELD_SHARE = 0.085          # a match must be held across its best direction by that share of what it is along it
OUTLIER = 12.0              # squared residual of a link, in covariances, that halves its weight
REMEMBERED = 10.0           # looked back at, odometry's bias changes so many times less than while it is followed
FIRST_NODES, ACCOUNT_ROWS = 1024, TRACK_ROWS - BIAS_INFORMATION
BY_STEP = "_step_information", "_step_variances", "_accounts", "_leverages"


def covariance(information, deviations, floor):
    """Covariance (3, 3) of a match.

    Parameters
    ----------
    information : (6,) float64
        Upper triangle of the scan's information.
    deviations : (3,) float64
        Of a prior.
    floor : (3,) float64
        Variances added in the end.
    """
    found = np.empty((3, 3))
    drift_kernels.covariance(information, DEPENDENT, deviations, floor, found)
    return found


def inverse_symmetric(matrix):
    """Inverse (3, 3) of a symmetric matrix."""
    found = np.empty((3, 3))
    drift_kernels.inverse(matrix, found)
    return found


def link_of(path, node, row, slides=False):
    """Old node, newest node, measured pose and information of a match; none along the direction in which it slides."""
    found = covariance(row[mk.INFORMATION:], UNHELD if slides else place_match.FINE_PRIOR, LINK_FLOOR)
    if slides:
        _, axes = np.linalg.eigh(found[:2, :2])
        found[:2, :2] += UNHELD[0]**2 * np.outer(axes[:, 1], axes[:, 1])
    return node, len(path) - 1, between(path[node], row[:3]), inverse_symmetric(found)


def held(row):
    """Whether a match is held across its best direction as well."""
    h = row[mk.INFORMATION:]
    weak, strong = np.linalg.eigvalsh([[h[0], h[1]], [h[1], h[3]]])
    return bool(weak >= HELD_SHARE * strong)


def change_of(path, pose):
    """How far (3,) a pose is from that of the newest node."""
    change = np.abs(pose - path[-1])
    change[2] = abs(wrap(pose[2] - path[-1, 2]))
    return change


def distances_along(path):
    """Length (K,) of a path (K, 3) up to each node [m]."""
    along = np.empty(len(path))
    drift_kernels.distances_along(path, along)
    return along


class LoopGraph:
    """Steps and links of a path.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of the fine match [m].

    Attributes
    ----------
    links : list of (old node, newer node, (3,) measured pose of the newer seen from the old, (3, 3) its information)
    searches, closures : int
        Near searches, and times that the path has been bent.
    """

    def __init__(self, matcher, resolution):
        self._matcher, self._resolution = matcher, resolution
        self._steps = []                    # measured pose of each node from the one before, [0] unused
        # of the step to each node, with spare room: information, and variance of the place [m^2]; steps known so far
        self._step_information, self._step_variances = np.zeros((FIRST_NODES, 3, 3)), np.zeros(FIRST_NODES)
        self._accounts, self._leverages = np.zeros((FIRST_NODES, ACCOUNT_ROWS, 3)), np.zeros((FIRST_NODES, 3, 3))
        self._newest = 0
        self._link_nodes = np.zeros((0, 2), np.int64)   # of ``links``, which only become more
        self.links = []
        self.searches = self.closures = 0

    def add_step(self, information, deviations, account):
        """Say how well the newest node is known from the one before.

        Parameters
        ----------
        information : (6,) float64
            See ``covariance``.
        deviations : (3,) float64
            Likewise.
        account : (6, 3) float64
            Bias information of the scan: rows ``BIAS_INFORMATION`` to ``TRAVELLED`` of ``track_layout``.
        """
        self._newest += 1
        if self._newest == len(self._step_variances):
            for name in BY_STEP:
                rows = getattr(self, name)
                setattr(self, name, np.concatenate([rows, np.zeros_like(rows)]))
        self._step_variances[self._newest] = drift_kernels.step_information(
            information, DEPENDENT, deviations, STEP_FLOOR, self._step_information[self._newest])
        self._accounts[self._newest] = account
        drift_kernels.leverage(information, deviations, account[-1], self._leverages[self._newest])

    def change_steps(self, changes):
        """Append ``changes`` (K, 3), in the axes of the pose each step leads to, to the steps that are known so far."""
        if self._steps:
            count = len(self._steps)
            self._steps = list(compose(np.array(self._steps), changes[:count]))

    def scene(self, path, along, readings, node, correction=None):
        """Return the path as it was when ``node`` was the newest one, and which of its old nodes it may have met again.

        Parameters
        ----------
        path : (K, 3) float64
        along : (K,) float64
            Length of the path up to each node [m].
        readings : sequence of K ScanReading
        node : int
        correction : (3,) float64, optional
            Moves, in the map's axes, what is not old.

        Returns
        -------
        scene : Scene
        near, far : (C,) int
            Old nodes from which the node may have drifted by little, and by more.
        """
        count = drift_kernels.old_nodes(along, node, OLD)
        shift, turn = self._drift(path, node)
        if node < len(path) - 1 or correction is not None:
            path, along, readings = path[:node + 1].copy(), along[:node + 1], readings[:node + 1]
            shift, turn = shift[:node + 1], turn[:node + 1]
        if correction is not None:
            path[count:] = compose(correction, path[count:])
        numbers = np.empty((2, count), np.int64)
        near, far = drift_kernels.met(path, shift, count, place_search.BEYOND, BESIDE, NEAR, numbers)
        scene = place_search.Scene(path, along, readings, np.arange(count), shift, turn)
        return scene, numbers[0, :near], numbers[1, :far]

    def _drift(self, path, node):
        """Return how far ``node`` may have drifted from each node, (K,) [m] and (K,) [rad]."""
        out, shift, turn = np.empty((len(path), 3)), np.empty(len(path)), np.empty(len(path))
        if len(self._link_nodes) < len(self.links):
            self._link_nodes = np.array([link[:2] for link in self.links], np.int64)
        drift_kernels.drift(path, self._step_variances[:len(path)], self._link_nodes, node, out)
        drift_kernels.widths(out, DEVIATIONS, HEADING_DRIFT, (SHIFT_FLOOR, SHIFT_MOST), (TURN_FLOOR, TURN_MOST), shift,
                             turn)
        return shift, turn

    def near_link(self, scene, near, reach=0.0):
        """Search close to where the scene's newest node is thought to be.

        Parameters
        ----------
        scene : Scene
        near : (C,) int
            Nodes to look among.
        reach : float
            Path whose scans take part in the fine match [m]; 0: the newest alone.

        Returns
        -------
        link : tuple or None
            As in ``links``.
        pose : (3,) float64
        slides : bool
            Whether other places fit as well, or walls hold the scans of the stretch in one direction only; then nothing
            is known along the other.
        """
        self.searches += 1
        pose, slides = place_search.near_search(scene, near)
        found = None if pose is None else place_match.fine_match(
            self._matcher, self._resolution, scene, near, pose, reach)
        if found is None:
            return None, None, False
        node, row, _, heard = found
        # along a plain wall the scan fits best where old ones saw all of it, and a second search finds the same
        moved = (change_of(scene.path, row[:3])[:2] > place_search.BESIDE).any()
        slides = slides or ((reach > 0.0 or moved) and not held(row))
        row[mk.INFORMATION:] = heard
        return link_of(scene.path, node, row, slides), row[:3].copy(), slides

    def fine_match(self, scene, old, pose, reach):
        """Return ``place_match.fine_match`` with this graph's matcher and cells."""
        return place_match.fine_match(self._matcher, self._resolution, scene, old, pose, reach)

    def _lacking(self, count):
        """Return what the steps to ``count`` nodes lack (count, 3), by all that is known of odometry's bias by now."""
        lacking = np.empty((count, 3))
        drift_kernels.look_back(self._accounts[:count], self._leverages[:count], BIAS_VARIANCE,
                                BIAS_VARIANCE / REMEMBERED * np.array(BIAS_CHANGES), lacking)
        return lacking

    def solve(self, path, opened=False):
        """Return the path (K, 3) that fits all steps and links best, or None where it hardly moves.

        ``opened``: whether there are new links that lead far, see ``pose_graph``.
        """
        if not self.links:
            return None
        for k in range(len(self._steps), len(path)):
            self._steps.append(between(path[k - 1], path[k]) if k else np.zeros(3))
        count = len(path)
        chain = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
        pairs = np.concatenate([chain, np.array([link[:2] for link in self.links])])
        steps = compose(np.array(self._steps[1:]), self._lacking(count)[1:])
        measured = np.concatenate([steps, np.array([link[2] for link in self.links])])
        information = np.concatenate([self._step_information[1:count],
                                      np.array([link[3] for link in self.links])])
        robust = np.arange(len(pairs)) >= count - 1
        bent, _ = optimise(path, pairs, measured, information, robust, OUTLIER, opened)
        shift = np.abs(bent - path)
        shift[:, 2] = np.abs(wrap(bent[:, 2] - path[:, 2]))
        if (shift <= BEND).all():
            return None
        self.closures += 1
        return bent

    # ---- saving

    def compact(self):
        """Return what is stored: arrays without their spare room."""
        return dict({name: getattr(self, name)[:self._newest + 1] for name in BY_STEP}, _steps=self._steps,
                    links=self.links, searches=self.searches, closures=self.closures)

    def restore(self, stored):
        """Take over what ``compact`` returned; raises ValueError where a link does not lead to a newer node."""
        if any(old >= new for old, new, _, _ in stored["links"]):
            raise ValueError("a link that leads from a node to itself or back")
        self.__dict__.update(stored)
        self._newest = len(self._step_variances) - 1
        self._link_nodes = np.zeros((0, 2), np.int64)

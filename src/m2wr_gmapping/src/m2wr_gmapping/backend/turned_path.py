# SPDX-License-Identifier: BSD-3-Clause
"""Search for a turn of the robot that nothing has noticed: it was carried where the place looks alike after a turn.

A corridor looks the same after half a turn, a square room after a quarter. If the robot is turned there while scans
are missing, every later pose is rotated about that place, and places appear a second time, rotated. Only steps without
scans are in doubt on which odometry and laser did not agree, or on which scans are seldom missing, and steps on which
the pose was searched in all directions; and only turns after which the place looks alike. A building with equal wings
looks the same.
"""
from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import List, Optional, Sequence

import numpy as np

from m2wr_gmapping.backend import place_search
from m2wr_gmapping.backend.loop_graph import Link, LoopGraph, is_within
from m2wr_gmapping.backend.place_query import evenly, few_points, query_points
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.backend.step_history import Doubt
from m2wr_gmapping.frontend.occlusion import conflict_with_nearest
from m2wr_gmapping.frontend.scan import ScanReading
from m2wr_gmapping.tuning import DRIFT, LINKS, LOOPS, OCCLUSION, SEARCH, TURNS
from m2wr_maps.se2 import between, compose, inverse, wrap
from m2wr_node.array_types import BoolArray, FloatArray, Uint8Array

RIGHT_ANGLES = math.pi, 0.5 * math.pi, -0.5 * math.pi  # of rooms with right angles that look alike [rad]


@dataclass(frozen=True)
class TurnedFind:
    """A place that the newest scans fit after a turn.

    Attributes
    ----------
    along : float
        Length of the path up to the newest node [m].
    node : int
        First node after the turn.
    link : tuple
        As in ``LoopGraph.links``.
    correction : (3,) float64
        Transform of the poses after the turn, in the axes of the map.
    """

    along: float
    node: int
    link: Link
    correction: FloatArray


class TurnedPath:
    """Searches turns of the path that were not noticed.

    Parameters
    ----------
    graph : LoopGraph
    """

    def __init__(self, graph: LoopGraph) -> None:
        self._graph = graph
        self._finds: List[TurnedFind] = []
        self._searched_at = 0.0

    def search(self, route: Route, doubtful: List[Doubt]) -> Optional[List[TurnedFind]]:
        """Search at the newest node; return the results that agree on a turn, once there are enough.

        Parameters
        ----------
        route : Route
        doubtful : list of Doubt
            Steps on which the robot may have turned. Those that loop closures have settled are removed.

        Returns
        -------
        list of TurnedFind or None
        """
        path, along = route.path, route.along
        here = along[-1]
        follows = bool(self._finds) and self._finds[-1].along == self._searched_at
        if here - self._searched_at < (LOOPS.every if follows else LOOPS.spacing):
            return None
        if not _decidable(doubtful, along):
            return None
        self._remove_settled(path, doubtful)
        doubts = _decidable(doubtful, along)
        if not any(alike.any() for _, alike in doubts):
            return None
        self._searched_at = here
        query = few_points(query_points(route, SEARCH.path))
        if query.shape[1] < SEARCH.fewest:
            return None
        shift, turn = self._graph.drift(path, len(path) - 1)
        found = None
        if self._finds:         # the place of the newest scans after the last turn found is known already
            found = self._verify(query, route, doubts, shift, self._finds[-1].correction)
        if found is None:
            correction = self._coarse(query, route, doubts, shift, turn)
            if correction is not None:
                found = self._verify(query, route, doubts, shift, correction)
        if found is None:
            return None
        self._finds = [find for find in self._finds if here - find.along < TURNS.memory] + [found]
        agreed = [find for find in self._finds if _agrees(find, found, path[-1])]
        if len(agreed) < TURNS.count or here - agreed[0].along < TURNS.support:
            return None
        self._finds = [find for find in self._finds if not _agrees(find, found, path[-1])]
        return agreed

    def _remove_settled(self, path: FloatArray, doubtful: List[Doubt]) -> None:
        """Remove the doubts where enough loop closures connect the path before with that after.

        Only those far from it count: a place that looks alike after a turn is the reason for the doubt.
        """
        (old, new), nodes = self._graph.link_nodes.T, np.array([node for node, _ in doubtful], np.int64)[:, None]
        away = np.hypot(path[new, 0] - path[nodes, 0], path[new, 1] - path[nodes, 1])
        across = (old < nodes) & (nodes <= new) & (away > SEARCH.reach)
        settled = np.count_nonzero(across, axis=1) >= TURNS.count
        doubtful[:] = [doubt for doubt, is_settled in zip(doubtful, settled) if not is_settled]

    def _coarse(self, query: FloatArray, route: Route, doubts: List[Doubt], shift: FloatArray,
                turn: FloatArray) -> Optional[FloatArray]:
        """Return the correction of the place that the newest scans fit best after a turn on the way to a node.

        All right angles at all nodes compete, those too after which the place does not look alike. The window is the
        drift since the turn, ``shift`` [m] and ``turn`` [rad] against all nodes.
        """
        path, nodes = route.path, [node for node, _ in doubts]
        newest = path[-1]
        last, first = nodes[-1], min(node for node, alike in doubts if alike.any())
        # a place is not verified if the scans before the turn explain the newest ones as well
        least = max(SEARCH.least_score, _score_before(query, route, first) / SEARCH.rival)
        if least > 1.0:
            return None
        old = path[:last, :2]
        centre = 0.5 * (old.min(axis=0) + old.max(axis=0))
        turned = np.concatenate([compose([0.0, 0.0, angle], newest - path[nodes])[:, :2] + path[nodes, :2] - centre
                                 for angle in RIGHT_ANGLES])
        reach = DRIFT.room + np.tile(shift[nodes], len(RIGHT_ANGLES))

        def allowed(middles: FloatArray) -> Uint8Array:
            return place_search.near_places(middles, old - centre, DRIFT.room) \
                * place_search.near_places(middles, turned, reach)

        window = float((old.max(axis=0) - centre).max()) + DRIFT.room
        pose = np.append(centre, newest[2])
        raster = place_search.raster_around(pose, query, route, evenly(np.arange(last), SEARCH.nodes[1]), window,
                                            SEARCH.cells[1])
        best = place_search.coarse_search(raster, pose, query, window, min(float(turn[nodes].max()), 0.25 * math.pi),
                                          least, allowed, RIGHT_ANGLES)
        return compose(best[:3], inverse(newest)) if place_search.is_unique(best) else None

    def _verify(self, query: FloatArray, route: Route, doubts: List[Doubt], shift: FloatArray,
                correction: FloatArray) -> Optional[TurnedFind]:
        """Search again with the path after a turn by ``correction``, against the scans before the turn only."""
        path = route.path
        node = turned_node(path, doubts, correction, shift)
        if node is None:
            return None
        turned = replace(route, path=turned_after(path, node, correction))
        scene, near, far = self._graph.scene(turned, len(path) - 1)
        old = np.concatenate([near, far])
        old = old[old < node]
        found = self._graph.wide_link(scene, old) if len(old) else None
        if found is None:
            return None
        closure, place = found
        if closure.slides or _score_before(query, route, node) > SEARCH.rival * place.score:
            return None
        return TurnedFind(float(route.along[-1]), node, closure.link, compose(closure.pose, inverse(path[-1])))


def _decidable(doubtful: List[Doubt], along: FloatArray) -> List[Doubt]:
    """Return the doubts for which the newest scans are from after the turn, and the oldest from before."""
    return [doubt for doubt in doubtful if SEARCH.path < along[doubt[0]] < along[-1] - SEARCH.path]


def _score_before(query: FloatArray, route: Route, node: int) -> float:
    """Return how well the query at its present pose fits the scans before ``node``, from 0 to 1."""
    path = route.path
    distance = np.hypot(path[:node, 0] - path[-1, 0], path[:node, 1] - path[-1, 1])
    reference = evenly(np.flatnonzero(distance < SEARCH.reach + SEARCH.path), SEARCH.nodes[1])
    if not len(reference):
        return 0.0
    return place_search.score_here(query, route, reference)


def looks_alike(path: FloatArray, readings: Sequence[ScanReading], turned: float = 0.0) -> BoolArray:
    """Return after which of RIGHT_ANGLES the newest scan fits the older ones as well as at its present pose, (3,) bool.

    A turn after which it fits worse would have been noticed. A scan with few end points fits after each. If the pose
    was found after a turn, scans have decided already that the robot was turned: a turn back is left out.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    readings : sequence of K ScanReading
        Scans of the path's nodes.
    turned : float
        Turn on the spot after which the pose was found, 0 for none [rad].
    """
    possible = np.array([turned == 0.0 or abs(wrap(angle + turned)) > 0.25 * math.pi for angle in RIGHT_ANGLES])
    route, newest = Route(path, distances_along(path), readings), path[-1]
    query = few_points(readings[len(path) - 1].points)
    around = np.flatnonzero(np.hypot(*(path[:-1] - newest)[:, :2].T) < SEARCH.reach)
    if query.shape[1] < SEARCH.fewest or not len(around):
        return possible
    raster = place_search.raster_around(newest, query, route, evenly(around, SEARCH.nodes[1]), DRIFT.room,
                                        SEARCH.cells[1])
    least = SEARCH.rival * place_search.coarse_search(raster, newest, query, *SEARCH.local)[3]
    scores = [place_search.coarse_search(raster, newest, query, DRIFT.room, DRIFT.least[1], least, None, (angle,))[3]
              for angle in RIGHT_ANGLES]
    return possible & [score >= least for score in scores]


def is_consistent(graph: LoopGraph, route: Route, node: int) -> bool:
    """Return whether the path after a turn nowhere conflicts by occlusion with the scans before it.

    Scans are compared with those that have little drift against them. One that conflicts is searched within this drift
    first: before loops are closed, it is more than the margin of the check.

    Parameters
    ----------
    graph : LoopGraph
    route : Route
        The path with the turn.
    node : int
        First node after the turn.
    """
    path, along, readings = route.path, route.along, route.readings
    shares = []
    for later in np.unique(np.searchsorted(along, np.arange(along[node], along[-1], SEARCH.near_path))):
        scene, near, _ = graph.scene(route, int(later))
        near = near[near < node]
        if not len(near):
            continue
        before = path[near], [readings[k] for k in near]
        found = conflict_with_nearest(path[later], readings[later], *before, LINKS.looks)
        if found.share > OCCLUSION.most_conflict:
            pose = place_search.near_search(scene, near)[0]
            if pose is not None:
                found = conflict_with_nearest(pose, readings[later], *before, LINKS.looks)
        if found.in_view >= SEARCH.fewest:      # of fewer, one person is a large share
            shares.append(found.share)
    count = min(len(shares), int(SEARCH.path / SEARCH.near_path) + 1)
    means = np.convolve(shares, np.full(count, 1.0 / count), "valid") if shares else np.zeros(1)
    return bool(means.max() <= OCCLUSION.most_conflict)


def turned_after(path: FloatArray, node: int, correction: FloatArray) -> FloatArray:
    """Return a path whose poses from ``node`` on are moved.

    Parameters
    ----------
    path : (K, 3) float64
        Poses [m, m, rad], in ``map``.
    node : int
        First node that moves.
    correction : (3,) float64
        Transform of these poses, in the axes of the map.
    """
    turned = path.copy()
    turned[node:] = compose(correction, path[node:])
    return turned


def turned_node(path: FloatArray, doubts: Sequence[Doubt], correction: FloatArray,
                shift: FloatArray) -> Optional[int]:
    """Return the node on the way to which the robot was turned, or None if it was at none then.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    doubts : sequence of Doubt
        Steps on which the robot may have turned.
    correction : (3,) float64
        Transform of the poses after the turn; it does not move the place of the turn.
    shift : (K,) float64
        Drift of the newest node against each node [m].
    """
    turn = right_angle(correction)
    nodes = [node for node, alike in doubts if alike[turn]]
    if not nodes:
        return None
    distance = np.hypot(*(compose(correction, path[nodes]) - path[nodes])[:, :2].T) - shift[nodes]
    best = int(np.argmin(distance))
    return nodes[best] if distance[best] <= DRIFT.room else None


def right_angle(correction: FloatArray) -> int:
    """Return the index of the angle of RIGHT_ANGLES that a correction (3,) of poses is nearest to."""
    return int(np.argmin([abs(wrap(correction[2] - angle)) for angle in RIGHT_ANGLES]))


def _agrees(find: TurnedFind, found: TurnedFind, newest: FloatArray) -> bool:
    apart = between(compose(find.correction, newest), compose(found.correction, newest))
    return find.node == found.node and is_within(apart, DRIFT.least)

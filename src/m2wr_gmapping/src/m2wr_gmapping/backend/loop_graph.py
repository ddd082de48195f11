# SPDX-License-Identifier: BSD-3-Clause
"""Pose graph of the best particle's path: steps, loop closures, and their optimisation."""
from __future__ import annotations

import math
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_gmapping.backend import drift_kernels, place_match, place_search
from m2wr_gmapping.backend.place_check import is_contradicted
from m2wr_gmapping.backend.route import Route
from m2wr_gmapping.backend.step_history import StepHistory
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.frontend.information_kernels import DEPENDENT, fused_covariance, unfold, weak_axis
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.tuning import DRIFT, LINKS, LOOPS, MATCHING, SEARCH
from m2wr_maps.linear_kernels import inverse
from m2wr_maps.pose_graph import optimise
from m2wr_maps.se2 import between, compose, wrap
from m2wr_node.array_types import FloatArray, IndexArray

#: Old node, newer node, (3,) pose of the newer one seen from the old one, its (3, 3) information.
Link = Tuple[int, int, FloatArray, FloatArray]


def link_of(path: FloatArray, node: int, row: FloatArray, slides: bool = False) -> Link:
    """Return the loop closure of a match, without information along a degenerate direction.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    node : int
        Old node.
    row : (13,) float64
        Result row of ``match_kernels``.
    slides : bool
        Whether the match is degenerate.
    """
    prior = np.square(LINKS.unheld if slides else LINKS.prior)
    found = fused_covariance(unfold(row) / DEPENDENT, prior) + np.diag(np.square(LINKS.floor))
    if slides:
        _, axes = np.linalg.eigh(found[:2, :2])
        found[:2, :2] += LINKS.unheld[0]**2 * np.outer(axes[:, 1], axes[:, 1])
    return node, len(path) - 1, between(path[node], row[:3]), inverse(found)


def is_observed(row: FloatArray) -> bool:
    """Return whether a match observes both directions."""
    return weak_axis(row)[3] > 0.0


def change_of(path: FloatArray, pose: FloatArray) -> FloatArray:
    """Return the absolute change of the newest node's pose.

    Parameters
    ----------
    path : (K, 3) float64
        Poses of the best particle at all processed scans [m, m, rad], in ``map``.
    pose : (3,) float64
        New pose of the newest node.

    Returns
    -------
    (3,) float64
    """
    change = np.abs(pose - path[-1])
    change[2] = abs(wrap(pose[2] - path[-1, 2]))
    return change


def is_within(difference: FloatArray, limits: Tuple[float, float]) -> bool:
    """Return whether neither the shift along an axis nor the rotation of a difference of poses is too large.

    Parameters
    ----------
    difference : (3,) float64
        [m, m, rad]
    limits : (float, float)
        Greatest shift [m] and rotation [rad].
    """
    return bool((np.abs(difference) <= (limits[0], limits[0], limits[1])).all())


class Closure(NamedTuple):
    """A loop closure at the newest node of a path.

    Attributes
    ----------
    link : Link
    pose : (3,) float64
        Pose of the newest node that it gives, in ``map``.
    slides : bool
        Whether the match is ambiguous or degenerate. The loop closure then has no information in one direction.
    """

    link: Link
    pose: FloatArray
    slides: bool


def _closure(scene: place_search.Scene, found: place_match.FineMatch, slides: bool) -> Closure:
    """Return the loop closure of a match, with the information that the match supports."""
    node, row, _, supported = found
    pose = row[:3].copy()
    row[mk.INFORMATION:] = supported
    return Closure(link_of(scene.path, node, row, slides), pose, slides)


class LoopGraph:
    """Steps and loop closures of a path.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of the fine match [m].
    history : StepHistory
        The steps.

    Attributes
    ----------
    links : list of Link
    rejected : list of (int, int)
        Older and newer node of links that optimisations contradicted, and of candidates that were not accepted.
    searches, closures : int
        Number of near searches, and of optimisations that moved the path.
    """

    def __init__(self, matcher: FastMatcher, resolution: float, history: StepHistory) -> None:
        self._matcher, self._resolution, self._history = matcher, resolution, history
        self._link_nodes = np.zeros((0, 2), np.int64)   # of ``links``
        self.links: List[Link] = []
        self.rejected: List[Tuple[int, int]] = []
        self.searches = self.closures = 0

    @property
    def link_nodes(self) -> IndexArray:
        """Older and newer node (L, 2) of each of ``links``."""
        known = len(self._link_nodes)
        if known < len(self.links):
            more = np.array([link[:2] for link in self.links[known:]], np.int64)
            self._link_nodes = np.concatenate([self._link_nodes, more])
        return self._link_nodes

    def may_be_near(self, route: Route, node: int, correction: Optional[FloatArray] = None) -> bool:
        """Return whether ``scene`` can find old nodes with little drift; its drift takes time.

        Parameters
        ----------
        route, node, correction
            As for ``scene``.
        """
        old = route.path[:self._old_count(route.along, node), :2]
        at = route.path[node] if correction is None else compose(correction, route.path[node])
        return bool((np.square(old - at[:2]).sum(axis=1) < ((SEARCH.beyond + 1.0) * DRIFT.room)**2).any())

    @staticmethod
    def _old_count(along: FloatArray, node: int) -> int:
        """Return how many nodes are old for a node."""
        return int(np.count_nonzero(along[node] - along[:node] > SEARCH.reach))

    def scene(self, route: Route, node: int,
              correction: Optional[FloatArray] = None) -> Tuple[place_search.Scene, IndexArray, IndexArray]:
        """Return the path as it was when ``node`` was the newest one, and the old nodes that may be close to it.

        Parameters
        ----------
        route : Route
        node : int
            Number of the node.
        correction : (3,) float64 or None
            Moves the nodes that are not old, in the axes of the map.

        Returns
        -------
        scene : Scene
        near, far : (C,) int64
            Old nodes with little drift, and with more drift, against the node.
        """
        path, along, readings = route.path[:node + 1], route.along[:node + 1], route.readings[:node + 1]
        count = self._old_count(along, node)
        shift, turn = (drift[:node + 1] for drift in self.drift(route.path, node))
        if correction is not None:
            path = np.concatenate([path[:count], compose(correction, path[count:])])
        away = np.square(path[:count, :2] - path[-1, :2]).sum(axis=1)
        reached = away < np.square(SEARCH.beyond * shift[:count] + DRIFT.room)
        near = shift[:count] <= DRIFT.room
        scene = place_search.Scene(path, along, readings, count, shift, turn)
        return scene, np.flatnonzero(reached & near), np.flatnonzero(reached & ~near)

    def drift(self, path: FloatArray, node: int) -> Tuple[FloatArray, FloatArray]:
        """Return the greatest drift of ``node`` against each node, (K,) [m] and (K,) [rad].

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle at all processed scans [m, m, rad], in ``map``.
        node : int
        """
        out = np.empty((len(path), 3))
        drift_kernels.drift(path, self._history.variances[:len(path)], DRIFT.heading, self.link_nodes, node, out)
        shift = DRIFT.least[0] + DRIFT.deviations * np.sqrt(out[:, 0] + out[:, 1])
        turn = DRIFT.least[1] + DRIFT.deviations * np.sqrt(out[:, 2])
        return np.minimum(shift, DRIFT.most), np.minimum(turn, math.pi)

    def near_link(self, scene: place_search.Scene, near: IndexArray, reach: float = 0.0) -> Optional[Closure]:
        """Search for a loop closure close to the present pose of the newest node.

        Parameters
        ----------
        scene : Scene
            The path and its drift.
        near : (C,) int64
            Nodes to search.
        reach : float
            Length of the path whose scans are matched together [m]; 0: the newest scan only.

        Returns
        -------
        Closure or None
        """
        self.searches += 1
        pose, slides = place_search.near_search(scene, near)
        found = None if pose is None else place_match.fine_match(
            self._matcher, self._resolution, scene, near, pose, reach)
        if found is None:
            return None
        _, row, around, _ = found
        change = change_of(scene.path, row[:3])
        if not is_within(change, SEARCH.local) and is_contradicted(scene, row[:3], around):
            return None
        # along a plain wall the scan fits best where old scans saw all of the wall, and a second search agrees
        moved = bool((change[:2] > SEARCH.local[0]).any())
        return _closure(scene, found, slides or ((reach > 0.0 or moved) and not is_observed(row)))

    def wide_link(self, scene: place_search.Scene, old: IndexArray) -> Optional[Tuple[Closure, place_search.Place]]:
        """Search for a loop closure within the drift of the newest node.

        Parameters
        ----------
        scene : Scene
            The path and its drift.
        old : (C,) int64
            Nodes to search.

        Returns
        -------
        (Closure, Place) or None
            The loop closure, and where the search before the match found it; None also if scans contradict it.
        """
        place = place_search.wide_search(scene, old)
        found = None if place is None else place_match.fine_match(
            self._matcher, self._resolution, scene, old, place.pose, place.reach)
        if place is None or found is None or is_contradicted(scene, found[1][:3], found[2]):
            return None
        return _closure(scene, found, not is_observed(found[1])), place

    def solve(self, path: FloatArray, opened: bool = False) -> Optional[FloatArray]:
        """Optimise the graph, then remove the loop closures that the others contradict.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle at all processed scans [m, m, rad], in ``map``.
        opened : bool
            Whether there are new loop closures with large corrections; see ``pose_graph``.

        Returns
        -------
        (K, 3) float64 or None
            Optimised path; None if no node moves by more than ``least_change``.
        """
        if not self.links:
            return None
        count = len(path)
        chain = np.stack([np.arange(count - 1), np.arange(1, count)], -1)
        pairs = np.concatenate([chain, self.link_nodes])
        measured = np.concatenate([self._history.corrected(path)[1:], np.array([link[2] for link in self.links])])
        information = np.concatenate([self._history.information[1:count],
                                      np.array([link[3] for link in self.links])])
        robust = np.arange(len(pairs)) >= count - 1
        bent, weights = optimise(path, pairs, measured, information, robust, MATCHING.outlier, opened)
        contradicted = weights[count - 1:] < LOOPS.least_weight
        if contradicted.any():
            self.reject([link for link, wrong in zip(self.links, contradicted) if wrong])
            self.replace_links([link for link, wrong in zip(self.links, contradicted) if not wrong])
        shift = np.abs(bent - path)
        shift[:, 2] = np.abs(wrap(bent[:, 2] - path[:, 2]))
        if is_within(shift.max(axis=0), LOOPS.least_change):
            return None
        self.closures += 1
        return bent

    def reject(self, links: Sequence[Link]) -> None:
        """Remember loop closures that are not used, for pictures of the graph."""
        self.rejected += [link[:2] for link in links if link[:2] not in self.rejected]

    def replace_links(self, links: List[Link]) -> None:
        """Replace all loop closures."""
        self.links = links
        self._link_nodes = np.zeros((0, 2), np.int64)

    # ---- saving

    def compact(self) -> Dict[str, object]:
        """Return the attributes that are stored."""
        return dict(links=self.links, rejected=self.rejected, searches=self.searches, closures=self.closures)

    def restore(self, stored: Dict[str, Any]) -> None:
        """Restore what ``compact`` returned; raises ValueError if a loop closure does not lead to a newer node."""
        if any(old >= new for old, new, _, _ in stored["links"]):
            raise ValueError("a link that leads from a node to itself or back")
        self.__dict__.update(stored)
        self._link_nodes = np.zeros((0, 2), np.int64)

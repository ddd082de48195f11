# SPDX-License-Identifier: BSD-3-Clause
"""Loop closing: search for old places, and the conditions under which a result is accepted."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import List, Optional, Sequence, Tuple

from m2wr_gmapping.backend.loop_extension import LoopExtension
from m2wr_gmapping.backend.loop_graph import Link, LoopGraph, change_of, is_within
from m2wr_gmapping.backend.place_search import Scene
from m2wr_gmapping.backend.route import Route, distances_along
from m2wr_gmapping.backend.step_history import StepHistory, turned_step
from m2wr_gmapping.backend.turned_path import TurnedFind, TurnedPath, is_consistent, right_angle, turned_after
from m2wr_gmapping.frontend.matcher import FastMatcher
from m2wr_gmapping.frontend.scan import ScanReading
from m2wr_gmapping.tuning import DRIFT, LOOPS, SEARCH
from m2wr_maps.se2 import between, compose, inverse
from m2wr_node.array_types import FloatArray, IndexArray

MOST_CONCLUSIONS = 10       # optimisations at the end of a run, should it never come to rest


@dataclass(frozen=True)
class Candidate:
    """Result of a wide search.

    Attributes
    ----------
    along : float
        Length of the path up to the newest node [m].
    link : tuple
        As in ``LoopGraph.links``.
    pose, correction : (3,) float64
        Pose of the newest node, and the correction of the path.
    slides : bool
        Whether the match is degenerate in one direction.
    evidence : float
        Difference from the most similar other place: 0 if that fits as well, 1 if nothing of it fits.
    """

    along: float
    link: Link
    pose: FloatArray
    correction: FloatArray
    slides: bool
    evidence: float


class LoopCloser:
    """Searches loop closures at the newest node, and optimises the path.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of the fine match [m].
    history : StepHistory
        Steps of the path.
    """

    def __init__(self, matcher: FastMatcher, resolution: float, history: StepHistory) -> None:
        self.graph = LoopGraph(matcher, resolution, history)
        self._extension, self._turned = LoopExtension(self.graph), TurnedPath(self.graph)
        self._history = history
        self._pending: Optional[Tuple[Link, FloatArray]] = None     # a loop closure that waits for confirmation
        self._candidates: List[Candidate] = []          # recent results of wide searches
        self._searched_at = self._linked_at = self._wide_at = 0.0
        self.wide_searches = 0

    def recalibrate(self, path: FloatArray) -> Optional[FloatArray]:
        """Optimise the path with the steps by the present calibration.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle at all processed scans [m, m, rad], in ``map``.

        Returns
        -------
        (K, 3) float64 or None
            Optimised path; None if it does not change.
        """
        return self._solve(path, self._extension.has_large_shift)

    def search(self, path: FloatArray, readings: Sequence[ScanReading]) -> Optional[FloatArray]:
        """Search for loop closures at the newest node.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle at all processed scans [m, m, rad], in ``map``.
        readings : sequence of K ScanReading
            Scans of the path's nodes.

        Returns
        -------
        (K, 3) float64 or None
            Corrected path; None if it does not change.
        """
        route = Route(path, distances_along(path), readings)
        here = route.along[-1]
        close = here - self._searched_at >= LOOPS.every and here - self._linked_at >= LOOPS.spacing
        wide = here - self._wide_at >= LOOPS.every
        has_moved = leads_far = False
        if (close or wide) and readings[-1].beams.shape[1] >= SEARCH.fewest:
            scene, near, far = self.graph.scene(route, len(path) - 1)
            has_moved = close and len(near) > 0 and self._search_near(scene, near)
            leads_far = wide and len(far) > 0 and self._search_wide(scene, far)
        if leads_far:
            self._extension.schedule_review(route.along)
        elif not has_moved:
            self._extension.advance(route, LOOPS.searches)
            has_moved, leads_far = self._extension.has_moved, self._extension.has_large_shift
            if self._extension.frontiers:     # the maps are rebuilt once, when all frontiers have ended
                return None
        if has_moved or leads_far:
            return self._solve(path, leads_far)
        turned = self._turned.search(route, self._history.doubtful)
        return self._turn_back(route, turned) if turned else None

    def _turn_back(self, route: Route, found: List[TurnedFind]) -> Optional[FloatArray]:
        """Return the path without a turn that was not noticed; None, and no change, if its scans contradict that.

        A turn that was contradicted once is not tried again: the building has equal wings.
        """
        node, correction = found[-1].node, found[-1].correction
        self._history.corrected(route.path)     # has seen all nodes
        path = turned_after(route.path, node, correction)
        before, links, rejected = self._history.step(node), self.graph.links, list(self.graph.rejected)
        self._history.replace_step(node, turned_step(before[0], correction[2]))
        self.graph.replace_links([link for link in links if link[0] >= node or link[1] < node]
                                 + [find.link for find in found])
        solved = self.graph.solve(path, True)
        path = path if solved is None else solved
        if not is_consistent(self.graph, replace(route, path=path), node):
            self._history.replace_step(node, before)
            self.graph.replace_links(links)
            self.graph.rejected = rejected
            for doubt, alike in self._history.doubtful:
                alike[right_angle(correction)] &= doubt != node
            return None
        self.graph.reject([link for link in links if link[1] >= node > link[0]])
        self._history.doubtful[:] = [doubt for doubt in self._history.doubtful if doubt[0] != node]
        self._pending, self._candidates, self._linked_at = None, [], route.along[-1]
        self._extension = LoopExtension(self.graph)
        self._extension.start_at([find.link for find in found])
        self._extension.schedule_review(route.along)
        return path

    def _search_near(self, scene: Scene, old: IndexArray) -> bool:
        """Search close to the newest node; return whether a loop closure was found that moves the path."""
        path, here = scene.path, scene.along[-1]
        self._searched_at = here
        found = self.graph.near_link(scene, old)
        if found is None:
            self._pending = None
            return False
        links, change = [found.link], change_of(path, found.pose)
        if not is_within(change, SEARCH.local):
            if found.slides:
                return False
            correction = compose(found.pose, inverse(path[-1]))
            first, self._pending = self._pending, (found.link, correction)
            if first is None or not is_within(between(compose(first[1], path[-1]), found.pose), SEARCH.local):
                return False
            links = [first[0], found.link]
        self._accept_links(links, here)
        return not is_within(change, LOOPS.least_change)

    def _search_wide(self, scene: Scene, old: IndexArray) -> bool:
        """Search within the drift of the newest node; return whether loop closures were found that move the path.

        A wrong loop closure is worse than a missing one. The place must be unique, the match must observe both
        directions, and no scan may look through a wall that another one saw, or see its other side. If the place does
        not agree with the path, it is a candidate. Candidates that agree with each other are accepted together once
        they have enough evidence.
        """
        path, here = scene.path, scene.along[-1]
        self._wide_at = here
        found = self._wide_candidate(scene, old)
        if found is None:
            return False
        change = change_of(path, found.pose)
        if is_within(change, SEARCH.local):
            self._accept_links([found.link], here)
            self._candidates = []
            return not is_within(change, LOOPS.least_change)
        if found.slides:
            return False
        self.graph.reject([find.link for find in self._candidates if here - find.along >= SEARCH.reach])
        self._candidates = [find for find in self._candidates if here - find.along < SEARCH.reach] + [found]
        agree = [find for find in self._candidates
                 if is_within(between(compose(find.correction, path[-1]), found.pose), DRIFT.least)]
        if sum(find.evidence for find in agree) < LOOPS.evidence:
            return False
        self._accept_links([find.link for find in agree], here)
        self.graph.reject([find.link for find in self._candidates if not any(find is other for other in agree)])
        self._candidates = []
        return not is_within(change, LOOPS.least_change)

    def _wide_candidate(self, scene: Scene, old: IndexArray) -> Optional[Candidate]:
        """Return the result of a wide search."""
        self.wide_searches += 1
        found = self.graph.wide_link(scene, old)
        if found is None:
            return None
        (link, pose, slides), place = found
        correction = compose(pose, inverse(scene.path[-1]))
        return Candidate(scene.along[-1], link, pose, correction, slides, 1.0 - place.rival)

    def conclude(self, path: FloatArray, readings: Sequence[ScanReading]) -> Optional[FloatArray]:
        """Optimise the path; call after the last scan.

        Parameters
        ----------
        path : (K, 3) float64
            Poses of the best particle at all processed scans [m, m, rad], in ``map``.
        readings : sequence of K ScanReading
            Scans of the path's nodes.

        Returns
        -------
        (K, 3) float64 or None
            As ``search``.
        """
        route = Route(path, distances_along(path), readings)
        opened, moved, result = False, True, None
        for _ in range(MOST_CONCLUSIONS if self.graph.links else 0):
            bent = self._solve(route.path, opened)
            if bent is not None:
                route, result = replace(route, path=bent), bent
            if not moved:
                break
            self._extension.schedule_review(route.along)
            self._extension.advance(route, 2 * len(path))
            opened, moved = self._extension.has_large_shift, self._extension.has_moved
        return result

    def _accept_links(self, links: List[Link], here: float) -> None:
        self.graph.links.extend(links)
        self._extension.start_at(links)
        self._pending, self._linked_at = None, here

    def _solve(self, path: FloatArray, opened: bool) -> Optional[FloatArray]:
        self._extension.mark_solved()
        return self.graph.solve(path, opened)

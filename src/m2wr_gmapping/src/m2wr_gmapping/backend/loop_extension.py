# SPDX-License-Identifier: BSD-3-Clause
"""Extension of accepted loop closures along the path, and search for loop closures at older nodes."""
from __future__ import annotations

from typing import List, Optional, Tuple

import numpy as np

from m2wr_gmapping.backend.loop_graph import Closure, Link, LoopGraph, change_of, is_within
from m2wr_gmapping.backend.route import Route
from m2wr_gmapping.tuning import LOOPS, SEARCH
from m2wr_maps.se2 import between, compose, inverse
from m2wr_node.array_types import FloatArray


class LoopExtension:
    """Searches more loop closures beside accepted ones, and at old nodes that an optimisation has moved together.

    A loop closure is accepted some metres after the robot has returned. The path before it also needs loop closures,
    or its walls stay double. Frontiers start at each loop closure and follow the path in both directions.

    Parameters
    ----------
    graph : LoopGraph

    Attributes
    ----------
    has_moved, has_large_shift : bool
        Whether loop closures were found since the last optimisation that move the path, and that move it far.
    """

    def __init__(self, graph: LoopGraph) -> None:
        self._graph = graph
        # node, direction, path without a loop closure [m], correction by the last one
        self._frontiers: List[Tuple[int, int, float, FloatArray]] = []
        self._review: List[int] = []
        self.has_moved = self.has_large_shift = False

    @property
    def frontiers(self) -> int:
        """Number of active frontiers."""
        return len(self._frontiers)

    def start_at(self, links: List[Link]) -> None:
        """Start frontiers in both directions at the newer node of each new loop closure."""
        self._frontiers += [(link[1], direction, 0.0, np.zeros(3)) for direction in (-1, 1) for link in links]

    def schedule_review(self, along: FloatArray) -> None:
        """Schedule a search at nodes of the whole path, oldest first."""
        self._review = np.unique(np.searchsorted(along, np.arange(0.0, along[-1], 2.0 * LOOPS.spacing))).tolist()[::-1]

    def mark_solved(self) -> None:
        """Tell that the graph was optimised: the path contains the corrections of the frontiers now."""
        self._frontiers = [front[:3] + (np.zeros(3),) for front in self._frontiers]
        self.has_moved = self.has_large_shift = False

    def advance(self, route: Route, most: int) -> None:
        """Search for loop closures, first at the frontiers, then at the scheduled nodes.

        Parameters
        ----------
        route : Route
        most : int
            Greatest number of searches.
        """
        graph = self._graph
        until = graph.searches + most
        while graph.searches < until and (self._frontiers or self._review):
            if self._frontiers:
                self._step(route)
            else:
                self._review_node(route, self._review.pop())

    def _step(self, route: Route) -> None:
        """Move one frontier one step along the path."""
        path, along = route.path, route.along
        node, direction, gap, correction = self._frontiers.pop(0)
        node, gap = node_at_distance(along, node, direction), gap + LOOPS.spacing
        if gap > SEARCH.path or not self._is_searchable(along, node):
            return
        found = self._search(route, node, correction)
        if found is not None and is_within(between(compose(correction, path[node]), found.pose), SEARCH.local):
            self._accept(path, node, found)
            gap -= LOOPS.spacing
            if not found.slides:    # a degenerate match gives no correction along the degenerate direction
                gap, correction = 0.0, compose(found.pose, inverse(path[node]))
        self._frontiers.append((node, direction, gap, correction))

    def _review_node(self, route: Route, node: int) -> None:
        """Search at an old node, which an optimisation may have moved close to other nodes."""
        path, along = route.path, route.along
        found = self._search(route, node) if self._is_searchable(along, node) else None
        if found is None:
            return
        correction = compose(found.pose, inverse(path[node]))
        if not is_within(change_of(path[:node + 1], found.pose), SEARCH.local):
            if found.slides or not any(
                    self._is_confirmed(route, node_at_distance(along, node, direction), correction)
                    for direction in (-1, 1)):
                return
            self.has_large_shift = True
        self._accept(path, node, found)
        self._frontiers += [(node, direction, 0.0, np.zeros(3) if found.slides else correction)
                            for direction in (-1, 1)]

    def _is_confirmed(self, route: Route, node: int, correction: FloatArray) -> bool:
        """Whether a search finds a node where the correction of its neighbour predicts it."""
        if not 0 < node < len(route.along) or not SEARCH.reach < route.along[node]:
            return False
        found = self._search(route, node, correction)
        return (found is not None and not found.slides
                and is_within(between(compose(correction, route.path[node]), found.pose), SEARCH.local))

    def _search(self, route: Route, node: int, correction: Optional[FloatArray] = None) -> Optional[Closure]:
        """Return ``near_link`` at a node; None if there is no near node."""
        if not self._graph.may_be_near(route, node, correction):
            return None
        scene, near, _ = self._graph.scene(route, node, correction)
        return self._graph.near_link(scene, near, SEARCH.near_path) if len(near) else None

    def _accept(self, path: FloatArray, node: int, found: Closure) -> None:
        self._graph.links.append(found.link)
        self.has_moved |= not is_within(change_of(path[:node + 1], found.pose), LOOPS.least_change)

    def _is_searchable(self, along: FloatArray, node: int) -> bool:
        """Whether the node exists, is old enough and has no loop closure close by."""
        if not 0 < node < len(along) or along[node] <= SEARCH.reach:
            return False
        return bool((np.abs(along[self._graph.link_nodes[:, 1]] - along[node]) >= LOOPS.every).all())


def node_at_distance(along: FloatArray, node: int, direction: int) -> int:
    """Return the node that is ``LOOPS.spacing`` metres further along the path.

    Parameters
    ----------
    along : (K,) float64
        Length of the path up to each node [m].
    node : int
    direction : int
        1 forwards, -1 backwards.

    Returns
    -------
    int
        Number of the node; -1 or K beyond the ends of the path.
    """
    wanted = along[node] + direction * LOOPS.spacing
    return int(np.searchsorted(along, wanted) if direction > 0 else np.searchsorted(along, wanted, "right") - 1)

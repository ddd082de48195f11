# SPDX-License-Identifier: BSD-3-Clause
"""What one closure brings together elsewhere: links along the loop it has closed, and at places of long ago."""
import numpy as np

from m2wr_gmapping.backend.loop_graph import AGREE, BEND, OLD, SURE, change_of
from m2wr_gmapping.backend.place_search import NEAR_PATH
from m2wr_gmapping.se2 import between, compose, inverse

APART = 2.0                 # path between two links [m]
LINKED = 1.5                # a node that near to one with a link needs none [m]
GAP = 10.0                  # path without a link after which a front ends [m]
REVIEW_EVERY = 4.0          # path between two places that are looked at again [m]


class LoopGrowth:
    """Fronts that go along what a link has brought together, and places that wait to be looked at again.

    A loop is believed some metres after it was closed, and the stretch before stays double until it is linked too.

    Parameters
    ----------
    graph : LoopGraph

    Attributes
    ----------
    bends, tears : bool
        Whether links were found, since the path was solved last, that move it, and by much.
    """

    def __init__(self, graph):
        self._graph = graph
        self._fronts = []       # (node, direction, path without a link [m], correction that the last link asks for)
        self._review = []
        self.bends = self.tears = False

    @property
    def fronts(self):
        """Number of fronts that still go on."""
        return len(self._fronts)

    def begin_at(self, links):
        """Begin at new links: both ways from the newer node of each."""
        self._fronts += [(link[1], way, 0.0, np.zeros(3)) for way in (-1, 1) for link in links]

    def review(self, along):
        """Let the whole path be looked at again, the oldest part first."""
        self._review = np.unique(np.searchsorted(along, np.arange(0.0, along[-1], REVIEW_EVERY))).tolist()[::-1]

    def solved(self):
        """The path has been bent to all links: corrections that fronts carry are in it now."""
        self._fronts = [front[:3] + (np.zeros(3),) for front in self._fronts]
        self.bends = self.tears = False

    def advance(self, path, along, readings, most):
        """Search, ``most`` times at most, first at the fronts.

        Parameters
        ----------
        path : (K, 3) float64
        along : (K,) float64
            Length of the path up to each node [m].
        readings : sequence of K ScanReading
        most : int
        """
        graph = self._graph
        until = graph.searches + most
        while graph.searches < until and (self._fronts or self._review):
            if self._fronts:
                self._step(path, along, readings)
            else:
                self._look_again(path, along, readings, self._review.pop())

    def _step(self, path, along, readings):
        """Take one front one step further."""
        node, way, gap, correction = self._fronts.pop(0)
        node, gap = further(along, node, way), gap + APART
        if gap > GAP or not self._wants(along, node):
            return
        link, pose, slides = self._search(path, along, readings, node, correction)
        if link is not None and (_off(compose(correction, path[node]), pose) <= SURE).all():
            self._believe(path, node, link, pose)
            # one that slides says nothing about the way along which it does
            gap, correction = (gap - APART, correction) if slides else (0.0, compose(pose, inverse(path[node])))
        self._fronts.append((node, way, gap, correction))

    def _look_again(self, path, along, readings, node):
        """Search at a node of long ago, which a closure elsewhere may have brought close to what it has met."""
        if not self._wants(along, node):
            return
        link, pose, slides = self._search(path, along, readings, node)
        if link is None:
            return
        correction = compose(pose, inverse(path[node]))
        if (change_of(path[:node + 1], pose) > SURE).any():
            if slides or not any(self._agrees(path, along, readings, further(along, node, way), correction)
                                 for way in (-1, 1)):
                return
            self.tears = True
        self._believe(path, node, link, pose)
        self._fronts += [(node, way, 0.0, np.zeros(3) if slides else correction) for way in (-1, 1)]

    def _agrees(self, path, along, readings, node, correction):
        """Whether a node is found where a correction of its neighbour has it."""
        if not OLD < along[min(max(node, 0), len(along) - 1)] or not 0 < node < len(along):
            return False
        link, pose, slides = self._search(path, along, readings, node, correction)
        return link is not None and not slides and (_off(compose(correction, path[node]), pose) <= AGREE).all()

    def _search(self, path, along, readings, node, correction=None):
        """``near_link`` at a node: None for the link where there is nothing near."""
        scene, near, _ = self._graph.scene(path, along, readings, node, correction)
        return self._graph.near_link(scene, near, NEAR_PATH) if len(near) else (None, None, False)

    def _believe(self, path, node, link, pose):
        self._graph.links.append(link)
        self.bends |= bool((change_of(path[:node + 1], pose) > BEND).any())

    def _wants(self, along, node):
        """Whether there is such a node, and it has neither a link nor too short a past."""
        if not 0 < node < len(along) or along[node] <= OLD:
            return False
        return all(abs(along[link[1]] - along[node]) >= LINKED for link in self._graph.links)


def further(along, node, way):
    """Return the node ``APART`` further along the path (``way`` 1) or back (-1); -1 or K: beyond its ends."""
    wanted = along[node] + way * APART
    return int(np.searchsorted(along, wanted) if way > 0 else np.searchsorted(along, wanted, "right") - 1)


def _off(expected, pose):
    """How far (3,) a pose is from the one expected."""
    return np.abs(between(expected, pose))

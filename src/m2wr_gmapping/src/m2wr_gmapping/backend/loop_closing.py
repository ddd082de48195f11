# SPDX-License-Identifier: BSD-3-Clause
"""Meeting old parts of the map again: finding the place, and when to believe that it is the place."""
from dataclasses import dataclass

import numpy as np

from m2wr_gmapping.backend import place_search
from m2wr_gmapping.backend.loop_extension import LoopGrowth
from m2wr_gmapping.backend.loop_graph import AGREE, BEND, SURE, LoopGraph, change_of, distances_along, held, link_of
from m2wr_gmapping.frontend import match_kernels as mk
from m2wr_gmapping.se2 import between, compose, inverse

SEARCH_EVERY = 1.0          # path between two searches while nothing was found [m]
LINK_EVERY = 2.0            # path between two links in a part that is met again [m]
WIDE_EVERY, WIDE_AGAIN = 1.0, 0.7       # path between two wide searches, and after one that has found something [m]
FEWEST_BEAMS = 30
WIDE_AGREE = np.array([0.5, 0.5, 0.08])     # likewise, of a loop that a wide search has found
WIDE_SUPPORT, WIDE_FINDS = 2.5, 3       # path [m] along which, and times that wide searches must find the same
CLEAR_SCORE, CLEAR_SUPPORT = 0.8, 1.0   # two finds with such a score need less of it [m]
ALIKE_SUPPORT, ALIKE_FINDS = 6.0, 5     # what looks like another place as well needs more [m]
LITTLE = 6.0                # or where no more than that has drifted [m]
WIDE_MEMORY = 12.0          # path after which what was found once is forgotten [m]
THROUGH_MOST = 0.15         # share of surfaces looked through that a place may have
GROWN_AT_ONCE = 4           # searches elsewhere than at the newest node, at one scan
CONCLUSIONS = 3             # times that the whole path is looked at again in the end


@dataclass(frozen=True)
class Find:
    """What a wide search has found.

    Attributes
    ----------
    along : float
        Place on the way [m].
    link : tuple
        As in ``LoopGraph.links``.
    pose, correction : (3,) float64
        Where the newest node would be, and what takes the path there.
    slides : bool
        Whether walls hold the scans in one direction only.
    clear : bool
        Whether the scans of a short stretch fit very well here, and nothing looks like it.
    alike : bool
        Whether another place looks like it.
    drift : float
        How far the path may have drifted [m].
    long : bool
        Whether only the scans of a long stretch tell it from others.
    """

    along: float
    link: tuple
    pose: np.ndarray
    correction: np.ndarray
    slides: bool
    clear: bool
    alike: bool
    drift: float
    long: bool


class LoopCloser:
    """Searches at the newest node, and the path bent to what they have found.

    Parameters
    ----------
    matcher : FastMatcher
    resolution : float
        Cell size of the fine match [m].
    """

    def __init__(self, matcher, resolution):
        self.graph = LoopGraph(matcher, resolution)
        self._growth = LoopGrowth(self.graph)
        self._pending, self._finds = None, []   # a link that waits for a second one; wide finds that agree so far
        self._searched_at = self._linked_at = self._wide_at = 0.0
        self.wide_searches = 0

    @property
    def links(self):
        """Number of links found."""
        return len(self.graph.links)

    @property
    def searches(self):
        """Number of searches close to where a node is thought to be."""
        return self.graph.searches

    @property
    def closures(self):
        """Number of times that the path was bent."""
        return self.graph.closures

    def add_step(self, information, deviations, account):
        """Say how well the newest node is known from the one before (see ``LoopGraph.add_step``)."""
        self.graph.add_step(information, deviations, account)

    def changed(self, path, changes):
        """Take in a path (K, 3) whose steps have changed by ``changes`` (K, 3); return one that fits the links too."""
        self.graph.change_steps(changes)
        bent = self._solve(path, self._growth.tears)
        return path if bent is None else bent

    def look(self, path, readings):
        """Search for the newest node's place among old nodes; return a corrected path (K, 3) or None.

        Parameters
        ----------
        path : (K, 3) float64
            Best particle's poses at all processed scans.
        readings : sequence of K ScanReading
        """
        along = distances_along(path)
        here = along[-1]
        close = here - self._searched_at >= SEARCH_EVERY and here - self._linked_at >= LINK_EVERY
        found_last = bool(self._finds) and self._finds[-1].along == self._wide_at
        wide = here - self._wide_at >= (WIDE_AGAIN if found_last else WIDE_EVERY)
        bends = leads_far = False
        if (close or wide) and readings[-1].beams.shape[1] >= FEWEST_BEAMS:
            scene, near, far = self.graph.scene(path, along, readings, len(path) - 1)
            bends = close and len(near) > 0 and self._look_near(scene, near)
            leads_far = wide and len(far) > 0 and self._look_wide(scene, far)
        if leads_far:
            self._growth.review(along)
        elif not bends:
            self._growth.advance(path, along, readings, GROWN_AT_ONCE)
            bends, leads_far = self._growth.bends, self._growth.tears
            if self._growth.fronts:     # until they have come to their ends, maps made anew would not last
                return None
        return self._solve(path, leads_far) if bends or leads_far else None

    def _look_near(self, scene, old):
        """Search close to the newest node; return whether a link was found that changes the path."""
        path, here = scene.path, scene.along[-1]
        self._searched_at = here
        link, pose, slides = self.graph.near_link(scene, old)
        if link is None:
            self._pending = None
            return False
        links, change = [link], change_of(path, pose)
        if (change > SURE).any():
            if slides:
                return False
            correction = compose(pose, inverse(path[-1]))
            first, self._pending = self._pending, (link, correction)
            if first is None or (np.abs(between(compose(first[1], path[-1]), pose)) > AGREE).any():
                return False
            links = [first[0], link]
        self._take(links, here)
        return bool((change > BEND).any())

    def _look_wide(self, scene, old):
        """Search wherever the newest node may have drifted from; return whether links were found that change the path.

        A false link is worse than a missing one. What is found must be the only place that fits, neither scan may look
        through what the other one saw, the scans must hold it in both directions, and later searches must find the
        same.
        """
        path, here = scene.path, scene.along[-1]
        self._wide_at = here
        found = self._wide_find(scene, old)
        if found is None:
            return False
        change = change_of(path, found.pose)
        if (change <= SURE).all() and (found.slides or not found.long):
            self._take([found.link], here)
            self._finds = []
            return bool((change > BEND).any())
        if found.slides:
            return False
        self._finds = [find for find in self._finds if here - find.along < WIDE_MEMORY] + [found]
        agree = [find for find in self._finds
                 if (np.abs(between(compose(find.correction, path[-1]), found.pose)) <= WIDE_AGREE).all()]
        if not _enough(agree):
            return False
        self._take([find.link for find in agree], here)
        self._finds = []
        return bool((change > BEND).any())

    def _wide_find(self, scene, old):
        """Return what a wide search finds (Find), or None."""
        path, here = scene.path, scene.along[-1]
        self.wide_searches += 1
        place = place_search.wide_search(scene, old)
        found = None if place is None else self.graph.fine_match(scene, old, place.pose, place.reach)
        if found is None:
            return None
        node, row, around, heard = found
        if place_search.looked_through(scene, row[:3], around) > THROUGH_MOST:
            return None
        # among places that look alike the robot may be at one that it has not seen before; then nothing speaks against
        # where it is thought to be
        if place.alike and place_search.looked_through(scene, path[-1], around) <= THROUGH_MOST:
            return None
        slides, pose = not held(row), row[:3].copy()
        row[mk.INFORMATION:] = heard
        return Find(here, link_of(path, node, row, slides), pose, compose(pose, inverse(path[-1])), slides,
                    _is_clear(place), place.alike, float(scene.shift[old].max()), _is_long(place))

    def conclude(self, path, readings):
        """No scan follows: believe the newest find, if it is clear and not far off; then bend the path to all there is.

        Parameters and result are those of ``look``.
        """
        along = distances_along(path)
        last = self._finds[-1] if self._finds else None
        opened = (last is not None and along[-1] - last.along < WIDE_EVERY and last.clear
                  and last.drift <= LITTLE)
        if opened:
            self._take([last.link], last.along)
            self._finds = []
        moved, result = True, None
        for _ in range(CONCLUSIONS if self.links else 0):
            bent = self._solve(path, opened)
            if bent is not None:
                path = result = bent
            if not moved:
                break
            self._growth.review(along)
            self._growth.advance(path, along, readings, 2 * len(path))
            opened, moved = self._growth.tears, self._growth.bends
        return result

    def _take(self, links, here):
        self.graph.links.extend(links)
        self._growth.begin_at(links)
        self._pending, self._linked_at = None, here

    def _solve(self, path, opened):
        self._growth.solved()
        return self.graph.solve(path, opened)


def _is_clear(place):
    """Whether a place needs less support: the newest scans alone, not those of long ago, tell it from others."""
    return place.score > CLEAR_SCORE and not place.alike and not _is_long(place)


def _is_long(place):
    return place.reach == place_search.LONG_PATH


def _enough(finds):
    """Whether wide finds that agree, the newest last, are enough to be believed."""
    support = finds[-1].along - finds[0].along
    if any(find.alike for find in finds):
        return len(finds) >= ALIKE_FINDS and support >= ALIKE_SUPPORT
    clear = len(finds) if finds[-1].drift <= LITTLE else sum(find.clear for find in finds)
    return (clear >= 2 and support >= CLEAR_SUPPORT) or (len(finds) >= WIDE_FINDS and support >= WIDE_SUPPORT)

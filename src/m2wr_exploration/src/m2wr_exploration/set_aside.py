# SPDX-License-Identifier: BSD-3-Clause
"""Frontiers that are not tried for now, each with its reason."""
from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, List, Optional, Sequence

import numpy as np

from m2wr_exploration.frontier_kernels import count_unknown
from m2wr_navigation.costmap.cost_layout import NO_INFORMATION

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray, Uint8Array

AROUND = 1.0        # m around a frontier in which the map counts
CHANGED = 0.2       # share of the unknown cells there by which the map has to change


@dataclass(eq=False)
class Entry:
    """One frontier that was set aside.

    Attributes
    ----------
    points : (N, 2) float64
        Its cells when it was set aside [m].
    reason : str
    unknown : float
        Unknown area around it then [m^2].
    until : float
        When it may be tried again [s].
    tries : int
        How often it was set aside.
    """

    points: FloatArray
    reason: str
    unknown: float
    until: float
    tries: int

    @property
    def place(self) -> str:
        """Centre, for a message."""
        return "({:.2f}, {:.2f})".format(*self.points.mean(axis=0))


def _unknown(costmap: Costmap, points: FloatArray) -> float:
    cells = np.ascontiguousarray(costmap.cells(points))
    count = count_unknown(costmap.costs, cells, int(round(AROUND / costmap.resolution)))
    return float(count) * costmap.resolution ** 2


def costs_at(costmap: Costmap, points: FloatArray) -> Uint8Array:
    """Return the costs of the cells of points, of those that are in the map.

    Parameters
    ----------
    costmap : Costmap
    points : (N, 2) float64
        [m]
    """
    cells = costmap.cells(points)
    cells = cells[costmap.inside(cells)]
    return costmap.costs[cells[:, 0], cells[:, 1]]


class SetAside:
    """Remembers frontiers that could not be reached or that did not change.

    A frontier is forgotten here, and may be tried at once, when the map around it has changed. It may be tried again
    after a while, which doubles each time, and not after ``tries``.

    Parameters
    ----------
    radius : float
        A frontier whose centre is this near to one that was set aside is the same [m].
    pause : float
        Time until the second try [s].
    tries : int
        Most tries of a frontier in an area that does not change.
    """

    def __init__(self, radius: float, pause: float, tries: int) -> None:
        self.radius, self.pause, self.tries = radius, pause, tries
        self.entries: List[Entry] = []

    def _near(self, frontier: Frontier) -> List[Entry]:
        return [entry for entry in self.entries
                if np.hypot(*(entry.points.mean(axis=0) - frontier.centre)) <= self.radius]

    def add(self, now: float, costmap: Costmap, frontier: Frontier, reason: str, final: bool = False) -> Entry:
        """Set a frontier aside.

        Parameters
        ----------
        now : float
            [s]
        costmap : Costmap
            Of now.
        frontier : Frontier
        reason : str
        final : bool
            Whether it is tried again only when the map around it has changed.

        Returns
        -------
        Entry
        """
        same = self._near(frontier)
        tries = self.tries if final else 1 + max((entry.tries for entry in same), default=0)
        self.entries = [entry for entry in self.entries if entry not in same]
        made = Entry(frontier.points, reason, _unknown(costmap, frontier.points),
                     now + self.pause * 2.0 ** (tries - 1), tries)
        self.entries.append(made)
        return made

    def take(self, entry: Entry, costmap: Optional[Costmap] = None) -> None:
        """Take an entry of another robot, if no entry here has as many tries.

        Parameters
        ----------
        entry : Entry
            In the frame of the map of this robot.
        costmap : Costmap, optional
            Of this robot: on it the other robot is an obstacle, so what is unknown around the entry differs.
        """
        centre = entry.points.mean(axis=0)
        same = [own for own in self.entries if np.hypot(*(own.points.mean(axis=0) - centre)) <= self.radius]
        if all(own.tries < entry.tries for own in same):
            taken = entry if costmap is None else replace(entry, unknown=_unknown(costmap, entry.points))
            self.entries = [own for own in self.entries if own not in same] + [taken]

    def forget_changed(self, costmap: Costmap, frontiers: Optional[Sequence[Frontier]] = None) -> List[Entry]:
        """Forget the frontiers around which the map has changed; return them.

        Parameters
        ----------
        costmap : Costmap
        frontiers : sequence of Frontier, optional
            Those that can be reached: others that are still unknown stay. None: all can be reached.

        Returns
        -------
        list of Entry
        """
        near = [entry for frontier in frontiers or () for entry in self._near(frontier)]
        shut = [] if frontiers is None else [entry for entry in self.unseen(costmap) if entry not in near]
        changed = [entry for entry in self.entries if entry not in shut and abs(
            _unknown(costmap, entry.points) - entry.unknown) > CHANGED * max(entry.unknown, costmap.resolution ** 2)]
        self.entries = [entry for entry in self.entries if entry not in changed]
        return changed

    def allows(self, now: float, frontier: Frontier) -> bool:
        """Return whether a frontier may be tried now.

        Parameters
        ----------
        now : float
            [s]
        frontier : Frontier
        """
        return all(now >= entry.until and entry.tries < self.tries for entry in self._near(frontier))

    def unseen(self, costmap: Costmap) -> List[Entry]:
        """Return the entries of which most cells are still unknown, whether a way leads there or not.

        Parameters
        ----------
        costmap : Costmap
        """
        return [entry for entry in self.entries if 2 * np.count_nonzero(
            costs_at(costmap, entry.points) != NO_INFORMATION) < len(entry.points)]

    def waits(self, now: float, costmap: Costmap) -> bool:
        """Return whether the time of another try is still to come, as for a door that was closed.

        Parameters
        ----------
        now : float
            [s]
        costmap : Costmap
        """
        return any(now < entry.until and entry.tries < self.tries for entry in self.unseen(costmap))

    def may_later(self, frontier: Frontier) -> bool:
        """Return whether a frontier may be tried at some time, even if the map does not change."""
        return all(entry.tries < self.tries for entry in self._near(frontier))

    def refused(self, now: float) -> FloatArray:
        """Return the centres (N, 2) of the entries that may not be tried now [m].

        Parameters
        ----------
        now : float
            [s]
        """
        return np.array([entry.points.mean(axis=0) for entry in self.entries
                         if now < entry.until or entry.tries >= self.tries]).reshape(-1, 2)

    def reason(self, frontier: Frontier) -> str:
        """Return why a frontier was set aside, or an empty string."""
        return next((entry.reason for entry in self._near(frontier)), "")

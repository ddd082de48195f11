# SPDX-License-Identifier: BSD-3-Clause
"""A guided tour: the robot is led through places that see a known world, and maps it on the way."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, List, Optional, Sequence

import numpy as np

from m2wr_exploration.explorer import DONE, EXPLORING, Decision

if TYPE_CHECKING:
    import numpy.typing as npt

    from m2wr_exploration.explorer import Teammate
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray

HEADINGS = (0.0, 2.0 * math.pi / 3.0, -2.0 * math.pi / 3.0)    # rad: the laser of m2wr sees 180 degrees


class Guide:
    """Gives the goals of a tour one after another; for a drive it stands for an explorer.

    Parameters
    ----------
    places : (N, 2) array_like
        In the frame of the map, in the order in which they are visited [m].
    """

    def __init__(self, places: npt.ArrayLike) -> None:
        self._goals = [np.append(place, heading) for place in np.asarray(places, float) for heading in HEADINGS]
        self._next = 0
        self.state, self.summary = EXPLORING, ""

    def step(self, now: float, costmap: Costmap, pose: FloatArray, result: str = "", text: str = "",
             others: Sequence[Teammate] = (), known: Optional[Costmap] = None) -> Decision:
        """Return the next goal when the last one has ended, however it did.

        Parameters
        ----------
        now, costmap, pose, result, text, others, known : Any
            As for :meth:`m2wr_exploration.explorer.Explorer.step`; only the result and its text count.
        """
        messages: List[str] = ["a place of the tour was left out: " + text] if result == "aborted" else []
        if self._next and not result:
            return Decision(state=self.state)
        if self._next == len(self._goals):
            self.state, self.summary = DONE, "the tour has ended"
            return Decision(messages=tuple(messages), state=DONE)
        self._next += 1
        return Decision(self._goals[self._next - 1], messages=tuple(messages))

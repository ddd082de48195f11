# SPDX-License-Identifier: BSD-3-Clause
"""Bug 0: along the boundary until the way towards the goal is free (Choset 2005, section 2.1).

Not complete: there are reachable goals that it misses. A circuit of an obstacle without leaving it ends the drive, and
so does the third visit of a hit point, for then the drive would repeat for ever.
"""
from __future__ import annotations

import math
from typing import List, Optional, Tuple

from m2wr_navigation.methods.boundary import CLOSED, LEAVE, BoundaryMethod, no_way
from m2wr_navigation.methods.method import UNREACHABLE, Decision, View

REPEATED = 3                # visits of a hit point after which the drive repeats


class Bug0(BoundaryMethod):
    """Bug 0."""

    def restart(self) -> None:
        super().restart()
        self._hits: List[Tuple[float, float]] = []

    def hit(self, view: View) -> None:
        self._hits.append((view.x, view.y))

    def follow(self, view: View, closed: bool) -> Optional[Decision]:
        assert self.circuit is not None
        x, y = self._hits[-1]
        visits = sum(math.hypot(x - one, y - two) < CLOSED for one, two in self._hits)
        if visits >= REPEATED:
            return Decision(0.0, 0.0, UNREACHABLE, "hit the obstacle at ({:.2f}, {:.2f}) {} times: Bug 0 would "
                            "repeat this for ever".format(x, y, visits))
        if self.circuit.length > LEAVE and self.is_goal_free(view, LEAVE):
            return self.leave(view, "the way towards the goal is free")
        return no_way(view, self.circuit) if closed else None

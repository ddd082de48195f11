# SPDX-License-Identifier: BSD-3-Clause
"""Compares the maps of robots in a thread of its own, as that takes a second, and commands are due every 50 ms."""
from __future__ import annotations

import copy
import threading
from typing import TYPE_CHECKING, List, Mapping, Optional, Tuple

if TYPE_CHECKING:
    from m2wr_exploration.team.placing import Placing
    from m2wr_navigation.costmap.costmap import Costmap


class Placer:
    """Works on a copy, so that groups never change while commands are chosen."""

    def __init__(self) -> None:
        self._thread: Optional[threading.Thread] = None
        self._result: Optional[Tuple[Placing, Placing, List[str]]] = None

    @property
    def busy(self) -> bool:
        """Whether a comparison is on the way."""
        return self._thread is not None and self._thread.is_alive()

    def turn(self, placing: Placing, maps: Mapping[int, Costmap]) -> Tuple[Placing, List[str]]:
        """Begin a comparison if none is on the way; return what the last one has found, and what to tell.

        Parameters
        ----------
        placing : Placing
            As it is now; left unchanged. A result for another one, as from before a jump of time, is dropped.
        maps : mapping of int to Costmap
            Newest maps, by robot.

        Returns
        -------
        Placing, list of str
            The given one if there is nothing new.
        """
        if placing.known or self.busy:
            return placing, []
        result, self._result = self._result, None
        now, told = (result[1], result[2]) if result is not None and result[0] is placing else (placing, [])
        self._thread = threading.Thread(target=self._compare, args=(now, dict(maps)), daemon=True)
        self._thread.start()
        return now, told

    def _compare(self, placing: Placing, maps: Mapping[int, Costmap]) -> None:
        made = copy.deepcopy(placing)
        told = made.update(maps)
        self._result = placing, made, told

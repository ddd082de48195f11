# SPDX-License-Identifier: BSD-3-Clause
"""Islands: movable models in contact with one another, directly or through others, and their number of contacts.

The time of the direct solver grows with the cube of that number.  Large islands are solved iteratively, see
:class:`~m2wr_sim.physics.engine.Engine`.
"""
from __future__ import annotations

import logging
import math
from typing import Callable, Dict, List, Set

log = logging.getLogger(__name__)

# Contacts between the movable models of an island.  The solvers take the same time at about 20.  At 64 the direct
# solver takes about 2 ms per step (10 ms if all models stand on the ground).  For 138, 230 and 840 contacts it takes 12
# ms, 49 ms and seconds; the iterative solver takes 0.4, 0.7 and 3 ms.  Ten robots that drive against one another have
# 19 contacts, a robot that runs into a wall of nine bricks has 53.
ITERATIVE_ABOVE = 64
WARNING_PERIOD = 10.0   # s of simulated time between two warnings
_NAMED = 5              # models in a message


class Islands:
    """Finds the largest island of a step with an awake body, and logs a warning about it."""

    def __init__(self) -> None:
        self.largest = 0            # contacts in it
        self._for: Dict[str, str] = {}
        self._contacts: Dict[str, int] = {}
        self._awake: Set[str] = set()
        self._warned = -math.inf        # number of a step

    def clear(self) -> None:
        """Start a new step."""
        if self._for:
            self._for, self._contacts, self._awake = {}, {}, set()
        self.largest = 0

    def join(self, one: str, two: str, count: int, awake: bool) -> None:
        """Join the islands of two models.

        Parameters
        ----------
        one, two : str
            Names of the models.
        count : int
            Number of contacts between them.
        awake : bool
            Whether either of the two links is awake.
        """
        one, two = self.stands_for(one), self.stands_for(two)
        total = self._contacts.get(one, 0) + count
        if one != two:
            self._for[two] = one
            total += self._contacts.pop(two, 0)
            awake = awake or two in self._awake
        self._contacts[one] = total
        if awake:
            self._awake.add(one)
        if one in self._awake and total > self.largest:
            self.largest = total

    def stands_for(self, name: str) -> str:
        """Return the name of the model that represents the island of a model."""
        self._for.setdefault(name, name)
        while self._for[name] != name:
            self._for[name] = self._for[self._for[name]]        # shortens the path for the next call
            name = self._for[name]
        return name

    def members(self) -> List[str]:
        """Return the names of the models in the largest island, sorted."""
        leaders = [name for name, total in self._contacts.items() if total == self.largest and name in self._awake]
        return sorted(name for name in self._for if self.stands_for(name) in leaders[:1])

    def warn(self, step: int, dt: float, names: Callable[[], List[str]], contacts: int, iterations: int) -> None:
        """Log which models are in an island and how it is solved, at most once in :data:`WARNING_PERIOD`.

        Parameters
        ----------
        step : int
        dt : float
            Length of a step [s].
        names : callable
            Returns the names of the models.
        contacts : int
        iterations : int
            Of the iterative solver.
        """
        if abs(step - self._warned) * dt < WARNING_PERIOD:
            return
        self._warned, models = step, names()
        more = " and %d more" % (len(models) - _NAMED) if len(models) > _NAMED else ""
        log.warning("step %d (%g ms each): %d models are in contact at %d points: %s%s. The direct solver is too "
                    "slow for that, so these steps are solved iteratively, with %d iterations. If they were spawned "
                    "into one another, put them apart or delete some", step, 1e3 * dt, len(models), contacts,
                    ", ".join(models[:_NAMED]), more, iterations)

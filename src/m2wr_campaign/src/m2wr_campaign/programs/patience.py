# SPDX-License-Identifier: BSD-3-Clause
"""How long a simulation waits for the commands of a program that is not written for lockstep."""
from __future__ import annotations

from collections import deque
from typing import Deque

ANSWER = 1.0                # s of wall time: so long the simulation waits for a program that answers each scan
OTHERWISE = 0.02            # s of wall time: the same for a program that does not
LAST, MISSED = 20, 1        # a program answers each scan if of the last 20 it has missed at most one


class Patience:
    """Remembers which of the last scans a program has answered.

    A loop with a rate of its own answers many scans, but not all: to wait for each of the others would take most of the
    time of its run.
    """

    def __init__(self) -> None:
        self._answers: Deque[bool] = deque(maxlen=LAST)

    def seconds(self, begun: bool) -> float:
        """Return how long the answer to the next scan is waited for [s of wall time].

        Parameters
        ----------
        begun : bool
            Whether the program has sent any command.
        """
        return ANSWER if begun and self._answers.count(False) <= MISSED else OTHERWISE

    def note(self, answered: bool) -> None:
        """Take note of whether a scan was answered in time.

        Parameters
        ----------
        answered : bool
        """
        self._answers.append(answered)

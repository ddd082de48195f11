# SPDX-License-Identifier: BSD-3-Clause
"""When to warn that a loop is slower than its rate."""
from __future__ import annotations

import math

IN_A_ROW = 5            # cycles that take too long, before a warning: one alone may be the work of another program
PERIOD = 60.0           # s between two warnings


class OverrunMonitor:
    """Counts the cycles of a loop that take longer than its period."""

    def __init__(self) -> None:
        self._count, self._warned = 0, -math.inf

    def is_due(self, now: float, spent: float, period: float) -> bool:
        """Take in a cycle; return whether to warn: not before the fifth long one in a row, and once a minute.

        Parameters
        ----------
        now : float
            When the cycle began [s].
        spent : float
            What it took [s].
        period : float
            What it may take [s].

        Returns
        -------
        bool
        """
        self._count = self._count + 1 if spent > period else 0
        if self._count < IN_A_ROW or 0.0 <= now - self._warned < PERIOD:
            return False
        self._warned = now
        return True

# SPDX-License-Identifier: BSD-3-Clause
"""What lockstep needs of the simulator: its loop, its time and its ports."""
from __future__ import annotations

from typing import Any, Callable, Protocol


class Loop(Protocol):
    """The loop of the simulation's thread."""

    def wait_until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Serve requests until a condition holds.

        Parameters
        ----------
        condition : callable
        seconds : float
            Longest wall time to wait [s].

        Returns
        -------
        bool
            Whether the condition holds.
        """

    def wake(self) -> None:
        """Let :meth:`wait_until` check its condition again; may be called from any thread."""

    def stopping(self) -> bool:
        """Return whether the node is to end."""


class Simulator(Protocol):
    """A simulation that can be advanced."""

    @property
    def now_ns(self) -> int:
        """Simulated time [ns]."""

    def advance(self, until_ns: int) -> int:
        """Advance to the next event, at most to ``until_ns``; return the new time [ns]."""


class Port(Protocol):
    """A topic on which the simulation publishes."""

    def publish(self, message: Any) -> None:
        """Publish a message."""

    def wanted(self) -> bool:
        """Return whether there is a subscriber."""

    def close(self) -> None:
        """Stop publishing."""

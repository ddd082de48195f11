# SPDX-License-Identifier: BSD-3-Clause
"""Progress of a campaign: done, rate, time left, failures; one line that changes, or a line now and then."""
from __future__ import annotations

from typing import IO, Callable

TERMINAL, FILE = 0.5, 10.0      # s between two lines


class CampaignProgress:
    """Says how far a campaign is.

    Parameters
    ----------
    total : int
        Runs.
    done : int
        Runs that were stored before.
    stream : file
    clock : callable
        Returns the time [s].
    """

    def __init__(self, total: int, done: int, stream: IO[str], clock: Callable[[], float]) -> None:
        self._total, self._done, self._before, self._failed = total, done, done, 0
        self._stream, self._clock = stream, clock
        self._begun = self._said = clock()
        self._changing = stream.isatty()

    def add(self, has_failed: bool) -> None:
        """Count a run; say so if the last time is long ago, and at the end.

        Parameters
        ----------
        has_failed : bool
        """
        self._done += 1
        self._failed += int(has_failed)
        now = self._clock()
        if now - self._said >= (TERMINAL if self._changing else FILE) or self._done == self._total:
            self._said = now
            self.say()

    def line(self) -> str:
        """Return the line of now."""
        now = self._done - self._before
        rate = now / max(self._clock() - self._begun, 1e-9)
        left = "" if not now else ", {} left".format(duration((self._total - self._done) / rate))
        return "{} of {} runs, {:.1f} runs/s{}, {} failed".format(self._done, self._total, rate, left, self._failed)

    def say(self) -> None:
        """Write the line of now."""
        if self._changing:
            self._stream.write("\r\x1b[K" + self.line() + ("\n" if self._done == self._total else ""))
        else:
            self._stream.write(self.line() + "\n")
        self._stream.flush()


def duration(seconds: float) -> str:
    """Return a duration [s] to read."""
    if seconds < 90.0:
        return "{:.0f} s".format(seconds)
    if seconds < 5400.0:
        return "{:.0f} min".format(seconds / 60.0)
    return "{:.1f} h".format(seconds / 3600.0)

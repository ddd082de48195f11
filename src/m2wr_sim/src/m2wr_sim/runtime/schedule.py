# SPDX-License-Identifier: BSD-3-Clause
"""Schedules of periodic work, in whole nanoseconds of simulated time, by Gazebo's different rules."""
from __future__ import annotations

from typing import Optional


def period_of(rate_hz: float) -> int:
    """Return the period [ns] of a rate, at most thirty years; 0, which means every step, for a rate of 0 or below."""
    return int(round(min(1e9 / rate_hz, 1e18))) if rate_hz > 0.0 else 0


def misfit(rate_hz: float, step_ns: int) -> Optional[str]:
    """Return a message about the intervals of a rate that does not fit into whole steps.

    Work can be due only at the end of a step, so the intervals alternate between two numbers of steps, as in Gazebo.

    Parameters
    ----------
    rate_hz : float
        [Hz].
    step_ns : int
        Step size [ns].

    Returns
    -------
    str or None
        None if the rate fits.
    """
    period_ns = period_of(rate_hz)
    if not period_ns or period_ns % step_ns == 0:
        return None
    if period_ns < step_ns:
        return "%g Hz is more often than there are steps of %g ms: once a step" % (rate_hz, step_ns * 1e-6)
    steps = period_ns // step_ns
    return ("%g Hz does not fit into steps of %g ms: intervals are %g or %g ms"
            % (rate_hz, step_ns * 1e-6, steps * step_ns * 1e-6, (steps + 1) * step_ns * 1e-6))


def first_step(wanted_ns: int, now_ns: int, step_ns: int) -> int:
    """Return the time of the first step that ends at ``wanted_ns`` or later.

    Steps need not end at multiples of their size, because the size may change.

    Parameters
    ----------
    wanted_ns : int
        [ns].
    now_ns : int
        Time at which a step has ended [ns].
    step_ns : int
        Step size [ns].

    Returns
    -------
    int
        [ns].
    """
    return now_ns - (now_ns - wanted_ns) // step_ns * step_ns


class StrictSchedule:
    """Rule of model plugins: due when *more* than a period has passed; then one period later, without drift.

    At 20 Hz and steps of 1 ms these are 51, 101, 151 ... ms after the start.  A late plugin catches up step by step.
    """

    def __init__(self, rate_hz: float, start_ns: int) -> None:
        self.period_ns = period_of(rate_hz)
        self._last_ns = start_ns

    def next_due(self, now_ns: int, step_ns: int) -> int:
        """Return the time of the first step at which this is due; it may be in the past.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        step_ns : int
            Step size [ns].

        Returns
        -------
        int
            [ns].
        """
        return now_ns - (now_ns - self._last_ns - self.period_ns - 1) // step_ns * step_ns      # as first_step

    def elapsed(self, now_ns: int) -> int:
        """Return the time [ns] since the last call was due; if calls are on time, a period and a step."""
        return now_ns - self._last_ns

    def due(self, now_ns: int) -> bool:
        """Return whether it is due now, and if so count the call."""
        if now_ns - self._last_ns <= self.period_ns:
            return False
        self._last_ns += self.period_ns if self.period_ns else now_ns - self._last_ns
        return True

    def skip(self, now_ns: int) -> None:
        """Skip the calls that were due up to now; later ones do not change."""
        elapsed_ns = now_ns - self._last_ns
        if elapsed_ns > self.period_ns:
            self._last_ns = now_ns - (elapsed_ns % self.period_ns or self.period_ns) if self.period_ns else now_ns

    def restart(self, now_ns: int) -> None:
        """Count from now on, as after a reset."""
        self._last_ns = now_ns


class GapSchedule:
    """Rule of plugins that count each period from their last call, so that delays accumulate.

    Due when at least a period has passed or, if ``strict``, more than a period.  At 20 Hz and steps of 1 ms these are
    50, 100, 150 ms after the start, or 51, 102, 153 ms.
    """

    def __init__(self, rate_hz: float, start_ns: int, strict: bool = False) -> None:
        self.period_ns = period_of(rate_hz)
        self._last_ns, self._strict = start_ns, strict

    def next_due(self, now_ns: int, step_ns: int) -> int:
        """Return the time of the first step at which this is due; it may be in the past.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        step_ns : int
            Step size [ns].

        Returns
        -------
        int
            [ns].
        """
        wanted = max(self._last_ns + self.period_ns + bool(self._strict), self._last_ns + 1)
        return first_step(wanted, now_ns, step_ns)

    def elapsed(self, now_ns: int) -> int:
        """Return the time [ns] since the last call."""
        return now_ns - self._last_ns

    def due(self, now_ns: int) -> bool:
        """Return whether it is due now, and if so start the next period."""
        passed_ns = now_ns - self._last_ns
        if passed_ns <= 0 or passed_ns < self.period_ns or (self._strict and passed_ns == self.period_ns):
            return False
        self._last_ns = now_ns
        return True

    def restart(self, now_ns: int) -> None:
        """Count from now on, as after a reset."""
        self._last_ns = now_ns


class SensorSchedule:
    """Rule of sensors: due when a period has passed; a delay by the step size shortens the next period.

    A sensor that was inactive is due at once, and counts from then.
    """

    def __init__(self, rate_hz: float) -> None:
        self.period_ns = period_of(rate_hz)
        self._last_ns: Optional[int] = None
        self._carry_ns = 0

    def next_due(self, now_ns: int, step_ns: int) -> int:
        """Return the time of the first step after ``now_ns`` at which this is due.

        Parameters
        ----------
        now_ns : int
            Simulated time [ns].
        step_ns : int
            Step size [ns].

        Returns
        -------
        int
            [ns].
        """
        if self._last_ns is None:
            return now_ns + step_ns
        ahead_ns = self._last_ns + self.period_ns - self._carry_ns - now_ns
        return now_ns + (-(-ahead_ns // step_ns) * step_ns if ahead_ns > step_ns else step_ns)     # as first_step

    def due(self, now_ns: int) -> bool:
        """Return whether it is due now, and if so count the call."""
        if self._last_ns is None:
            self._last_ns, self._carry_ns = now_ns, 0
            return True
        late_ns = now_ns - self._last_ns + self._carry_ns - self.period_ns
        if late_ns < 0:
            return False
        self._carry_ns = late_ns if late_ns < self.period_ns else 0
        self._last_ns = now_ns
        return True

    def restart(self) -> None:
        """Start again, for instance when the sensor becomes active or the simulation was reset."""
        self._last_ns, self._carry_ns = None, 0

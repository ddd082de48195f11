# SPDX-License-Identifier: BSD-3-Clause
"""When rate-limited work is due, in whole nanoseconds of simulated time, by Gazebo's different rules."""


def period_of(rate_hz):
    """Return the period [ns] of a rate, thirty years at most; zero or negative rates mean every step and give 0."""
    return int(round(min(1e9 / rate_hz, 1e18))) if rate_hz > 0.0 else 0


def misfit(rate_hz, step_ns):
    """Tell how a rate that does not fit into whole steps is kept; None where it fits.

    Work can be due only when a step ends: the interval is now the one, now the other number of steps, as in Gazebo.
    """
    period_ns = period_of(rate_hz)
    if not period_ns or period_ns % step_ns == 0:
        return None
    if period_ns < step_ns:
        return "%g Hz is more often than there are steps of %g ms: once a step" % (rate_hz, step_ns * 1e-6)
    steps = period_ns // step_ns
    return ("%g Hz does not fit into steps of %g ms: intervals are %g or %g ms"
            % (rate_hz, step_ns * 1e-6, steps * step_ns * 1e-6, (steps + 1) * step_ns * 1e-6))


def first_step(wanted_ns, now_ns, step_ns):
    """Return the time [ns] of the first step that ends at ``wanted_ns`` or later, where one has ended at ``now_ns``.

    Steps need not end at multiples of their size: the size may have changed on the way.
    """
    return now_ns - (now_ns - wanted_ns) // step_ns * step_ns


class StrictSchedule:
    """The rule of model plugins: due when *more* than a period has passed; then one period later, without drift.

    At 20 Hz and 1 ms steps that is 51, 101, 151 ... ms after the start.  A late plugin catches up step by step.
    """

    def __init__(self, rate_hz, start_ns):
        self.period_ns = period_of(rate_hz)
        self._last_ns = start_ns

    def next_due(self, now_ns, step_ns):
        """Return the time [ns] of the first step at which this is due; in the past where nobody asked for long."""
        return now_ns - (now_ns - self._last_ns - self.period_ns - 1) // step_ns * step_ns      # as first_step

    def elapsed(self, now_ns):
        """Return the time [ns] since the last tick was due: a period and a step where ticks are punctual."""
        return now_ns - self._last_ns

    def due(self, now_ns):
        """Tell whether it is due now, and if so count the tick."""
        if now_ns - self._last_ns <= self.period_ns:
            return False
        self._last_ns += self.period_ns if self.period_ns else now_ns - self._last_ns
        return True

    def skip(self, now_ns):
        """Leave out the ticks that were due before now; those to come stay where they are."""
        elapsed_ns = now_ns - self._last_ns
        if elapsed_ns > self.period_ns:
            self._last_ns = now_ns - (elapsed_ns % self.period_ns or self.period_ns) if self.period_ns else now_ns

    def restart(self, now_ns):
        """Count from now on, as after a reset."""
        self._last_ns = now_ns


class GapSchedule:
    """The rule of plugins that count each period from when they last acted, so that lateness adds up.

    Due when at least a period has passed since then or, if ``strict``, when more than that has: at 20 Hz and 1 ms steps
    50, 100, 150 ms after the start, or 51, 102, 153 ms.
    """

    def __init__(self, rate_hz, start_ns, strict=False):
        self.period_ns = period_of(rate_hz)
        self._last_ns, self._strict = start_ns, strict

    def next_due(self, now_ns, step_ns):
        """Return the time [ns] of the first step at which this is due; in the past where nobody asked for long."""
        wanted = max(self._last_ns + self.period_ns + bool(self._strict), self._last_ns + 1)
        return first_step(wanted, now_ns, step_ns)

    def elapsed(self, now_ns):
        """Return the time [ns] since it last acted."""
        return now_ns - self._last_ns

    def due(self, now_ns):
        """Tell whether it is due now, and if so begin the next period."""
        passed_ns = now_ns - self._last_ns
        if passed_ns <= 0 or passed_ns < self.period_ns or (self._strict and passed_ns == self.period_ns):
            return False
        self._last_ns = now_ns
        return True

    def restart(self, now_ns):
        """Count from now on, as after a reset."""
        self._last_ns = now_ns


class SensorSchedule:
    """The rule of sensors: due as soon as a period has passed, carrying over what the step size made it late.

    A sensor that slept is due at once, and starts counting there.
    """

    def __init__(self, rate_hz):
        self.period_ns = period_of(rate_hz)
        self._last_ns = None
        self._carry_ns = 0

    def next_due(self, now_ns, step_ns):
        """Return the time [ns] of the first step after ``now_ns`` at which this is due."""
        if self._last_ns is None:
            return now_ns + step_ns
        ahead_ns = self._last_ns + self.period_ns - self._carry_ns - now_ns
        return now_ns + (-(-ahead_ns // step_ns) * step_ns if ahead_ns > step_ns else step_ns)     # as first_step

    def due(self, now_ns):
        """Tell whether it is due now, and if so count the tick."""
        if self._last_ns is None:
            self._last_ns, self._carry_ns = now_ns, 0
            return True
        late_ns = now_ns - self._last_ns + self._carry_ns - self.period_ns
        if late_ns < 0:
            return False
        self._carry_ns = late_ns if late_ns < self.period_ns else 0
        self._last_ns = now_ns
        return True

    def restart(self):
        """Forget the past, as when the sensor wakes up or time goes back."""
        self._last_ns, self._carry_ns = None, 0

"""Lets the wall clock jump in every Python program that finds this file: an hour ahead, then back, and so on."""
import os
import time

PERIOD = 3.0            # between two jumps [s], monotonic
_clock, _clock_ns = time.time, time.time_ns


def _ahead():
    return 3600 if int(time.monotonic() / PERIOD) % 2 else 0


if "M2WR_TEST_RUN" in os.environ:
    time.time = lambda: _clock() + _ahead()
    time.time_ns = lambda: _clock_ns() + _ahead() * 10**9

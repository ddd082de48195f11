"""Lets the wall clock jump in every Python program that finds this file: an hour ahead, then back, and so on.

Not in roslaunch itself, which takes the time of its nodes' ends by that clock and kills them at a jump.
"""
import os
import sys
import time

PERIOD = 3.0            # between two jumps [s], monotonic
_clock, _clock_ns = time.time, time.time_ns


def _ahead():
    if os.path.basename(getattr(sys, "argv", [""])[0]) == "roslaunch":
        return 0
    return 3600 if int(time.monotonic() / PERIOD) % 2 else 0


if "M2WR_TEST_RUN" in os.environ:
    time.time = lambda: _clock() + _ahead()
    time.time_ns = lambda: _clock_ns() + _ahead() * 10**9

# SPDX-License-Identifier: BSD-3-Clause
"""What is looked at during a soak run: the stamps of topics, and the memory, descriptors and threads of processes."""
import os
import struct
from collections import namedtuple

_PAGE = os.sysconf("SC_PAGE_SIZE")

Sample = namedtuple("Sample", "hours shift age memory descriptors threads")
"""``hours`` [h] and ``age`` in the shift [s] are simulated; ``shift`` number; resident ``memory`` [MB]."""


def look_at(pid):
    """Return memory [MB], descriptors and threads of a process; ProcessLookupError if it has ended."""
    try:
        with open("/proc/%d/statm" % pid) as stream:
            memory = int(stream.read().split()[1]) * _PAGE / 2.0 ** 20
        return memory, len(os.listdir("/proc/%d/fd" % pid)), len(os.listdir("/proc/%d/task" % pid))
    except (FileNotFoundError, IndexError):
        raise ProcessLookupError("process %d has ended" % pid) from None


class Clock:
    """Simulated time over all resets of the simulation.

    Attributes
    ----------
    total : float
        Simulated time [s] of all shifts together.
    now : float
        Present time of the clock [s].
    shift : int
        How often it has gone back to its beginning.
    """

    def __init__(self):
        self.total = self.now = 0.0
        self.shift = 0

    def take(self, data):
        """Process the bytes of a rosgraph_msgs/Clock."""
        secs, nsecs = struct.unpack_from("<II", data)
        now = secs + 1e-9 * nsecs
        if now < self.now:
            self.shift += 1
            self.total += now
        else:
            self.total += now - self.now
        self.now = now


class Stamps:
    """Counts how the stamps of a topic rise, and whether in steps of at most ``longest`` [s].

    Attributes
    ----------
    count, beginnings, repeats, gaps : int
        Messages; stamps below the previous one, as at the beginning of a shift; equal ones; steps that are too long.
    widest : float
        The longest step [s].
    """

    def __init__(self, longest, offset=0):
        self._longest, self._offset = longest, offset
        self._last = None
        self.count = self.beginnings = self.repeats = self.gaps = 0
        self.widest = 0.0

    def forget(self):
        """Forget the previous stamp: the connection is new."""
        self._last = None

    def take(self, data):
        """Process the bytes of a message with a stamp at ``offset``."""
        secs, nsecs = struct.unpack_from("<II", data, self._offset)
        stamp, last = secs + 1e-9 * nsecs, self._last
        self._last = stamp
        self.count += 1
        if last is None:
            return
        if stamp < last:
            self.beginnings += 1
            return
        if stamp == last:
            self.repeats += 1
        self.widest = max(self.widest, stamp - last)
        if stamp - last > self._longest + 1e-6:
            self.gaps += 1

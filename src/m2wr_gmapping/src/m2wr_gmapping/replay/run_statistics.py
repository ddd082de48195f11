# SPDX-License-Identifier: BSD-3-Clause
"""Times and memory of a run, for the statistics file."""
from __future__ import annotations

import resource
import sys
import time
from typing import Any, Dict, List, Tuple

import numpy as np


class Stopwatch:
    """Wall and CPU time of pieces of work, each entered once or several times; the last ones need not end a piece.

    Attributes
    ----------
    wall, cpu : list of float
        Times of the pieces [s].
    """

    _begun: Tuple[float, float]         # wall and CPU time when the context was entered [s]

    def __init__(self) -> None:
        self.wall: List[float] = []
        self.cpu: List[float] = []
        self._pending = self._longest_pending = self._longest = (0.0, 0.0)

    def __enter__(self) -> Stopwatch:
        self._begun = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_: object) -> None:
        wall, cpu = time.perf_counter() - self._begun[0], time.process_time() - self._begun[1]
        self._pending = self._pending[0] + wall, self._pending[1] + cpu
        self._longest_pending = _longer(self._longest_pending, (wall, cpu))

    def piece(self) -> None:
        """End a piece: its time is everything measured since the last one."""
        if self.wall:
            self._longest = _longer(self._longest, self._longest_pending)
        self.wall.append(self._pending[0])
        self.cpu.append(self._pending[1])
        self._pending = self._longest_pending = (0.0, 0.0)

    def summary(self) -> Dict[str, Any]:
        """Return count and, for wall and CPU, the times named below.

        They are the total [s]; mean, median and 95th percentile of the pieces [ms]; the longest time in a piece between
        entering and leaving, of a scan [ms]; and the mean of the first and the last tenth of the pieces [ms]. The very
        first piece, in which files are loaded, is in the total only.
        """
        def of(times: List[float], pending: float, longest: float) -> Dict[str, float]:
            ms = 1e3 * np.array(times[1:] or times or [0.0])
            part = max(1, len(ms) // 10)
            found = dict(mean_ms=ms.mean(), median_ms=np.median(ms), p95_ms=np.percentile(ms, 95), max_ms=1e3 * longest,
                         first_ms=ms[:part].mean(), last_ms=ms[-part:].mean())
            return dict({name: round(float(value), 4) for name, value in found.items()},
                        total_s=round(sum(times) + pending, 6))
        return dict(count=len(self.wall), wall=of(self.wall, self._pending[0], self._longest[0]),
                    cpu=of(self.cpu, self._pending[1], self._longest[1]))


def _longer(one: Tuple[float, float], other: Tuple[float, float]) -> Tuple[float, float]:
    """Return the longer of two wall times and of two CPU times [s]."""
    return max(one[0], other[0]), max(one[1], other[1])


def peak_memory_mib() -> float:
    """Return the peak memory of this process [MiB]."""
    try:            # ru_maxrss, below, includes the process before exec
        with open("/proc/self/status", encoding="ascii") as status:
            return round(next(int(line.split()[1]) for line in status if line.startswith("VmHWM:")) / 1024.0, 1)
    except (OSError, StopIteration):
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        return round(peak / (1024.0 if sys.platform.startswith("linux") else 1024.0 * 1024.0), 1)

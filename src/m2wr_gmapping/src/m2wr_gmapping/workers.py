"""Spreading a kernel over ranges of particles."""
import os
from concurrent.futures import ThreadPoolExecutor

PIECES = 4      # per thread: small enough that nobody waits long for one whose core is busy


class Workers:
    """A fixed number of threads that share particles, 0: one a core; results do not depend on how many there are."""

    def __init__(self, threads):
        self._threads = int(threads) or len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self._threads - 1) if self._threads > 1 else None

    def run(self, work, count):
        """Call ``work(first, last)`` so that the calls together cover 0 to ``count`` - 1; return when all are done."""
        if self._pool is None or count < 2 * self._threads:
            work(0, count)
            return
        pieces = min(self._threads * PIECES, count)
        edges = [count * k // pieces for k in range(pieces + 1)]
        ranges = iter(zip(edges[:-1], edges[1:]))

        def share():
            for first, last in ranges:
                work(first, last)

        waiting = [self._pool.submit(share) for _ in range(self._threads - 1)]
        share()
        for future in waiting:
            future.result()

    def close(self):
        """End the threads."""
        if self._pool is not None:
            self._pool.shutdown()

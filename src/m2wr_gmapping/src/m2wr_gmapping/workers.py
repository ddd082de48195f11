# SPDX-License-Identifier: BSD-3-Clause
"""Spreading a kernel over ranges of particles."""
import os
import queue
import threading

PIECES = 4      # per thread: small enough that nobody waits long for one whose core is busy


class Workers:
    """A fixed number of threads that share particles, 0: one a core; results do not depend on how many there are.

    A piece of work is tenths of a millisecond, so it is handed over by queues alone: a pool of the standard library
    makes an object with a lock for each piece, and costs as much as it saves.
    """

    def __init__(self, threads):
        self._helpers = []
        self._threads = int(threads) or len(os.sched_getaffinity(0))
        self._shares = queue.SimpleQueue()
        self._helpers = [threading.Thread(target=self._help, args=(self._shares,), daemon=True)
                         for _ in range(self._threads - 1)]
        for helper in self._helpers:
            helper.start()

    @staticmethod
    def _help(shares):
        """Do shares of work until there is None, and put what went wrong with each, or None, where its run waits."""
        for share, done in iter(shares.get, None):
            try:
                share()
                done.put(None)
            except BaseException as error:      # raised again where the work was asked for
                done.put(error)

    def run(self, work, count):
        """Call ``work(first, last)`` so that the calls together cover 0 to ``count`` - 1; return when all are done."""
        if not self._helpers or count < 2 * self._threads:
            work(0, count)
            return
        pieces = min(self._threads * PIECES, count)
        edges = [count * k // pieces for k in range(pieces + 1)]
        ranges = iter(zip(edges[:-1], edges[1:]))

        def share():
            for first, last in ranges:
                work(first, last)

        done = queue.SimpleQueue()      # its own: what a run that was interrupted left behind is not taken for this one
        for _ in self._helpers:
            self._shares.put((share, done))
        try:
            share()
        finally:        # nobody writes into these arrays any more when this returns
            errors = [done.get() for _ in range(self._begun(done))]
        for error in errors:
            if error is not None:
                raise error

    def _begun(self, done):
        """Take back the shares that no helper has begun, on a busy machine, and return the number of those begun."""
        begun = len(self._helpers)
        while begun:
            try:
                taken = self._shares.get_nowait()
            except queue.Empty:
                break
            begun -= taken[1] is done
        return begun

    def close(self):
        """End the threads."""
        for _ in self._helpers:
            self._shares.put(None)
        for helper in self._helpers:
            helper.join()
        self._helpers = []

    def __del__(self):
        for _ in self._helpers:             # nobody will ask them for anything any more
            self._shares.put(None)

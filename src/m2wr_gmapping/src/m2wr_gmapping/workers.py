# SPDX-License-Identifier: BSD-3-Clause
"""Threads that run a kernel on ranges of particles."""
import os
import queue
import threading

PIECES = 4      # per thread; small pieces keep the waiting time for a thread on a busy core short


class Workers:
    """A fixed number of threads, 0: one per core. Results do not depend on the number.

    A piece of work takes tenths of a millisecond, so it is passed by queues only. A pool of the standard library
    creates an object with a lock for each piece, which costs as much time as it saves.
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
        """Run shares of work until None arrives; put the exception of each, or None, into the queue of its run."""
        for share, done in iter(shares.get, None):
            try:
                share()
                done.put(None)
            except BaseException as error:      # raised again in the calling thread
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

        done = queue.SimpleQueue()      # one queue per run, so that leftovers of an interrupted run are ignored
        for _ in self._helpers:
            self._shares.put((share, done))
        try:
            share()
        finally:        # no thread writes into the arrays after this returns
            errors = [done.get() for _ in range(self._begun(done))]
        for error in errors:
            if error is not None:
                raise error

    def _begun(self, done):
        """Remove the shares that no helper has started, and return the number of started ones."""
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
        for _ in self._helpers:             # no more work will follow
            self._shares.put(None)

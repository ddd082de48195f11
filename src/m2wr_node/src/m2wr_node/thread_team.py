# SPDX-License-Identifier: BSD-3-Clause
"""Threads that share the items of a computation, such as the particles of a filter."""
from __future__ import annotations

import os
import queue
import threading
from typing import TYPE_CHECKING, Callable, List, Optional, Tuple

if TYPE_CHECKING:                   # Python 3.8 has no queue.SimpleQueue[...]
    Done = queue.SimpleQueue[Optional[BaseException]]       # of one run: the exception of each share, or None
    Shares = queue.SimpleQueue[Optional[Tuple[Callable[[], None], Done]]]       # None ends a thread

PIECES = 4      # per thread; small pieces keep the waiting time for a thread on a busy core short


class ThreadTeam:
    """A fixed number of threads. Results do not depend on the number.

    A piece of work takes tenths of a millisecond, so it is passed by queues only. A pool of the standard library
    creates an object with a lock for each piece, which costs as much time as it saves.

    Parameters
    ----------
    threads : int
        0: one per core.
    """

    def __init__(self, threads: int) -> None:
        self._helpers: List[threading.Thread] = []
        self._threads = int(threads) or len(os.sched_getaffinity(0))
        self._shares: Shares = queue.SimpleQueue()
        self._helpers = [threading.Thread(target=self._help, args=(self._shares,), daemon=True)
                         for _ in range(self._threads - 1)]
        for helper in self._helpers:
            helper.start()

    @staticmethod
    def _help(shares: Shares) -> None:
        """Run shares of work until None arrives; put the exception of each, or None, into the queue of its run."""
        for share, done in iter(shares.get, None):
            try:
                share()
                done.put(None)
            except BaseException as error:      # raised again in the calling thread
                done.put(error)

    def run(self, work: Callable[[int, int], object], count: int) -> None:
        """Distribute work to the threads and return when it is done.

        Parameters
        ----------
        work : callable
            ``work(first, last)`` processes the items ``first`` to ``last`` - 1. The calls cover each item once. An
            exception is raised again here.
        count : int
            Number of items.
        """
        if not self._helpers or count < 2 * self._threads:
            work(0, count)
            return
        pieces = min(self._threads * PIECES, count)
        edges = [count * k // pieces for k in range(pieces + 1)]
        ranges = iter(zip(edges[:-1], edges[1:]))

        def share() -> None:
            for first, last in ranges:
                work(first, last)

        done: Done = queue.SimpleQueue()        # one queue per run, so that leftovers of an interrupted run are ignored
        for _ in self._helpers:
            self._shares.put((share, done))
        try:
            share()
        finally:        # no thread writes into the arrays after this returns
            errors = [done.get() for _ in range(self._begun(done))]
        for error in errors:
            if error is not None:
                raise error

    def _begun(self, done: Done) -> int:
        """Remove the shares that no helper has started, and return the number of started ones."""
        begun = len(self._helpers)
        while begun:
            try:
                taken = self._shares.get_nowait()
            except queue.Empty:
                break
            begun -= taken is not None and taken[1] is done
        return begun

    def close(self) -> None:
        """End the threads."""
        for _ in self._helpers:
            self._shares.put(None)
        for helper in self._helpers:
            helper.join()
        self._helpers = []

    def __del__(self) -> None:
        for _ in self._helpers:             # no more work will follow
            self._shares.put(None)

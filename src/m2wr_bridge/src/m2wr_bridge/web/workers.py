# SPDX-License-Identifier: BSD-3-Clause
"""Threads that do what may wait, and never keep the program from ending."""
from __future__ import annotations

import concurrent.futures
import queue
import threading
from typing import Any, Callable, Tuple

_Task = Tuple["concurrent.futures.Future[Any]", Callable[..., Any], Tuple[Any, ...]]


class Workers(concurrent.futures.Executor):
    """An executor of daemon threads.

    A ThreadPoolExecutor waits for its threads when the program ends; one that asks a master that does not answer would
    keep the node alive.

    Parameters
    ----------
    threads : int
    """

    def __init__(self, threads: int) -> None:
        self._tasks: "queue.SimpleQueue[_Task]" = queue.SimpleQueue()
        for index in range(threads):
            threading.Thread(target=self._work, name="worker_%d" % index, daemon=True).start()

    def submit(self, fn: Callable[..., Any], /, *args: Any,        # type: ignore[override]
               **_: Any) -> "concurrent.futures.Future[Any]":
        """Call a function in one of the threads.

        Parameters
        ----------
        fn : callable
        *args
            Its arguments.

        Returns
        -------
        concurrent.futures.Future
        """
        future: "concurrent.futures.Future[Any]" = concurrent.futures.Future()
        self._tasks.put((future, fn, args))
        return future

    def _work(self) -> None:
        while True:
            future, function, arguments = self._tasks.get()
            if not future.set_running_or_notify_cancel():
                continue
            try:
                future.set_result(function(*arguments))
            except BaseException as error:      # the one who waits gets it
                future.set_exception(error)

# SPDX-License-Identifier: BSD-3-Clause
"""Processes that run tasks: one that dies or takes too long costs only its task, and is replaced.

A task whose worker died is given to another one once more. If that dies too, the task has failed.
"""
from __future__ import annotations

import ctypes
import multiprocessing
import os
import signal
import sys
import tempfile
import time
import traceback
from collections import deque
from contextlib import closing, contextmanager
from multiprocessing.connection import wait
from typing import TYPE_CHECKING, Any, Callable, Dict, Generic, Iterator, List, TypeVar

if TYPE_CHECKING:
    from multiprocessing.connection import Connection
    from multiprocessing.process import BaseProcess
    from typing import Deque, Generator, Sequence, Tuple

LOOK = 1.0                  # s of wall time between two looks at the tasks
DEATHS = 2                  # of workers, after which a task is not tried again
LOG_TAIL = 8000             # bytes
_SET_DEATH_SIGNAL = 1       # of prctl(2)
_FORK = multiprocessing.get_context("fork")

Task = TypeVar("Task")
#: From a task, why its worker could not end it, what the worker wrote, and the wall time [s].
Lost = Callable[[Any, str, str, float], Dict[str, Any]]


def processor_wait(pid: int) -> float:
    """Return how long the main thread of a process has been ready to run without a processor [s].

    Parameters
    ----------
    pid : int

    Returns
    -------
    float
        0 where the kernel does not tell.
    """
    try:
        with open("/proc/{}/schedstat".format(pid), encoding="ascii") as file:
            return 1e-9 * int(file.read().split()[1])       # time on a run queue [ns], see proc(5)
    except (OSError, ValueError, IndexError):
        return 0.0


class _Worker(Generic[Task]):
    """One process, and the task that it has."""

    def __init__(self, perform: Callable[[Task], Dict[str, Any]], others: Sequence[Connection]) -> None:
        self.log = tempfile.TemporaryFile()
        self.pipe, far = _FORK.Pipe()
        self.process: BaseProcess = _FORK.Process(
            target=_serve, args=(perform, far, self.log.fileno(), [self.pipe, *others], os.getpid()), daemon=True)
        self.process.start()
        far.close()
        self.task: List[Task] = []          # none or one
        self.since = self._stopped = self._waited = 0.0
        self.deaths = 0

    def give(self, task: Task, deaths: int) -> None:
        """Start a task, after which so many workers have died before."""
        self.log.seek(0)
        self.log.truncate(0)
        self.task, self.since, self.deaths = [task], time.monotonic(), deaths
        self._stopped, self._waited = 0.0, processor_wait(self.process.pid or 0)
        try:
            self.pipe.send(task)
        except OSError:
            pass            # it has died; its end is noticed as the end of its pipe

    def forgive(self, seconds: float) -> None:
        """Do not count a time in which the whole campaign was stopped [s]."""
        self._stopped += seconds

    def spent(self) -> float:
        """Return for how long the task could run [s]: without stops, and without waiting for a processor."""
        waited = processor_wait(self.process.pid or 0) - self._waited
        return time.monotonic() - self.since - self._stopped - max(waited, 0.0)

    def tail(self) -> str:
        """Return the end of what it wrote in this task."""
        size = self.log.seek(0, os.SEEK_END)
        self.log.seek(max(0, size - LOG_TAIL))
        return self.log.read(LOG_TAIL).decode("utf-8", "replace")

    def end(self) -> str:
        """Kill the process; return how it ended."""
        self.process.kill()
        self.process.join()
        code = self.process.exitcode or 0
        self.pipe.close()
        self.log.close()
        return "signal {} ({})".format(-code, signal.Signals(-code).name) if code < 0 else "exit code {}".format(code)

    def death(self) -> Tuple[str, str]:
        """Return how a worker ended whose pipe has ended, and what it wrote."""
        self.process.join(1.0)
        text = self.tail()
        return self.end(), text


def end_with_parent(parent: int) -> None:
    """Let this process be killed when its parent ends; Ctrl-C is left to the parent.

    Parameters
    ----------
    parent : int
        Its process id.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    if os.getppid() != parent:          # it ended before
        os._exit(0)


def _serve(perform: Callable[[Any], Dict[str, Any]], pipe: Connection, log: int, others: Sequence[Connection],
           parent: int) -> None:
    """Answer tasks until the pipe ends; in a process of its own."""
    end_with_parent(parent)
    for other in others:        # those of the parent: if it dies, all pipes have to end
        other.close()
    for stream in (1, 2):
        os.dup2(log, stream)
    sys.stdout, sys.stderr = (open(stream, "w", buffering=1, closefd=False) for stream in (1, 2))
    try:
        while os.getppid() == parent:
            pipe.send(perform(pipe.recv()))
    except EOFError:
        os._exit(0)
    except BaseException:
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    os._exit(0)


class Pool(Generic[Task]):
    """Runs tasks in processes forked from this one, which has one thread.

    Parameters
    ----------
    perform : callable
        Makes a row of a task, in a worker.
    lost : callable
        Makes the row of a task whose worker died twice, or took too long.
    workers : int
    """

    def __init__(self, perform: Callable[[Task], Dict[str, Any]], lost: Lost, workers: int) -> None:
        self._perform, self._lost, self._count = perform, lost, workers
        self._workers: List[_Worker[Task]] = []

    def rows(self, tasks: Sequence[Task], time_limit: float, keep: bool = False) -> Generator[
            Dict[str, Any], None, None]:
        """Yield the row of each task as soon as it ends. Closing the iterator kills the workers.

        Parameters
        ----------
        tasks : sequence
        time_limit : float
            Greatest wall time of a task [s].  Time in which the campaign is stopped (SIGSTOP, a machine that sleeps)
            or the task waits for a processor does not count.
        keep : bool, optional
            Whether the workers stay for the next call, with the worlds that they have loaded.
        """
        waiting: Deque[Tuple[Task, int]] = deque((task, 0) for task in tasks)
        try:
            while waiting or any(worker.task for worker in self._workers):
                self._share_out(waiting)
                yield from self._ended(waiting, time_limit)
        finally:
            if not keep:
                self.close()

    def close(self) -> None:
        """Kill the workers."""
        for worker in self._workers:
            worker.end()
        self._workers = []

    def _share_out(self, waiting: Deque[Tuple[Task, int]]) -> None:
        while len(self._workers) < min(self._count, len(waiting) + len(self._workers)):
            self._workers.append(_Worker(self._perform, [worker.pipe for worker in self._workers]))
        for worker in self._workers:
            if waiting and not worker.task:
                worker.give(*waiting.popleft())

    def _ended(self, waiting: Deque[Tuple[Task, int]], time_limit: float) -> Iterator[Dict[str, Any]]:
        """Yield rows of tasks that have ended; wait for the first."""
        busy = {worker.pipe: worker for worker in self._workers if worker.task}
        began = time.monotonic()
        left = min(time_limit - worker.spent() for worker in busy.values())
        ended = wait(list(busy), min(max(left, 0.0), LOOK))
        passed = time.monotonic() - began
        if passed > 2.0 * LOOK:
            for worker in busy.values():
                worker.forgive(passed - LOOK)
        for pipe in ended:
            worker = busy.pop(pipe)                                 # type: ignore[arg-type]
            try:
                row = worker.pipe.recv()
            except (EOFError, OSError):
                yield from self._died(worker, waiting)
                continue
            if row.get("log") == "" and row.get("status") == "failed":
                row["log"] = worker.tail()
            worker.task = []
            yield row
        for worker in busy.values():
            if worker.spent() >= time_limit:
                text = worker.tail()
                yield self._lost(worker.task[0], "no result after {:g} s".format(time_limit), text,
                                 time.monotonic() - worker.since)
                worker.end()
                self._workers.remove(worker)

    def _died(self, worker: _Worker[Task], waiting: Deque[Tuple[Task, int]]) -> Iterator[Dict[str, Any]]:
        task, spent, count = worker.task[0], time.monotonic() - worker.since, worker.deaths + 1
        self._workers.remove(worker)
        how, text = worker.death()
        if count < DEATHS:
            waiting.appendleft((task, count))
        else:
            yield self._lost(task, "its worker died {} times, at last by {}".format(count, how), text, spent)


@contextmanager
def told_rows(pool: Pool[Task], tasks: Sequence[Task], time_limit: float) -> Iterator[Iterator[Dict[str, Any]]]:
    """Give the rows of tasks; if Ctrl-C stops them, print how many have ended.

    Parameters
    ----------
    pool : Pool
    tasks : sequence
    time_limit : float
        As of :meth:`Pool.rows`.

    Yields
    ------
    iterator of dict

    Raises
    ------
    KeyboardInterrupt
        After the print: the exit code is that of an interruption.
    """
    ended = 0

    def counted() -> Iterator[Dict[str, Any]]:
        nonlocal ended
        for row in rows:
            ended += 1
            yield row

    with closing(pool.rows(tasks, time_limit)) as rows:
        try:
            yield counted()
        except KeyboardInterrupt:
            print("\nstopped: {} of {} runs have ended".format(ended, len(tasks)))
            raise

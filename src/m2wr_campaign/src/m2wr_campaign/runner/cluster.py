# SPDX-License-Identifier: BSD-3-Clause
"""Runs on a cluster of Dask: batches of tasks travel to its workers with their worlds and robots.

A batch is about BATCH_TIME of work in one world. If its worker is lost, Dask gives it to another one. If the scheduler
is lost, all batches without an answer are sent again when it is back.
"""
from __future__ import annotations

import importlib
import logging
import queue
import time
from asyncio import CancelledError
from collections import deque
from contextlib import closing, contextmanager, suppress
from typing import TYPE_CHECKING, Any, Callable, Deque, Dict, Generator, Iterable, Iterator, List, Sequence

from m2wr_campaign.runner.station import Batch, run_batch

if TYPE_CHECKING:
    from m2wr_campaign.runner.pool import Lost
    from m2wr_campaign.study.factors import RunTask

PATIENCE = 60.0             # s without the scheduler, after which the campaign stops
FIRST_PATIENCE = 10.0       # s, at the beginning: the address may be wrong
MOST_LOSSES = 20            # of the scheduler, without any result between them
CLOSING = 5.0               # s
BATCH_TIME = 1.0            # s of wall time: so much is lost with a worker
LARGEST_BATCH = 100
AHEAD = 3                   # batches for each thread of the workers that are sent ahead
LOOK_EVERY = 5.0            # s between two looks at the number of threads
LEAST_IN_FLIGHT = 4


class ClusterError(Exception):
    """A cluster that cannot be used."""


class _SchedulerLost(Exception):
    """The scheduler is gone, with all that it knew."""


def distributed() -> Any:
    """Return the package distributed.

    Raises
    ------
    ClusterError
        If it is not installed.
    """
    try:
        return importlib.import_module("distributed")
    except ImportError:
        raise ClusterError("--scheduler needs the Python package distributed, which is not installed; leave the option "
                           "out to use all cores of this machine, or install it: apt install python3-distributed, or "
                           "pip install distributed") from None


@contextmanager
def embedded_scheduler(workers: int) -> Iterator[str]:
    """Start a scheduler and a worker of Dask in this process; yield the address.

    The runs themselves are in processes beside the worker's threads, see :mod:`m2wr_campaign.runner.station`.

    Parameters
    ----------
    workers : int
        Runs at one time.

    Raises
    ------
    ClusterError
        If Dask is not installed.
    """
    with distributed().LocalCluster(n_workers=1, threads_per_worker=workers, processes=False, dashboard_address=None,
                                    memory_limit=0, silence_logs=logging.CRITICAL) as local:
        yield local.scheduler_address


def batch(waiting: Deque[RunTask], size: int) -> List[RunTask]:
    """Remove and return the next tasks, all in the same world.

    Parameters
    ----------
    waiting : deque of RunTask
        Not empty; the tasks are removed.
    size : int
        Greatest number.

    Returns
    -------
    list of RunTask
    """
    taken = [waiting.popleft()]
    while waiting and len(taken) < size and waiting[0].world.key == taken[0].world.key:
        taken.append(waiting.popleft())
    return taken


class Cluster:
    """Runs tasks on a cluster, as :class:`m2wr_campaign.runner.pool.Pool` does in processes of this machine.

    Parameters
    ----------
    address : str
        Of the scheduler, such as ``tcp://host:8786``.
    lost : callable
        Makes the row of a task that killed its workers.
    say : callable
        Gets a sentence for the user.
    """

    def __init__(self, address: str, lost: Lost, say: Callable[[str], None]) -> None:
        self._address, self._lost, self._say = address, lost, say
        self._dask = distributed()
        for name in ("distributed", "distributed.client", "tornado", "asyncio"):
            logging.getLogger(name).setLevel(logging.CRITICAL)      # what is lost is said here
        self._wall = 0.0            # mean of the runs that have ended [s]
        self._ended = 0

    def rows(self, tasks: Sequence[RunTask], time_limit: float) -> Generator[Dict[str, Any], None, None]:
        """Yield the row of each task as soon as it ends.

        Parameters
        ----------
        tasks : sequence of RunTask
        time_limit : float
            Greatest wall time of a task [s].

        Raises
        ------
        ClusterError
            If there is no scheduler, or it does not come back, or a worker cannot do the runs.
        """
        left = {task.key: task for task in tasks}
        patience, losses = FIRST_PATIENCE, 0
        while left:
            client = self._connected(patience)
            patience = PATIENCE
            try:
                with closing(self._session(client, list(left.values()), time_limit)) as found:
                    for row in found:
                        losses = 0
                        if left.pop(row["key"], None) is not None:
                            yield row
            except _SchedulerLost:
                losses += 1
                if losses > MOST_LOSSES:
                    raise ClusterError("the scheduler {} was lost {} times without any result; finished runs are kept"
                                       .format(self._address, losses)) from None
                self._say("the scheduler {} is lost; waiting for it".format(self._address))
            finally:
                with suppress(Exception):           # it may be lost in any state
                    client.close(timeout=CLOSING)

    def _connected(self, patience: float) -> Any:
        """Return a client."""
        until = time.monotonic() + patience
        while True:
            try:
                return self._dask.Client(self._address, timeout=max(1.0, min(5.0, until - time.monotonic())),
                                         set_as_default=False)
            except (OSError, TimeoutError, ValueError) as error:
                if time.monotonic() >= until or isinstance(error, ValueError):
                    raise ClusterError("no scheduler of Dask answers at {} within {:.0f} s ({}); start dask-scheduler "
                                       "there; finished runs are kept".format(
                                           self._address, patience, " ".join(str(error).split())[:200])) from None

    def _session(self, client: Any, tasks: Iterable[RunTask], time_limit: float) -> Generator[
            Dict[str, Any], None, None]:
        """Yield rows until all are there."""
        waiting: Deque[RunTask] = deque(tasks)
        alone: Deque[RunTask] = deque()         # of batches that killed their workers
        ended: queue.Queue[Any] = queue.Queue()
        running: Dict[Any, List[RunTask]] = {}
        limit, looked = LEAST_IN_FLIGHT, -LOOK_EVERY
        while waiting or alone or running:
            if time.monotonic() - looked >= LOOK_EVERY:
                limit, looked = self._in_flight(client), time.monotonic()
            while (waiting or alone) and len(running) < limit:
                some = [alone.popleft()] if alone else batch(waiting, self._batch_size())
                future = client.submit(run_batch, Batch(some, time_limit), pure=False)
                running[future] = some
                future.add_done_callback(ended.put)
            try:
                future = ended.get(timeout=1.0)
            except queue.Empty:
                if client.status != "running":
                    raise _SchedulerLost from None
                continue
            yield from self._answers(future, running.pop(future), alone)

    def _in_flight(self, client: Any) -> int:
        """Return how many batches may be sent; none have to wait long, and a scheduler has little to keep."""
        try:
            threads = sum(client.nthreads().values())
        except Exception as error:              # of the connection: which ones depends on the release
            raise _SchedulerLost from error
        if not threads:
            self._say("no worker is connected to {}; waiting for one".format(self._address))
        return max(LEAST_IN_FLIGHT, AHEAD * threads)

    def _batch_size(self) -> int:
        return 1 if not self._ended else max(1, min(LARGEST_BATCH, int(BATCH_TIME / max(self._wall, 1e-3))))

    def _answers(self, future: Any, tasks: List[RunTask], alone: Deque[RunTask]) -> Iterator[Dict[str, Any]]:
        """Yield the rows of a batch that has ended; one that killed its workers is done again, each task alone."""
        if future.status in ("cancelled", "lost"):
            raise _SchedulerLost
        if future.status == "error":
            problem = future.exception(timeout=CLOSING)
            if not isinstance(problem, self._dask.scheduler.KilledWorker):
                raise ClusterError("a worker of {} cannot do the runs: {}: {}; its workspace must be the same, and "
                                   "sourced; finished runs are kept".format(
                                       self._address, type(problem).__name__, " ".join(str(problem).split())[:300]))
            if len(tasks) > 1:
                alone.extend(tasks)
            else:
                yield self._lost(tasks[0], "its Dask worker died each time: {}".format(
                    " ".join(str(problem).split())[:300]), "", 0.0)
            return
        try:
            rows = future.result(timeout=PATIENCE)
        except (Exception, CancelledError) as error:        # its worker or the scheduler is lost while it answers
            raise _SchedulerLost from error
        for row in rows:
            self._ended += 1
            self._wall += (row["wall"] - self._wall) / min(self._ended, 100)
            yield row

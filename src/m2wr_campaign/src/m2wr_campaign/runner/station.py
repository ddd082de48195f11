# SPDX-License-Identifier: BSD-3-Clause
"""A process beside a thread of a Dask worker that does its runs, in a process of their own as on one machine.

A Dask worker has threads, and a process with threads must not fork. This one has none. So on a cluster, too, a run
that kills its process costs only itself, and one that takes too long is ended.
"""
from __future__ import annotations

import os
import subprocess
import sys
import threading
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import TYPE_CHECKING, Any, Dict, List

from m2wr_campaign.runner.pool import Pool, end_with_parent

if TYPE_CHECKING:
    from m2wr_campaign.study.factors import RunTask

TRIES = 2                   # a station that ends is replaced, and the batch begins again
_HERE = threading.local()   # the station of each thread


@dataclass
class Batch:
    """Tasks that travel together; one that Dask takes as a whole, because it has no hash.

    Attributes
    ----------
    tasks : list of RunTask
    time_limit : float
        Greatest wall time of a task [s].
    """

    tasks: List[RunTask]
    time_limit: float


class Station:
    """The process, seen from the Dask worker."""

    def __init__(self) -> None:
        self._pipe, far = Pipe()
        with far:
            self._process = subprocess.Popen([sys.executable, "-m", __name__, str(os.getpid()), str(far.fileno())],
                                             stdin=subprocess.DEVNULL, pass_fds=[far.fileno()])

    def answer(self, batch: Batch) -> List[Dict[str, Any]]:
        """Return the rows of a batch.

        Raises
        ------
        OSError, EOFError
            If the process has ended.
        """
        self._pipe.send(batch)
        rows: List[Dict[str, Any]] = self._pipe.recv()
        return rows

    def end(self) -> int:
        """Kill the process; return its exit code."""
        self._process.kill()
        self._pipe.close()
        return self._process.wait()


def run_batch(batch: Batch) -> List[Dict[str, Any]]:
    """Return the rows of a batch; called by Dask in a thread of a worker.

    Raises
    ------
    RuntimeError
        If the process that does the runs ends itself TRIES times.
    """
    for _ in range(TRIES):
        station = getattr(_HERE, "station", None) or Station()
        _HERE.station = station
        try:
            return station.answer(batch)
        except (OSError, EOFError):
            code, _HERE.station = station.end(), None
    raise RuntimeError("the process for runs ended {} times, at last with exit code {}; see the log of the worker"
                       .format(TRIES, code))


def main() -> None:
    """Answer batches until the pipe ends; in the station."""
    end_with_parent(int(sys.argv[1]))
    pipe: Connection = Connection(int(sys.argv[2]))
    from m2wr_campaign.runner.one_run import perform, row_of_failure, versions
    from m2wr_navigation.kernel_warm_up import compile_kernels
    versions()
    compile_kernels()
    pool: Pool[Any] = Pool(perform, row_of_failure, 1)
    try:
        while True:
            batch = pipe.recv()
            pipe.send(list(pool.rows(batch.tasks, batch.time_limit, keep=True)))
    except EOFError:
        pass
    finally:
        pool.close()


if __name__ == "__main__":
    main()

# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign run``: all runs of a study that are not stored yet, on all cores."""
from __future__ import annotations

import argparse
import os
import re
import sys
import time
from contextlib import ExitStack, closing
from datetime import datetime, timezone
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple, Union

from m2wr_campaign.runner.cluster import Cluster, ClusterError, embedded_scheduler
from m2wr_campaign.runner.one_run import FAILED, perform, row_of_failure, versions
from m2wr_campaign.runner.pool import Pool
from m2wr_campaign.runner.progress import CampaignProgress
from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.store.table_import import known_rows
from m2wr_campaign.study.expansion import all_tasks, balanced
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_node.interrupts import INTERRUPTED

if TYPE_CHECKING:
    from m2wr_campaign.study.factors import RunTask
    from m2wr_campaign.study.study_file import Study

MOST_WORKERS = 1024
ADDRESS = r"[a-z]{2,4}://[\w.:\[\]-]+:[0-9]{1,5}"
EMBEDDED = "local"          # in place of an address: Dask in this process


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="run", description="Run all combinations of a study's worlds, robots, noise, methods and repeats in the "
        "simulator, on all cores or on a cluster. Each run is stored when it ends; after a stop the same command "
        "continues. No ROS master is needed.")
    parser.add_argument("study", metavar="STUDY.yaml", help="the study: YAML, or a Python program (.py) "
                        "that sets STUDY to the same mapping")
    parser.add_argument("--out", default="", metavar="FILE",
                        help="results (default: the study's name with .sqlite, in the present folder)")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)),
                        help="processes (default: the cores)")
    parser.add_argument("--scheduler", default="", metavar="ADDRESS",
                        help="do the runs on a cluster of Dask, such as tcp://host:8786; local: on one in this process")
    parser.add_argument("--known", action="append", default=[], metavar="FILE",
                        help="runs of this study that were done before, which are taken over: a table that export "
                        "wrote (.csv, .csv.gz), or results (.sqlite); can be given more than once")
    parser.add_argument("--dry-run", action="store_true", help="only check the study and count its runs")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if the study or its results cannot be used."""
    parser = _parser()
    options = parser.parse_args(argv)
    if not 1 <= options.workers <= MOST_WORKERS:
        parser.error("--workers {}; expected from 1 to {}".format(options.workers, MOST_WORKERS))
    if options.scheduler not in ("", EMBEDDED) and not re.fullmatch(ADDRESS, options.scheduler):
        parser.error("--scheduler {}; expected an address such as tcp://host:8786, or {}".format(
            options.scheduler, EMBEDDED))
    out = options.out or os.path.splitext(os.path.basename(options.study))[0] + ".sqlite"
    try:
        study = read_study(options.study)
        if options.dry_run:
            tasks = all_tasks(study)
            print("{}: {} runs in {} worlds".format(study.name, len(tasks), len({task.world.key for task in tasks})))
            return 0
        with open(options.study, encoding="utf-8") as file:
            text = file.read()
        with ResultFile(out, writing=True) as results:
            return run_study(study, text, results, options.workers, options.scheduler, options.known)
    except (StudyError, StoreError, ClusterError) as error:
        print("run: {}".format(error), file=sys.stderr)
        return 1


def run_study(study: Study, text: str, results: ResultFile, workers: int, scheduler: str = "",
              others: Sequence[str] = ()) -> int:
    """Run what is not stored yet; return the exit code.

    Parameters
    ----------
    study : Study
    text : str
        Of its file.
    results : ResultFile
    workers : int
        Processes of this machine.
    scheduler : str, optional
        Address of a cluster, which is used instead, or ``local``.
    others : sequence of str, optional
        Files with runs that were done before.

    Returns
    -------
    int
    """
    tasks = all_tasks(study, results.generated)
    versions()                          # read once, before the processes are forked
    results.add_worlds({task.world.key: task.world for task in tasks}.values())
    results.begin(study.name, text, [task.key for task in tasks])
    known = results.finished()
    for path in others:
        count = results.add_all(known_rows(path, {task.key: task for task in tasks if task.key not in known}))
        print("{} runs of this study are taken over from {}".format(count, path))
        known = results.finished()
    left = balanced([task for task in tasks if task.key not in known])
    progress = CampaignProgress(len(tasks), len(tasks) - len(left), sys.stdout, time.monotonic)
    code = 0
    try:
        _store_all(left, study.time_limit, results, (workers, scheduler), progress)
    except KeyboardInterrupt:
        code = INTERRUPTED
    stored = len(results.finished() & {task.key for task in tasks})
    print("{}{} of {} runs are in {}{}".format("\nstopped: " if code else "", stored, len(tasks), results.path,
                                               "; the same command continues" if code else ""))
    return code


def _store_all(tasks: List[RunTask], time_limit: float, results: ResultFile,
               by: Tuple[int, str], progress: CampaignProgress) -> None:
    if not tasks:
        return
    pool: Union[Pool[RunTask], Cluster]
    workers, scheduler = by
    with ExitStack() as stack:
        if scheduler:
            address = stack.enter_context(embedded_scheduler(workers)) if scheduler == EMBEDDED else scheduler
            pool = Cluster(address, row_of_failure, lambda told: print("\nrun: " + told, file=sys.stderr))
        else:
            compile_kernels()           # once, before the processes are forked
            pool = Pool(perform, row_of_failure, workers)
        rows = stack.enter_context(closing(pool.rows(tasks, time_limit)))
        for row in rows:
            results.add(dict(row, finished=datetime.now(timezone.utc).isoformat(timespec="seconds")))
            progress.add(row["status"] == FAILED)

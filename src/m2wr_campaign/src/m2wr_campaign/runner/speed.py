# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign speed``: what a study costs beside the simulation, and how it scales with the processes."""
from __future__ import annotations

import argparse
import os
import sys
import time
from dataclasses import dataclass
from statistics import median
from typing import TYPE_CHECKING, Callable, Dict, Iterator, List, Optional, Sequence

from m2wr_campaign.runner.command import MOST_WORKERS
from m2wr_campaign.runner.one_run import RunError, perform, perform_here, place_of, row_of_failure
from m2wr_campaign.runner.pool import Pool
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study
from m2wr_navigation.compare.drive import PERIOD
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_sim.api import Sim

if TYPE_CHECKING:
    from m2wr_campaign.study.factors import RunTask
    from m2wr_navigation.compare.comparison import Decide
    from m2wr_navigation.methods.method import Decision
    from m2wr_sim.api import StepResult

MOST_RUNS = 100_000
STARTS = 40                 # of runs in a known world, for their median


@dataclass(frozen=True)
class Share:
    """Processor time of a run.

    Attributes
    ----------
    whole : float
        All of it [s].
    simulation : float
        The steps of the same drive alone, by the Python API [s].
    method : float
        The decisions alone [s].
    """

    whole: float
    simulation: float
    method: float


def tasks_of(path: str, runs: int) -> List[RunTask]:
    """Return runs of a study, evenly spread over it; those of one world one after the other, as in a batch.

    Parameters
    ----------
    path : str
        Of the study.
    runs : int
        Greatest number.

    Raises
    ------
    StudyError
        If the study cannot be used, or has ROS programs.
    """
    study = read_study(path)
    programs = [method.label for method in study.methods if method.program is not None]
    if programs:
        raise StudyError("{}: {} is a ROS program, whose time is not that of this process; expected methods of this "
                         "workspace".format(study.file, programs[0]))
    tasks = all_tasks(study)
    spread = [tasks[k * len(tasks) // runs] for k in range(runs)] if runs < len(tasks) else tasks
    return sorted(spread, key=lambda task: task.world.key)


def start_of(task: RunTask) -> float:
    """Return the processor time of a run up to its first decision [s].

    Parameters
    ----------
    task : RunTask
    """
    def stopped(_: Decide) -> Decide:
        def decide(result: StepResult) -> Decision:
            raise RunError("the first decision")
        return decide
    begin = time.process_time()
    try:
        place_of(task).comparison.entry(task.method.name, task.seed, dict(task.method.parameters), stopped)
    except RunError:
        pass
    return time.process_time() - begin


def share_of(task: RunTask) -> Share:
    """Return the processor time of a run in a known world, and of its parts.

    Parameters
    ----------
    task : RunTask
    """
    start_of(task)
    place, commands = place_of(task), [(0.0, 0.0)]
    whole = float(perform_here(task)["cpu"])

    def recorded(decide: Decide) -> Decide:
        def record(result: StepResult) -> Decision:
            decision = decide(result)
            commands.append((decision.linear, decision.angular))
            return decision
        return record
    entry = place.comparison.entry(task.method.name, task.seed, dict(task.method.parameters), recorded)
    robot = task.robot.robot
    with Sim(task.world.world, robot.model, place.comparison.start, seed=task.seed, sensing="now") as sim:
        begin = time.process_time()
        for command in commands[:-1]:
            sim.step(command, PERIOD)
        simulation = time.process_time() - begin
    return Share(whole, simulation, 1e-3 * entry.cpu_ms * (len(commands) - 1))


def runs_per_second(tasks: Sequence[RunTask], workers: int) -> float:
    """Return the runs in a second of wall time.

    Parameters
    ----------
    tasks : sequence of RunTask
    workers : int
        Processes.
    """
    pool: Pool[RunTask] = Pool(perform, row_of_failure, workers)
    begin = time.monotonic()
    count = sum(1 for _ in pool.rows(tasks, tasks[0].time_limit))
    return count / (time.monotonic() - begin)


def report(tasks: Sequence[RunTask], most_workers: int,
           measure: Callable[[RunTask], Share] = share_of) -> Iterator[str]:
    """Yield the lines of the report as soon as they are known.

    Parameters
    ----------
    tasks : sequence of RunTask
    most_workers : int
        Greatest number of processes.
    measure : callable
    """
    first: Dict[str, RunTask] = {}
    for task in tasks:
        first.setdefault(task.world.key, task)
    start_of(tasks[0])              # loads what all runs share
    new = [start_of(task) for task in first.values()]
    known = [start_of(list(first.values())[-1]) for _ in range(STARTS)]
    yield "| start of a run, processor time up to its first decision | median |\n| --- | --- |"
    yield "| in a world that the process has seen | {:.1f} ms |".format(1e3 * median(known))
    yield "| in a new world, with its exact shortest path | {:.1f} ms |\n".format(1e3 * median(new))
    shares = [measure(task) for task in tasks]
    whole, simulation, method = (sum(getattr(one, name) for one in shares)
                                 for name in ("whole", "simulation", "method"))
    yield "| processor time of {} runs in {} worlds | s | of simulation and method |\n| --- | --- | --- |".format(
        len(tasks), len(first))
    for name, spent in (("simulation", simulation), ("method", method), ("all else", whole - simulation - method)):
        yield "| {} | {:.2f} | {:.1f} % |".format(name, spent, 100.0 * spent / (simulation + method))
    yield "| together | {:.2f} | {:.0f} runs in an hour |\n".format(whole, 3600.0 * len(tasks) / whole)
    yield "| processes | runs in a second of wall time | of as many times one process |\n| --- | --- | --- |"
    counts = sorted({1, most_workers} | {2 ** power for power in range(10) if 2 ** power < most_workers})
    single = 0.0
    for count in counts:
        rate = runs_per_second(tasks, count)
        single = single or rate
        yield "| {} | {:.2f} | {:.0f} % |".format(count, rate, 100.0 * rate / (count * single))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="speed", description="Measure what a study costs: the start of a run, its processor time beside "
        "simulation and method, and the runs a second with more processes. On a machine that does nothing else.")
    parser.add_argument("study", metavar="STUDY.yaml", help="the study")
    parser.add_argument("--runs", type=int, default=60, help="so many of its runs (default: %(default)s)")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)),
                        help="greatest number of processes (default: the cores)")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code."""
    parser = _parser()
    options = parser.parse_args(argv)
    for name, most in (("runs", MOST_RUNS), ("workers", MOST_WORKERS)):
        if not 1 <= getattr(options, name) <= most:
            parser.error("--{} {}; expected from 1 to {}".format(name, getattr(options, name), most))
    try:
        tasks = tasks_of(options.study, options.runs)
    except StudyError as error:
        print("speed: {}".format(error), file=sys.stderr)
        return 1
    compile_kernels()
    for line in report(tasks, options.workers):
        print(line, flush=True)
    return 0

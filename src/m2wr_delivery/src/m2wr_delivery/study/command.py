# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_delivery simulate``: runs without ROS, one or many, each with its report."""
from __future__ import annotations

import argparse
import os
import sys
from dataclasses import fields
from typing import Any, Dict, List, NamedTuple, Optional, Sequence

import numpy as np

from m2wr_campaign.runner.pool import Pool, told_rows
from m2wr_delivery import figure, report
from m2wr_delivery.scenario import Settings, make_scenario
from m2wr_delivery.study.run import Runner
from m2wr_elevation.kernel_warm_up import compile_kernels
from m2wr_navigation.compare.statistics import wilson
from m2wr_sim.errors import SimError

EXAM = 1000                 # seeds below it were used while the robots were programmed
TIME_LIMIT = 3600.0         # s of wall time for a run


class Task(NamedTuple):
    """One run: seed of its field, what it has, and the path of its files without extension."""

    seed: int
    settings: Settings
    output: str


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="simulate", description="Robots deliver parcels over rough ground, simulated "
                                     "without ROS. Several runs give a table of what was delivered.")
    parser.add_argument("--seed", type=int, default=0, help="of the field (default: 0)")
    parser.add_argument("--runs", type=int, default=1, help="how many fields, with successive seeds (default: 1)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="default: one for each core")
    parser.add_argument("--output", default="delivery", help="of the files, without extension: .json and .png "
                        "(default: delivery)")
    usual = Settings()
    parser.add_argument("--robots", type=int, default=usual.robots, help="default: {}".format(usual.robots))
    parser.add_argument("--parcels", type=int, default=usual.parcels, help="default: {}".format(usual.parcels))
    parser.add_argument("--blocked", type=int, default=usual.blocked,
                        help="places that are walled in (default: {})".format(usual.blocked))
    parser.add_argument("--walls", type=int, default=usual.walls, help="default: {}".format(usual.walls))
    parser.add_argument("--size", type=float, default=usual.size,
                        help="of a side of the field [m] (default: {:g})".format(usual.size))
    parser.add_argument("--capacity", type=float, default=usual.capacity,
                        help="energy in a full battery [J] (default: {:g})".format(usual.capacity))
    parser.add_argument("--charger", type=float, default=usual.charger,
                        help="power for each robot [W] (default: {:g})".format(usual.charger))
    parser.add_argument("--radio", type=float, default=usual.radio,
                        help="range [m] (default: {:g})".format(usual.radio))
    parser.add_argument("--limit", type=float, default=usual.limit,
                        help="end of a run [s] (default: {:g})".format(usual.limit))
    parser.add_argument("--roughness", type=float, default=usual.roughness,
                        help="factor of the heights of the ground (default: {:g})".format(usual.roughness))
    return parser


def _one(task: Task) -> Dict[str, Any]:
    seed, settings, output = task
    scenario = make_scenario(seed, settings)
    runner = Runner(scenario)
    try:
        ended = runner.run()
    finally:
        runner.close()
    result = report.result_of(scenario, runner.referee, ended)
    report.write(output + ".json", result)
    figure.save(output + ".png", scenario, runner.referee)
    return result


def _one_of_many(task: Task) -> Dict[str, Any]:
    try:
        return _one(task)
    except (ValueError, OSError, SimError) as error:
        return _lost(task, str(error), "", 0.0)


def _lost(task: Task, reason: str, log: str, _: float) -> Dict[str, Any]:
    """Return what is told of a run whose process ended, or took too long."""
    return {"seed": task.seed, "lost": reason, "log": log}


def _many(tasks: Sequence[Task], processes: int) -> int:
    """Do runs, each in a process of its own, and print a table of those that ended; return the exit code."""
    results: List[Dict[str, Any]] = []
    lost = 0
    compile_kernels()           # once, before the processes are forked
    pool: Pool[Task] = Pool(_one_of_many, _lost, min(processes, len(tasks)))
    try:
        with told_rows(pool, tasks, TIME_LIMIT) as rows:
            for row in rows:
                if "lost" in row:
                    lost += 1
                    print("seed {}: no result: {}".format(row["seed"], row["lost"]), row["log"], file=sys.stderr)
                    continue
                results.append(row)
                print("seed {}: {} of {} delivered in {:.0f} s".format(
                    row["seed"], sum(parcel["delivered"] is not None for parcel in row["parcels"]),
                    len(row["parcels"]), row["time"]), flush=True)
    finally:
        if results:
            sys.stdout.write(_table(results))
    return int(lost > 0 or not all(map(report.succeeded, results)))


def _table(results: List[Dict[str, Any]]) -> str:
    """Return what many runs gave."""
    parcels = [row for result in results for row in result["parcels"]]
    lines = []
    for name, wanted in (("a way exists", True), ("no way exists", False)):
        own = [row for row in parcels if row["way_exists"] is wanted]
        done = sum(row["delivered"] is not None for row in own)
        low, high = wilson(done, len(own)) if own else (0.0, 1.0)
        lines.append("parcels to which {}: {} of {} delivered ({:.2f} to {:.2f})".format(
            name, done, len(own), low, high))
    robots = [row for result in results for row in result["robots"]]
    lines.append("robots at the end: {} of {} can move; driven {:.0f} m; used {:.0f} J, charged {:.0f} J".format(
        sum(not row["end"] for row in robots), len(robots), sum(row["distance"] for row in robots),
        sum(row["energy"] for row in robots), sum(row["charged"] for row in robots)))
    lines.append("time of a run: median {:.0f} s".format(float(np.median([result["time"] for result in results]))))
    return "\n".join(lines) + "\n"


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: of the command line.

    Returns
    -------
    int
        Exit code: 0; 1 if a parcel was not delivered to which a way leads, or a run gave no result; 2 if something
        given is wrong.
    """
    given = _parser().parse_args(arguments)
    try:
        if given.runs < 1 or given.processes < 1 or given.seed < 0:
            raise ValueError("--runs {}, --processes {}, --seed {}; expected at least 1, 1 and 0".format(
                given.runs, given.processes, given.seed))
        settings = Settings(**{one.name: getattr(given, one.name) for one in fields(Settings)})
        if given.runs == 1:
            result = _one(Task(given.seed, settings, given.output))
            sys.stdout.write(report.text_of(result))
            return 0 if report.succeeded(result) else 1
        return _many([Task(seed, settings, "{}_{}".format(given.output, seed))
                      for seed in range(given.seed, given.seed + given.runs)], given.processes)
    except (ValueError, OSError, SimError) as error:
        print("simulate: {}".format(error), file=sys.stderr)
        return 2

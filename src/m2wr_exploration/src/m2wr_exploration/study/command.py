# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_exploration compare``: strategies of exploration in many worlds, measured against the truth."""
from __future__ import annotations

import argparse
import os
import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional, Sequence, Tuple

import numpy as np

from m2wr_campaign.runner.pool import Pool, told_rows
from m2wr_exploration import registry
from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.study.guide import Guide
from m2wr_exploration.study.offline import offline_tour
from m2wr_exploration.study.run import explore, follow
from m2wr_exploration.study.scenes import buildings, named
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_exploration.study.truth import wall_shares
from m2wr_navigation.compare.outputs import check_writable, write_json
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_navigation.parameters import read
from m2wr_navigation.registry import UnknownPluginError
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_exploration.study.scenes import Place
    from m2wr_node.array_types import FloatArray

RANGE = 9.9                 # m: of m2wr's laser
ENOUGH = 0.99               # of the reachable area
TIME_LIMIT = 1800.0         # s of wall time for a run
NAMED = ("world01", "world02", "world03", "unreachable", "house")
GUIDED = "guided"           # no strategy: the robot is led along the offline tour
_HEAD = "%-16s %10s %9s %14s %14s %9s %13s %13s %9s" % (
    "strategy", ">= 99 %", "contacts", "path m median", "path / offline", "time s", "right walls %", "drawn walls %",
    "CPU s")


@dataclass(frozen=True)
class Task:
    """One exploration: the number of the place, and the name of the strategy."""

    place: int
    strategy: str


def perform(places: Sequence[Place], offline: Sequence[Tuple[float, FloatArray]], given: Mapping[str, Any], seed: int,
            task: Task) -> Dict[str, Any]:
    """Let the robot explore.

    Parameters
    ----------
    places : sequence of Place
    offline : sequence of (float, (N, 2) float64)
        Length of an offline tour of each [m], and its places [m].
    given : mapping of str to object
        Parameters of move_base.
    seed : int
        Of the noise of the laser.
    task : Task

    Returns
    -------
    dict of str to object
        Figures, curve, path and messages.
    """
    place, (length, points) = places[task.place], offline[task.place]
    began = os.times()
    if task.strategy == GUIDED:
        run = follow(place, Guide(points), given, seed)
    else:
        kind, values = registry.find(task.strategy), read(PARAMETERS, EXPLORER, "")[0]
        run = explore(place, kind(read(kind.PARAMETERS, {}, "")[0]), values, given, seed)
    ended = os.times()
    right, drawn = wall_shares(place.truth, run.known)
    return {"world": place.name, "strategy": task.strategy, "share": run.share, "area": run.area,
            "length": run.length, "offline": length, "right": right, "drawn": drawn, "time": run.time,
            "contacts": run.contacts, "goals": run.goals, "ended": run.ended, "cpu": ended.user - began.user,
            "curve": np.round(run.curve, 4).tolist(), "path": np.round(run.path, 2).tolist(), "messages": run.messages}


def lost(task: Task, reason: str, log: str, wall: float) -> Dict[str, Any]:
    """Return the figures of a run whose process ended.

    Parameters
    ----------
    task : Task
    reason, log : str
    wall : float
        [s]
    """
    return {"world": str(task.place), "strategy": task.strategy, "share": 0.0, "area": 0.0, "length": 0.0,
            "offline": 0.0, "right": 0.0, "drawn": 0.0, "time": 0.0, "contacts": 0, "goals": 0,
            "ended": "failed: " + reason, "cpu": wall, "curve": [], "path": [], "messages": [log]}


def line(strategy: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a line of the table.

    Parameters
    ----------
    strategy : str
    rows : sequence of mapping
        Of :func:`perform`.
    """
    full = [row for row in rows if row["share"] >= ENOUGH]
    ratios = [row["length"] / row["offline"] for row in full if row["offline"] > 0.0]
    return "%-16s %10s %9d %14s %14s %9s %13s %13s %9.1f" % (
        strategy, "%d of %d" % (len(full), len(rows)), sum(row["contacts"] for row in rows),
        "%.1f" % np.median([row["length"] for row in full]) if full else "",
        "%.2f" % np.mean(ratios) if ratios else "", "%.0f" % np.median([row["time"] for row in full]) if full else "",
        *("%.2f" % (100.0 * np.mean([row[name] for row in full])) if full else "" for name in ("right", "drawn")),
        np.mean([row["cpu"] for row in rows]))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="compare", description="Lets m2wr explore worlds with each strategy, and "
                                     "measures how much of the reachable area it has seen, by which path.")
    parser.add_argument("--worlds", default=",".join(NAMED), help="names or files, with commas; none: only generated "
                        "ones (default %(default)s)")
    parser.add_argument("--buildings", type=int, default=0, help="generated buildings (default %(default)s)")
    parser.add_argument("--strategies", default=",".join(registry.STRATEGIES), help="with commas (%(default)s); " +
                        GUIDED + ": no strategy, the robot is led along an offline tour")
    parser.add_argument("--seed", type=int, default=1, help="of buildings and noise (default %(default)s)")
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1, help="processes (default %(default)s)")
    parser.add_argument("--robots", default="", help="numbers of robots, with commas, such as 1,2,4,8: teams are "
                        "compared, in larger buildings, instead of strategies")
    parser.add_argument("--unknown-starts", action="store_true", help="with --robots: no robot knows where the others "
                        "start; they begin with random headings, and their maps are placed on each other")
    parser.add_argument("--json", default="", metavar="FILE", help="also write all figures, curves and paths")
    parser.add_argument("--figure", default="", metavar="FILE", help="draw the explored area over the path: PNG or SVG")
    return parser


def _tell(rows: List[Dict[str, Any]], strategies: List[str], path: str) -> None:
    """Print the table of all runs that have ended, and write them to a file, if it has a name."""
    if rows:
        print(_HEAD)
        for name in strategies:
            print(line(name, [row for row in rows if row["strategy"] == name]))
        if path:
            write_json(path, rows)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 2 if a run saw less than 99 %, or had a contact."""
    parser = _parser()
    options = parser.parse_args(argv)
    if not (0 <= options.buildings <= 1000 and 1 <= options.workers <= 256):
        parser.error("expected --buildings from 0 to 1000 and --workers from 1 to 256")
    strategies = options.strategies.split(",")
    if options.unknown_starts and not options.robots:
        parser.error("--unknown-starts needs --robots: a robot that is alone has nothing to find")
    if options.robots:
        from m2wr_exploration.study.team_command import compare_teams
        return compare_teams(options, parser)
    try:
        for name in strategies:
            if name != GUIDED:
                registry.find(name)
        for path in (options.json, options.figure):
            if path:
                check_writable(path)
        places = [named(name, options.seed) for name in options.worlds.split(",") if name and name != "none"]
        places += list(buildings(options.buildings, options.seed))
    except (OSError, SimError, ValueError, UnknownPluginError) as error:
        print("compare: {}".format(error), file=sys.stderr)
        return 1
    if not places:
        parser.error("expected at least one world, or --buildings")
    compile_kernels()
    offline = [offline_tour(place, RANGE) for place in places]
    tasks = [Task(number, name) for number in range(len(places)) for name in strategies]
    pool: Pool[Task] = Pool(partial(perform, places, offline, navigation_parameters(), options.seed), lost,
                            min(options.workers, len(tasks)))
    rows: List[Dict[str, Any]] = []
    try:
        with told_rows(pool, tasks, TIME_LIMIT) as results:
            for row in results:
                rows.append(row)
                if row["share"] < ENOUGH or row["contacts"]:
                    print("%s, %s: %.1f %% of %.0f m^2 seen, %d contacts; %s" % (
                        row["world"], row["strategy"], 100.0 * row["share"], row["area"], row["contacts"],
                        row["ended"]))
    finally:
        _tell(rows, strategies, options.json)
    if options.figure:
        from m2wr_exploration.study.figure import draw
        draw(rows, strategies, options.figure)
    return 0 if all(row["share"] >= ENOUGH and not row["contacts"] for row in rows) else 2

# SPDX-License-Identifier: BSD-3-Clause
"""``compare --robots 1,2,4,8``: how the time of an exploration falls with the number of robots."""
from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

import numpy as np

from m2wr_campaign.runner.pool import Pool, told_rows
from m2wr_exploration import registry
from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.study.scenes import LARGE, buildings, named
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_exploration.study.team_run import explore_together, starts
from m2wr_exploration.study.team_statistics import against, mean_time, times
from m2wr_navigation.compare.outputs import check_writable, write_json
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_navigation.parameters import read
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    import argparse

    from m2wr_exploration.study.scenes import Place

MOST = 16                   # robots
ENOUGH = 0.99               # of the reachable area
TIME_LIMIT = 3600.0         # s of wall time for a run
STRATEGY = "tour"           # of a robot that is alone
_HEAD = "%6s %10s %9s %20s %21s %15s" % (
    "robots", ">= 99 %", "contacts", "s to 99 %, mean", "against one robot", "m each, median")


@dataclass(frozen=True)
class Task:
    """One exploration: the number of the place, and that of the robots."""

    place: int
    robots: int


def perform(places: Sequence[Place], given: Mapping[str, Any], seed: int, known: bool, task: Task) -> Dict[str, Any]:
    """Let robots explore.

    Parameters
    ----------
    places : sequence of Place
    given : mapping of str to object
        Parameters of move_base.
    seed : int
        Of the noise of the lasers, and of headings.
    known : bool
        Whether the robots know where the others start. If not, they begin with random headings.
    task : Task

    Returns
    -------
    dict of str to object
    """
    place, kind = places[task.place], registry.find(STRATEGY)
    values, _ = read(PARAMETERS, EXPLORER, "")
    poses = starts(place, task.robots)
    if not known:
        headings = np.random.default_rng([seed, task.place]).uniform(-math.pi, math.pi, task.robots)
        poses = [(x, y, float(heading)) for (x, y, _), heading in zip(poses, headings)]
    run = explore_together(place, poses, [kind(read(kind.PARAMETERS, {}, "")[0]) for _ in poses], values, given, seed,
                           ENOUGH, known=known)
    return {"place": task.place, "world": place.name, "robots": task.robots, "share": run.share, "area": run.area,
            "time": run.time, "enough": run.enough, "lengths": run.lengths, "contacts": run.contacts,
            "placed": run.placed, "misplaced": run.misplaced, "curve": np.round(run.curve, 4).tolist(),
            "messages": run.messages}


def lost(task: Task, reason: str, log: str, wall: float) -> Dict[str, Any]:
    """Return the figures of a run whose process ended.

    Parameters
    ----------
    task : Task
    reason, log : str
    wall : float
        [s]
    """
    return {"place": task.place, "world": str(task.place), "robots": task.robots, "share": 0.0, "area": 0.0,
            "time": wall, "enough": math.inf, "lengths": [], "contacts": 0, "curve": [], "messages": [reason, log],
            "placed": math.inf, "misplaced": 0.0}


def line(robots: int, rows: Sequence[Mapping[str, Any]], fewest: int) -> str:
    """Return a line of the table: means over places with their 95 % intervals, the path as median.

    Parameters
    ----------
    robots : int
    rows : sequence of mapping
        Of :func:`perform`, with all numbers of robots.
    fewest : int
        Number of robots of the smallest team, against which times are given.
    """
    own = [row for row in rows if row["robots"] == robots]
    full = [row for row in own if math.isfinite(row["enough"])]
    time, ratio = mean_time(rows, robots), against(rows, robots, fewest)
    lengths = [length for row in full for length in row["lengths"]]
    return "%6d %10s %9d %20s %21s %15s" % (
        robots, "%d of %d" % (len(full), len(own)), sum(row["contacts"] for row in own),
        "%.0f (%.0f to %.0f)" % time if math.isfinite(time[0]) else "",
        "%.2f (%.2f to %.2f)" % ratio if math.isfinite(ratio[0]) else "",
        "%.1f" % np.median(lengths) if lengths else "")


def without_infinity(rows: Sequence[Mapping[str, Any]]) -> List[Dict[str, Any]]:
    """Return rows for JSON, which has no infinity: a time that never came is None.

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`perform` or :func:`lost`.

    Returns
    -------
    list of dict
    """
    return [dict(row, **{name: row[name] if math.isfinite(row[name]) else None for name in ("enough", "placed")})
            for row in rows]


def placing_line(robots: int, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a line on how many teams came to know where all their maps lie, when, and with which greatest error.

    Parameters
    ----------
    robots : int
    rows : sequence of mapping
        Of :func:`perform`.
    """
    own = [row for row in rows if row["robots"] == robots]
    placed = [row["placed"] for row in own if math.isfinite(row["placed"])]
    return "%6d %15s %15s %14.0f" % (
        robots, "%d of %d" % (len(placed), len(own)), "%.0f" % np.median(placed) if placed else "",
        100.0 * max((row["misplaced"] for row in own), default=0.0))


def _tell(rows: List[Dict[str, Any]], numbers: List[int], known: bool) -> None:
    """Print the table of all runs that have ended."""
    if not rows:
        return
    print(_HEAD.replace("one robot", "%d robots" % numbers[0] if numbers[0] > 1 else "one robot"))
    for robots in numbers:
        print(line(robots, rows, numbers[0]))
    print("times: of the %d places where every team saw 99 %%; in brackets 95 %% intervals" % len(
        times(rows, numbers[0])))
    if not known:
        print("%6s %15s %15s %14s" % ("robots", "all maps placed", "s, median", "worst error cm"))
        for robots in numbers:
            print(placing_line(robots, rows))


def compare_teams(options: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run the command.

    Parameters
    ----------
    options : Namespace
        Of ``compare``.
    parser : ArgumentParser

    Returns
    -------
    int
        Exit code: 2 if a run saw less than 99 %, or had a contact; 1 if something cannot be used.
    """
    try:
        numbers = sorted({int(word) for word in options.robots.split(",")})
    except ValueError:
        numbers = []
    if not numbers or not all(1 <= number <= MOST for number in numbers):
        parser.error("--robots is {!r}; expected numbers from 1 to {} with commas: no robot explores nothing".format(
            options.robots, MOST))
    try:
        for path in (options.json, options.figure):
            if path:
                check_writable(path)
        only_buildings = options.buildings and options.worlds == parser.get_default("worlds")
        places = [named(name, options.seed) for name in ("" if only_buildings else options.worlds).split(",")
                  if name and name != "none"]
        places += list(buildings(options.buildings, options.seed, LARGE))
        for place in places:
            starts(place, numbers[-1])
    except (OSError, SimError, ValueError) as error:
        print("compare: {}".format(error), file=sys.stderr)
        return 1
    if not places:
        parser.error("expected at least one world, or --buildings")
    compile_kernels()
    tasks = [Task(number, robots) for number in range(len(places)) for robots in numbers]
    known = not options.unknown_starts
    pool: Pool[Task] = Pool(partial(perform, places, navigation_parameters(), options.seed, known), lost,
                            min(options.workers, len(tasks)))
    rows: List[Dict[str, Any]] = []
    try:
        with told_rows(pool, tasks, TIME_LIMIT) as results:
            for row in results:
                rows.append(row)
                enough = "after %.0f s" % row["enough"] if math.isfinite(row["enough"]) else "never"
                print("%s, %d robots: %.1f %% of %.0f m^2 seen, 99 %% %s, %d contacts" % (
                    row["world"], row["robots"], 100.0 * row["share"], row["area"], enough, row["contacts"]),
                    flush=True)         # each takes a minute
                if options.json:
                    write_json(options.json, without_infinity(rows))    # what there is, should the study be killed
    finally:
        _tell(rows, numbers, known)
    if options.figure:
        from m2wr_exploration.study.figure import draw_teams
        draw_teams(rows, numbers, options.figure)
    return 0 if all(row["share"] >= ENOUGH and not row["contacts"] for row in rows) else 2

# SPDX-License-Identifier: BSD-3-Clause
"""``compare --robots 1,2,4,8``: how the time of an exploration falls with the number of robots."""
from __future__ import annotations

import math
import sys
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

import numpy as np

from m2wr_campaign.runner.pool import Pool
from m2wr_exploration import registry
from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.study.scenes import LARGE, buildings, named
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_exploration.study.team_run import explore_together, starts
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
_HEAD = "%6s %10s %9s %18s %20s %16s" % (
    "robots", ">= 99 %", "contacts", "s to 99 %, median", "of one robot", "m each, median")


@dataclass(frozen=True)
class Task:
    """One exploration: the number of the place, and that of the robots."""

    place: int
    robots: int


def perform(places: Sequence[Place], given: Mapping[str, Any], seed: int, task: Task) -> Dict[str, Any]:
    """Let robots explore.

    Parameters
    ----------
    places : sequence of Place
    given : mapping of str to object
        Parameters of move_base.
    seed : int
        Of the noise of the lasers.
    task : Task

    Returns
    -------
    dict of str to object
    """
    place, kind = places[task.place], registry.find(STRATEGY)
    values, _ = read(PARAMETERS, EXPLORER, "")
    run = explore_together(place, starts(place, task.robots),
                           [kind(read(kind.PARAMETERS, {}, "")[0]) for _ in range(task.robots)], values, given, seed,
                           ENOUGH)
    return {"place": task.place, "world": place.name, "robots": task.robots, "share": run.share, "area": run.area,
            "time": run.time, "enough": run.enough, "lengths": run.lengths, "contacts": run.contacts,
            "curve": np.round(run.curve, 4).tolist(), "messages": run.messages}


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
            "time": wall, "enough": math.inf, "lengths": [], "contacts": 0, "curve": [], "messages": [reason, log]}


def line(robots: int, rows: Sequence[Mapping[str, Any]], alone: Mapping[int, float]) -> str:
    """Return a line of the table; the time against one robot as median, least and greatest of the places.

    Parameters
    ----------
    robots : int
    rows : sequence of mapping
        Of :func:`perform`, with this number of robots.
    alone : mapping of int to float
        Time to 99 % of the smallest team, by place [s].
    """
    full = [row for row in rows if math.isfinite(row["enough"])]
    ratios = [row["enough"] / alone[row["place"]] for row in full if math.isfinite(alone.get(row["place"], math.inf))]
    return "%6d %10s %9d %18s %20s %16s" % (
        robots, "%d of %d" % (len(full), len(rows)), sum(row["contacts"] for row in rows),
        "%.0f" % np.median([row["enough"] for row in full]) if full else "",
        "%.2f (%.2f to %.2f)" % (np.median(ratios), min(ratios), max(ratios)) if ratios else "",
        "%.1f" % np.median([length for row in full for length in row["lengths"]]) if full else "")


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
    pool: Pool[Task] = Pool(partial(perform, places, navigation_parameters(), options.seed), lost,
                            min(options.workers, len(tasks)))
    rows: List[Dict[str, Any]] = []
    with closing(pool.rows(tasks, TIME_LIMIT)) as results:
        for row in results:
            rows.append(row)
            print("%s, %d robots: %.1f %% of %.0f m^2 seen, 99 %% after %.0f s, %d contacts" % (
                row["world"], row["robots"], 100.0 * row["share"], row["area"], row["enough"], row["contacts"]),
                flush=True)         # each takes a minute
    alone = {row["place"]: row["enough"] for row in rows if row["robots"] == numbers[0]}
    print(_HEAD.replace("of one robot", "of %d" % numbers[0] if numbers[0] > 1 else "of one robot"))
    for robots in numbers:
        print(line(robots, [row for row in rows if row["robots"] == robots], alone))
    if options.json:
        write_json(options.json, rows)
    if options.figure:
        from m2wr_exploration.study.figure import draw_teams
        draw_teams(rows, numbers, options.figure)
    return 0 if all(row["share"] >= ENOUGH and not row["contacts"] for row in rows) else 2

# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_elevation compare``: planning over the elevation map against planning as if ground were flat.

A third planner also learns where it slips.
"""
from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import sys
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_campaign.terrain.relief import PATCHES, RELIEFS
from m2wr_elevation.study.drive import PLANNERS, to_goal
from m2wr_navigation.compare.statistics import wilson
from m2wr_sim.errors import SimError

COLUMNS = ("planner", "seed", "outcome", "time", "length", "tilt", "rms")
HARD = {"fractal": 0.05, "craters": 0.5, "rubble": 0.06}        # m
EXAM = 1000                 # seeds below it were used while costs were chosen


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="compare", description="Drive m2wr_rough over rough ground to a goal 6 m "
                                     "ahead, by its elevation map and as if the ground were flat.")
    parser.add_argument("--grounds", type=int, default=100, help="how many (default: 100)")
    parser.add_argument("--seed", type=int, default=EXAM, help="of the first ground (default: {})".format(EXAM))
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="default: one for each core")
    parser.add_argument("--output", default="planning.csv", help="table of all drives (default: planning.csv)")
    parser.add_argument("--planners", default="flat,elevation",
                        help="with commas, of {} (default: %(default)s)".format(", ".join(PLANNERS)))
    parser.add_argument("--patches", nargs="*", default=[], choices=sorted(set(PATCHES) - {"ground"}),
                        help="slippery kinds of ground, of which the robot is not told (default: none)")
    parser.add_argument("--share", type=float, default=0.3, help="of the area that patches cover (default: 0.3)")
    for name in sorted(RELIEFS):
        parser.add_argument("--" + name, type=float, default=HARD.get(name, 0.0), metavar="HEIGHT",
                            help="height of this relief, in metres (default: {:g})".format(HARD.get(name, 0.0)))
    return parser


def _one(task: Tuple[str, Dict[str, float], int, Tuple[str, ...], float]) -> Dict[str, Any]:
    planner, reliefs, seed, patches, share = task
    return to_goal(planner, reliefs, seed, patches=patches, share=share)


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """Run the command.

    Parameters
    ----------
    arguments : sequence of str, optional
        Default: of the command line.

    Returns
    -------
    int
        Exit code: 0, or 2 if something given is wrong or a file cannot be written.
    """
    given = _parser().parse_args(arguments)
    try:
        if given.grounds < 1 or given.seed < 0 or given.processes < 1:
            raise ValueError("--grounds {}, --seed {}, --processes {}; expected at least 1, 0 and 1".format(
                given.grounds, given.seed, given.processes))
        reliefs = {name: getattr(given, name) for name in RELIEFS}
        planners = given.planners.split(",")
        tasks = [(planner, reliefs, given.seed + number, tuple(given.patches), given.share)
                 for number in range(given.grounds) for planner in planners]
        rows: List[Dict[str, Any]] = []
        with multiprocessing.get_context("spawn").Pool(given.processes) as pool, \
                open(given.output, "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            for row in pool.imap(_one, tasks):          # each is written when it has ended
                rows.append(row)
                writer.writerow(row)
                file.flush()
    except (ValueError, OSError, SimError) as error:
        print("compare: {}".format(error), file=sys.stderr)
        return 2
    print("planner     reached  95 %         tipped slipped stuck  time [s]  length [m]  RMS of the map [cm]")
    for planner in planners:
        own = [row for row in rows if row["planner"] == planner]
        count = {name: sum(row["outcome"] == name for row in own) for name in ("reached", "tipped", "slipped", "stuck")}
        low, high = wilson(count["reached"], len(own))
        good = [row for row in own if row["outcome"] == "reached"] or own
        print("{:10} {:6} of {:<4} {:.2f} to {:.2f} {:5} {:7} {:5} {:9.1f} {:11.2f} {:14.2f}".format(
            planner, count["reached"], len(own), low, high, count["tipped"], count["slipped"], count["stuck"],
            float(np.median([row["time"] for row in good])), float(np.median([row["length"] for row in good])),
            100.0 * float(np.median([row["rms"] for row in own]))))
    return 0

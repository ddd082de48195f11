# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_campaign rough``: how far robots get on growing roughness, as a table and a figure."""
from __future__ import annotations

import argparse
import csv
import multiprocessing
import os
import sys
from typing import Any, Dict, List, Optional, Sequence, Tuple

from m2wr_campaign.rough.drive import on_relief
from m2wr_campaign.rough.figure import draw, shares
from m2wr_campaign.terrain.relief import RELIEFS
from m2wr_sim.errors import SimError

LEVELS = (0.01, 0.02, 0.03, 0.045, 0.06, 0.08, 0.10)        # m
DEVELOPMENT = 1000          # seeds below it were looked at while the robot was designed


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="rough", description="Drive robots over ground of growing roughness.")
    parser.add_argument("robots", nargs="*", default=["m2wr", "m2wr_rough"], metavar="ROBOT",
                        help="model files or names (default: m2wr m2wr_rough)")
    parser.add_argument("--levels", nargs="+", type=float, default=list(LEVELS), metavar="HEIGHT",
                        help="heights of all reliefs, in metres (default: {})".format(" ".join(map(str, LEVELS))))
    parser.add_argument("--reliefs", nargs="+", choices=sorted(RELIEFS), default=["fractal", "rubble"],
                        metavar="RELIEF",
                        help="some of {} (default: fractal rubble)".format(", ".join(sorted(RELIEFS))))
    parser.add_argument("--friction", type=float, default=1.0, help="of the ground (default: 1)")
    parser.add_argument("--drives", type=int, default=24, help="for each robot and level (default: 24)")
    parser.add_argument("--seed", type=int, default=DEVELOPMENT, help="of the first ground (default: 1000)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="default: one for each core")
    parser.add_argument("--output", default="rough", help="folder for rough.csv and rough.png (default: rough)")
    return parser


def _one(task: Tuple[str, Dict[str, float], int, float, float]) -> Dict[str, Any]:
    robot, reliefs, seed, friction, level = task
    return dict(on_relief(robot, reliefs, seed, friction), level=level)


def _tasks(given: argparse.Namespace) -> List[Tuple[str, Dict[str, float], int, float, float]]:
    """Return the drives; raise ValueError if an argument has an unusable value."""
    if given.drives < 1 or given.processes < 1 or given.seed < 0:
        raise ValueError("--drives {}, --processes {}, --seed {}; expected at least 1, 1 and 0".format(
            given.drives, given.processes, given.seed))
    if not 0.0 <= given.friction <= 10.0:
        raise ValueError("the friction is {:g}; expected 0 to 10".format(given.friction))
    if not all(0.0 <= level <= 1.0 for level in given.levels):
        raise ValueError("a level of {:g} m; expected 0 to 1 m".format(
            next(level for level in given.levels if not 0.0 <= level <= 1.0)))
    return [(robot, {name: level for name in given.reliefs}, given.seed + number, given.friction, level)
            for robot in given.robots for level in given.levels for number in range(given.drives)]


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
        tasks = _tasks(given)
        os.makedirs(given.output, exist_ok=True)
        if given.processes == 1:
            rows = [_one(task) for task in tasks]
        else:
            with multiprocessing.get_context("spawn").Pool(given.processes) as pool:
                rows = pool.map(_one, tasks, chunksize=1)
        path = os.path.join(given.output, "rough.csv")
        with open(path, "w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
        draw(rows, os.path.join(given.output, "rough.png"))
    except (ValueError, OSError, SimError) as error:
        print("rough: {}".format(error), file=sys.stderr)
        return 2
    for robot in given.robots:
        print("\n{}\n{:>8} {:>8} {:>8} {:>8} {:>8}   [%], of {}".format(
            robot, "level", *shares(rows, robot), given.drives))
        for lines in zip(*shares(rows, robot).values()):
            print("{:8.3f} {}".format(lines[0][0], " ".join("{:8.0f}".format(100.0 * line[1]) for line in lines)))
    print("\n{}\n{}".format(path, os.path.join(given.output, "rough.png")))
    return 0

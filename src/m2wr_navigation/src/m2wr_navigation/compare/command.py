# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_navigation compare``: all planners and methods in one world, a page and a table."""
from __future__ import annotations

import argparse
import json
import math
import sys
from typing import TYPE_CHECKING, List, Optional

from m2wr_navigation.compare.comparison import NAMES, Comparison, order
from m2wr_navigation.compare.page import page
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_navigation.compare.comparison import Entry

LINE = "%-16s %-8s %-12s %8s %9s %8s %10s %9s %9s"


def _names(text: str) -> List[str]:
    if text == "all":
        return list(NAMES)
    names = [name for name in text.split(",") if name]
    for name in names:
        if name not in NAMES:
            raise argparse.ArgumentTypeError("there is no {!r}; known are all, {}".format(name, ", ".join(NAMES)))
    return names


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="compare", description="Drive m2wr from start to goal by every planner and every method without a map, "
        "and compare the paths with the exact shortest one. No ROS master is needed.")
    parser.add_argument("--world", default="world02", help="name or file of the world (default world02)")
    parser.add_argument("--start", type=_finite, nargs="+", default=[0.0, 8.0], metavar="M",
                        help="x, y [m] and optionally yaw [rad] (default 0 8)")
    parser.add_argument("--goal", type=_finite, nargs=2, default=[0.0, -4.0], metavar="M",
                        help="x, y [m] (default 0 -4)")
    parser.add_argument("--methods", type=_names, default=list(NAMES), metavar="NAMES",
                        help="all, or names with commas between: " + ", ".join(NAMES))
    parser.add_argument("--limit", type=_finite, default=600.0, help="longest simulated time of a drive [s]")
    parser.add_argument("--seed", type=int, default=0, help="of the noise of the sensors (default 0)")
    parser.add_argument("--out", default="compare.html", metavar="FILE", help="page (default compare.html)")
    parser.add_argument("--json", default="", metavar="FILE", help="also write figures and paths to this file")
    return parser


def _line(entry: Entry) -> str:
    return LINE % (entry.name, entry.kind, entry.outcome, "%.3f" % entry.ratio if entry.success else "",
                   "%.2f" % entry.length if entry.success else "", "%.1f" % entry.time, "%.2f" % entry.clearance,
                   entry.contacts, "%.2f" % entry.cpu_ms)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if the comparison cannot be made."""
    parser = _parser()
    options = parser.parse_args(argv)
    if len(options.start) not in (2, 3):
        parser.error("--start has {} numbers; expected x, y and optionally yaw".format(len(options.start)))
    if options.seed < 0 or not options.limit > 0.0:
        parser.error("--seed {}, --limit {}; expected no negative seed and a positive limit".format(
            options.seed, options.limit))
    compile_kernels()           # not measured
    try:
        comparison = Comparison(options.world, (options.start + [0.0])[:3], options.goal, options.limit, options.seed)
        print(LINE % ("name", "kind", "result", "ratio", "length m", "time s", "clearance", "contacts", "CPU ms"))
        entries = []
        for entry in comparison.entries(options.methods):
            entries.append(entry)
            print(_line(entry), flush=True)
        with open(options.out, "w", encoding="utf-8") as file:
            file.write(page(comparison, entries))
        if options.json:
            with open(options.json, "w", encoding="utf-8") as file:
                json.dump({"world": options.world, "start": comparison.start, "goal": comparison.goal,
                           "seed": options.seed, "optimum_m": comparison.optimum.length,
                           "entries": [entry.record() for entry in order(entries)]}, file, indent=1)
    except (SimError, ValueError, OSError) as error:
        print("compare: {}".format(error), file=sys.stderr)
        return 1
    print("optimum {:.2f} m; page: {}".format(comparison.optimum.length, options.out))
    return 0

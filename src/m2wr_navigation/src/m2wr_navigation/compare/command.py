# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_navigation compare``: all planners and methods in one world, a page and a table."""
from __future__ import annotations

import argparse
import math
import os
import sys
from typing import TYPE_CHECKING, Any, Dict, List, Optional

from m2wr_navigation.compare import plaza
from m2wr_navigation.compare.comparison import NAMES, Comparison, order
from m2wr_navigation.compare.drive import Robot
from m2wr_navigation.compare.outputs import check_writable, write_json, write_text
from m2wr_navigation.compare.page import page
from m2wr_navigation.compare.scenes import generated, given
from m2wr_navigation.compare.survey import Job, drive_all, ranked
from m2wr_navigation.compare.survey_page import survey_page
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_navigation.robot_body import body_of
from m2wr_node.interrupts import INTERRUPTED
from m2wr_sim.api import read_robot
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_navigation.compare.comparison import Entry
    from m2wr_navigation.compare.scenes import Scene
    from m2wr_navigation.methods.body import RobotBody

MOST_WORLDS = 1000
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
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise argparse.ArgumentTypeError("{!r}; expected a finite number".format(text))
    return value


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="compare", description="Drive a robot from start to goal by every planner and every method without a map, "
        "and compare the paths with the exact shortest one. No ROS master is needed.")
    parser.add_argument("--world", default="world02", help="name or file of the world (default world02)")
    parser.add_argument("--start", type=_finite, nargs="+", default=[0.0, 8.0], metavar="M",
                        help="x, y [m] and optionally yaw [rad] (default 0 8)")
    parser.add_argument("--goal", type=_finite, nargs=2, default=[0.0, -4.0], metavar="M",
                        help="x, y [m] (default 0 -4)")
    parser.add_argument("--robot", default="m2wr", metavar="FILE", help="name of a robot, or its URDF, xacro or SDF "
                        "file (default m2wr); it needs a differential drive and a laser")
    parser.add_argument("--max-vel-x", type=_finite, default=0.5, metavar="M_S",
                        help="greatest speed (default 0.5 m/s)")
    parser.add_argument("--max-vel-theta", type=_finite, default=1.0, metavar="RAD_S",
                        help="greatest rate of turning (default 1 rad/s)")
    parser.add_argument("--methods", type=_names, default=list(NAMES), metavar="NAMES",
                        help="all, or names with commas between: " + ", ".join(NAMES))
    parser.add_argument("--worlds", nargs="+", default=[], metavar="N|FILE", help="many worlds instead: how many "
                        "generated ones, and names or files of others; start and goal are drawn")
    parser.add_argument("--moving", type=int, default=0, metavar="N",
                        help="obstacles that move in each generated world (default 0)")
    parser.add_argument("--workers", type=int, default=len(os.sched_getaffinity(0)),
                        help="processes for many worlds (default: the cores)")
    parser.add_argument("--limit", type=_finite, default=600.0, help="longest simulated time of a drive [s]")
    parser.add_argument("--seed", type=int, default=0,
                        help="of generated worlds and the noise of the sensors (default 0)")
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
    if not 0 <= options.moving <= plaza.MOST:
        parser.error("--moving {}; expected 0 to {}".format(options.moving, plaza.MOST))
    if options.workers < 1:
        parser.error("--workers {}; expected at least 1".format(options.workers))
    if options.seed < 0 or not options.limit > 0.0:
        parser.error("--seed {}, --limit {}; expected no negative seed and a positive limit".format(
            options.seed, options.limit))
    if not (options.max_vel_x > 0.0 and options.max_vel_theta > 0.0):
        parser.error("--max-vel-x {}, --max-vel-theta {}; expected positive numbers".format(
            options.max_vel_x, options.max_vel_theta))
    try:
        for path in (options.out, options.json):
            if path:
                check_writable(path)
        compile_kernels()           # not measured
        return _survey(options) if options.worlds else _compare(options)
    except (SimError, ValueError, OSError) as error:
        print("compare: {}".format(error), file=sys.stderr)
        return 1


def _robot(options: argparse.Namespace) -> Robot:
    model = read_robot(options.robot)
    return Robot(model, body_of(model), {"max_vel_x": options.max_vel_x, "max_vel_theta": options.max_vel_theta})


def _compare(options: argparse.Namespace) -> int:
    """Drive in one world and write what was measured, also after Ctrl-C; return the exit code."""
    comparison = Comparison(options.world, (options.start + [0.0])[:3], options.goal, options.limit, options.seed,
                            _robot(options))
    print(LINE % ("name", "kind", "result", "ratio", "length m", "time s", "clearance", "contacts", "CPU ms"))
    entries: List[Entry] = []
    code = 0
    try:
        for entry in comparison.entries(options.methods):
            entries.append(entry)
            print(_line(entry), flush=True)
    except KeyboardInterrupt:
        code = INTERRUPTED
    finally:
        if entries:
            write_text(options.out, page(comparison, entries))
        if entries and options.json:
            write_json(options.json, {"world": options.world, "start": comparison.start, "goal": comparison.goal,
                                      "seed": options.seed, "optimum_m": comparison.optimum.length,
                                      "entries": [entry.record() for entry in order(entries)]})
    if entries:
        print("optimum {:.2f} m; page: {}".format(comparison.optimum.length, options.out))
    return code


def _scenes(options: argparse.Namespace, body: RobotBody) -> List[Scene]:
    """Return the scenes that ``--worlds`` names."""
    scenes: List[Scene] = []
    for word in options.worlds:
        if word.isdigit():
            if not 0 < int(word) <= MOST_WORLDS:
                raise ValueError("--worlds {}; expected a number from 1 to {}".format(word, MOST_WORLDS))
            scenes += generated(int(word), options.seed, body.turning_radius, options.moving)
        else:
            scenes.append(given(word, options.seed, body.turning_radius, body.height))
    return scenes


def _survey(options: argparse.Namespace) -> int:
    """Drive in many worlds and write what was measured, also after Ctrl-C; return the exit code."""
    robot = _robot(options)
    scenes = _scenes(options, robot.body)
    jobs = [Job(scene, name, robot, options.limit, options.seed) for scene in scenes for name in options.methods]
    kept = os.path.splitext(options.out)[0] + ".runs.jsonl"
    records: List[Dict[str, Any]] = []
    code = 0
    try:
        for record, is_new in drive_all(jobs, kept, options.workers):
            records.append(record)
            if is_new:
                print("{:4d} of {}  {:16s} {:16s} {}".format(
                    len(records), len(jobs), record["scene"], record["name"], record["outcome"]), flush=True)
    except KeyboardInterrupt:
        code = INTERRUPTED
    finally:
        if records:
            write_text(options.out, survey_page(scenes, records, robot))
        if records and options.json:
            write_json(options.json, {"seed": options.seed, "worlds": [vars(scene) for scene in scenes],
                                      "methods": ranked(records), "runs": records})
    for row in ranked(records):
        ratio = "" if row["ratio"][0] is None else "  ratio %.3f" % row["ratio"][0]
        print("%-16s %3d of %-3d%s" % (row["name"], row["successes"], row["worlds"], ratio))
    print("page: {}; the drives are kept in {}".format(options.out, kept))
    return code

# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_navigation barn``: the BARN benchmark on generated worlds, a page and a table."""
from __future__ import annotations

import argparse
import os
import sys
from typing import TYPE_CHECKING, Any, Dict, List, Optional

from m2wr_navigation.barn.fields import fields
from m2wr_navigation.barn.page import barn_page
from m2wr_navigation.barn.runs import LIMIT, NAMES, jackal, run
from m2wr_navigation.barn.score import ranked
from m2wr_navigation.barn.worlds import optimal_time, reference_length, scene_of
from m2wr_navigation.compare.outputs import check_writable, write_json, write_text
from m2wr_navigation.compare.survey import Job, drive_all
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_node.interrupts import INTERRUPTED
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_navigation.barn.fields import Field

MOST_WORLDS, MOST_RUNS = 1000, 100


def _names(text: str) -> List[str]:
    names = [name for name in text.split(",") if name]
    for name in names:
        if name not in NAMES:
            raise argparse.ArgumentTypeError("there is no {!r}; known are {}".format(name, ", ".join(NAMES)))
    return names


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="barn", description="The BARN benchmark: a robot like a Jackal drives 10 m through fields of cylinders, "
        "by its laser and odometry. No ROS master is needed. After a stop the same command continues.")
    parser.add_argument("--worlds", type=int, default=50, metavar="N", help="generated worlds (default 50)")
    parser.add_argument("--runs", type=int, default=10, metavar="N", help="in each world (default 10)")
    parser.add_argument("--methods", type=_names, default=["move_base", "mppi"], metavar="NAMES",
                        help="names with commas between (default move_base,mppi): " + ", ".join(NAMES))
    parser.add_argument("--seed", type=int, default=0, help="of the worlds (default 0)")
    parser.add_argument("--jobs", type=int, default=len(os.sched_getaffinity(0)), metavar="N",
                        help="processes (default: the cores)")
    parser.add_argument("--max-vel-x", type=float, default=1.6, metavar="M_S",
                        help="greatest speed of methods; move_base has its own (default 1.6 m/s)")
    parser.add_argument("--max-vel-theta", type=float, default=3.0, metavar="RAD_S",
                        help="their greatest rate of turning (default 3 rad/s)")
    parser.add_argument("--save", default="", metavar="FOLDER", help="also write the worlds there, as SDF")
    parser.add_argument("--out", default="barn.html", metavar="FILE", help="page (default barn.html)")
    parser.add_argument("--json", default="", metavar="FILE", help="also write figures and paths to this file")
    return parser


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code: 1 if the benchmark cannot be run."""
    parser = _parser()
    options = parser.parse_args(argv)
    if not (1 <= options.worlds <= MOST_WORLDS and 1 <= options.runs <= MOST_RUNS and options.jobs >= 1):
        parser.error("--worlds {}, --runs {}, --jobs {}; expected 1 to {}, 1 to {}, and at least 1".format(
            options.worlds, options.runs, options.jobs, MOST_WORLDS, MOST_RUNS))
    if options.seed < 0 or not (0.05 <= options.max_vel_x <= 5.0 and 0.1 <= options.max_vel_theta <= 10.0):
        parser.error("--seed {}, --max-vel-x {}, --max-vel-theta {}; expected no negative seed, 0.05 to 5 m/s, 0.1 to "
                     "10 rad/s".format(options.seed, options.max_vel_x, options.max_vel_theta))
    try:
        for path in (options.out, options.json):
            if path:
                check_writable(path)
        compile_kernels()           # not measured
        return _benchmark(options)
    except (SimError, ValueError, OSError) as error:
        print("barn: {}".format(error), file=sys.stderr)
        return 1


def _benchmark(options: argparse.Namespace) -> int:
    """Run all, and write what was measured, also after Ctrl-C; return the exit code."""
    known: Dict[str, Field] = {}
    jobs: List[Job] = []
    robot = jackal(options.max_vel_x, options.max_vel_theta)
    if options.save:
        os.makedirs(options.save, exist_ok=True)
    for field in fields(options.worlds, options.seed):
        scene = scene_of(field)
        known[scene.name] = field
        jobs += [Job(scene, name, robot, LIMIT, seed) for name in options.methods for seed in range(options.runs)]
        if options.save:
            write_text(os.path.join(options.save, "barn_{}.world".format(field.number)), scene.world)
    optimal = {name: optimal_time(field) for name, field in known.items()}
    kept = os.path.splitext(options.out)[0] + ".runs.jsonl"
    records: List[Dict[str, Any]] = []
    code = 0
    try:
        for record, is_new in drive_all(jobs, kept, options.jobs, run):
            records.append(record)
            if is_new:
                print("%5d of %d  %-18s %-12s %-10s %5.1f s" % (
                    len(records), len(jobs), record["scene"], record["name"], record["outcome"], record["time"]),
                    flush=True)
    except KeyboardInterrupt:
        code = INTERRUPTED
    finally:
        if records:
            write_text(options.out, barn_page(known, records, optimal))
        if records and options.json:
            write_json(options.json, {"seed": options.seed, "worlds": [_world_record(field) for field in
                                                                       known.values()],
                                      "methods": ranked(records, optimal), "runs": records})
    for row in ranked(records, optimal):
        low, high = row["success_interval"]
        print("%-16s %4d of %-4d success %.3f (%.3f to %.3f)  %s  score %.3f" % (
            row["name"], row["successes"], row["runs"], row["success"], low, high,
            "" if row["time"][0] is None else "%.1f s" % row["time"][0], row["score"][0]))
    print("page: {}; the runs are kept in {}".format(options.out, kept))
    return code


def _world_record(field: Field) -> Dict[str, Any]:
    return {"name": scene_of(field).name, "fill": field.fill, "rounds": field.rounds, "cells": [
        "".join("#" if full else "." for full in row) for row in field.full.tolist()], "path": field.path,
        "length_m": reference_length(field), "optimal_time_s": optimal_time(field), "difficulty": field.measures}

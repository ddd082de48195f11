# SPDX-License-Identifier: BSD-3-Clause
"""``rosrun m2wr_navigation accuracy``: random goals by amcl and move_base in one process; errors by the truth."""
from __future__ import annotations

import argparse
import math
import os
import sys
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Optional

import numpy as np
import yaml

from m2wr_navigation.accuracy.driven import M2WR_DRIVEN, driven
from m2wr_navigation.accuracy.runs import drive_to_goals, random_goals
from m2wr_navigation.accuracy.scenes import NAMES, scene
from m2wr_navigation.accuracy.searches import search
from m2wr_navigation.compare.outputs import check_writable, write_json
from m2wr_navigation.kernel_warm_up import compile_kernels
from m2wr_sim.api.loading import package_folder
from m2wr_sim.errors import SimError

if TYPE_CHECKING:
    from m2wr_navigation.accuracy.driven import Driven
    from m2wr_navigation.accuracy.scenes import Scene

_HEAD = "%-10s %9s %9s %12s %12s %12s %8s %7s %8s" % (
    "world", "reached", "contacts", "amcl p50 cm", "amcl p95 cm", "amcl p95 deg", "found", "false", "after s")


def measure(place: Scene, goals: int, searches: int, seed: int, given: Mapping[str, Any],
            limit: float, robot: Driven = M2WR_DRIVEN) -> Dict[str, Any]:
    """Return the figures of one world.

    Parameters
    ----------
    place : Scene
    goals, searches : int
        How many of each.
    seed : int
    given : mapping of str to object
        Parameters of move_base; ``amcl`` holds those of amcl, if there are any.
    limit : float
        Simulated time of a search [s].
    robot : Driven
    """
    amcl = given.get("amcl", {})
    runs, errors = drive_to_goals(place, goals, seed, given, amcl, robot)
    found = [search(place, seed + number, amcl, limit, robot) for number in range(searches)]
    times = [each.time for each in found if each.found]
    return {
        "world": place.name, "goals": len(runs), "reached": sum(run.reached for run in runs),
        "contacts": sum(run.contacts for run in runs),
        "failed": [{"goal": run.goal, "outcome": run.outcome} for run in runs if not run.reached],
        "distance_m": {str(part): float(np.percentile(errors[:, 0], part)) for part in (50, 95)},
        "angle_deg": {str(part): math.degrees(float(np.percentile(errors[:, 1], part))) for part in (50, 95)},
        "searches": len(found), "found": len(times), "found_after_s": float(np.median(times)) if times else None,
        "falsely_claimed": sum(each.claimed and not each.found for each in found),
        "search_contacts": sum(each.contacts for each in found)}


def line(figures: Mapping[str, Any]) -> str:
    """Return a line of the table.

    Parameters
    ----------
    figures : mapping of str to object
        Of :func:`measure`.
    """
    after = figures["found_after_s"]
    return "%-10s %9s %9d %12.1f %12.1f %12.2f %8s %7s %8s" % (
        figures["world"], "%d of %d" % (figures["reached"], figures["goals"]), figures["contacts"],
        100.0 * figures["distance_m"]["50"], 100.0 * figures["distance_m"]["95"], figures["angle_deg"]["95"],
        "%d of %d" % (figures["found"], figures["searches"]) if figures["searches"] else "",
        figures["falsely_claimed"] if figures["searches"] else "", "" if after is None else "%.0f" % after)


def main(argv: Optional[List[str]] = None) -> int:
    """Run the command; return its exit code."""
    parser = argparse.ArgumentParser(prog="accuracy", description="Drives a robot to random goals with amcl and "
                                     "move_base in one process, and measures both against the truth.")
    parser.add_argument("--worlds", default=",".join(NAMES), help="names or files, with commas (default %(default)s)")
    parser.add_argument("--goals", type=int, default=20, help="in each world (default %(default)s)")
    parser.add_argument("--searches", type=int, default=10, help="of a robot that may be anywhere (%(default)s)")
    parser.add_argument("--limit", type=float, default=150.0, help="simulated time of a search [s] (%(default)s)")
    parser.add_argument("--seed", type=int, default=1, help="of goals, noise and particles (default %(default)s)")
    parser.add_argument("--config", default="", metavar="FILE", help="parameters of move_base, and of amcl below amcl; "
                        "config/m2wr.yaml by default")
    parser.add_argument("--robot", default="m2wr", metavar="FILE", help="name of a robot, or its URDF, xacro or SDF "
                        "file, with a differential drive and a laser; its footprint replaces that of --config")
    parser.add_argument("--json", default="", metavar="FILE", help="also write the figures to this file")
    options = parser.parse_args(argv)
    if options.goals < 1 or options.searches < 0 or not 0.0 < options.limit < 1e5:
        parser.error("expected --goals from 1, --searches from 0 and a --limit between 0 and 1e5 s")
    try:
        with open(options.config or os.path.join(package_folder("m2wr_navigation"), "config", "m2wr.yaml"),
                  encoding="utf-8") as stream:
            given = yaml.safe_load(stream)
        if not isinstance(given, dict) or not {"footprint", "global_costmap"} <= set(given):
            raise ValueError("{}: expected a mapping with footprint and global_costmap, at least".format(stream.name))
        robot = driven(options.robot)
        if robot is not M2WR_DRIVEN:
            given = robot.parameters(given)
        scenes = [scene(name, robot.height) for name in options.worlds.split(",")]
        for place in scenes:
            random_goals(place, 1, options.seed, robot)     # tells where there is no room, before the first drive
        if options.json:
            check_writable(options.json)
    except (OSError, SimError, ValueError, yaml.YAMLError) as error:
        print("accuracy: {}".format(error), file=sys.stderr)
        return 1
    compile_kernels()
    figures: List[Dict[str, Any]] = []
    print(_HEAD)
    for place in scenes:
        figures.append(measure(place, options.goals, options.searches, options.seed, given, options.limit, robot))
        print(line(figures[-1]), flush=True)
        for failed in figures[-1]["failed"]:
            print("  not reached: ({:.2f}, {:.2f}, {:.2f}): {}".format(*failed["goal"], failed["outcome"]))
    if options.json:
        write_json(options.json, figures)
    return 0 if all(each["reached"] == each["goals"] and not each["contacts"] for each in figures) else 2

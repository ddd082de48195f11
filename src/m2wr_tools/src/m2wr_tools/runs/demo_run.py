# SPDX-License-Identifier: BSD-3-Clause
"""The demonstration: Bug 2 from start to goal without a display; prints a table, draws a picture, keeps the bag."""
from __future__ import annotations

import math
import os
import sys
import time
from typing import TYPE_CHECKING

import roslib.packages

from m2wr_sim.errors import SimError
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.ros.shared_files import find_world, model_folders, package_folder
from m2wr_tools.runs.experiment import INTERRUPTED, free_port, resolve, run
from m2wr_tools.runs.summary import format_table, summarise
from m2wr_view.errors import ViewError
from m2wr_view.run_log import read_run
from m2wr_view.run_picture import draw_run

if TYPE_CHECKING:
    import argparse

    from m2wr_tools.runs.summary import Summary


def perform(options: argparse.Namespace) -> int:
    """Run Bug 2 and show the result; return 0 only if the goal was reached without contact."""
    folder = os.path.abspath(options.out)
    os.makedirs(folder, exist_ok=True)
    bag, picture = os.path.join(folder, "bug2.bag"), os.path.join(folder, "bug2.png")
    for stale in (bag, bag + ".active", picture):
        if os.path.exists(stale):
            os.remove(stale)
    factor = options.real_time_factor
    if factor is None:
        factor = 1.0 if options.live else 0.0
    began = time.monotonic()
    code = run(resolve("m2wr_sim", "bug2.launch"), [
        "world:=%s" % options.world, "initial_x:=%r" % options.start[0], "initial_y:=%r" % options.start[1],
        "initial_yaw:=%r" % options.yaw, "des_pos_x:=%r" % options.goal[0], "des_pos_y:=%r" % options.goal[1],
        "gui:=false", "real_time_factor:=%r" % factor, "lockstep:=true", "seed:=%d" % options.seed,
        "record:=%s" % bag, "exit_on_goal:=true", "live:=%s" % str(options.live).lower(),
        "live_port:=%d" % options.live_port], free_port(), options.timeout)
    wall = time.monotonic() - began
    if code == INTERRUPTED:
        return code                     # there is nothing to show yet
    try:
        share = package_folder()
        world = load_world(find_world(options.world, os.path.join(share, "worlds")),
                           resolve_model=model_folders(share))
        log = read_run(bag, start=tuple(options.start), goal=tuple(options.goal))
        summary = summarise(log, world)
        draw_run(log, obstacle_outlines(world), obstacle_outlines(world, high=math.inf), summary, picture)
    except (SimError, ViewError) as error:
        sys.stderr.write("demo: %s\n" % error)
        return code or 1
    print(format_table(summary))
    print("wall time %.1f s, picture %s, bag %s" % (wall, picture, bag))
    code = code or _verdict(summary)
    if options.live and not code:
        _replay(bag, options.live_port)
    return code


def _verdict(summary: Summary) -> int:
    """Return 0 if the goal was reached without contact, else 1 and say why not."""
    clear = summary.least_clearance is not None and summary.least_clearance > 0.0
    if summary.final_state != "goal_reached" or summary.contacts != 0 or not clear:
        sys.stderr.write("demo: the run ended as \"%s\" with %s contacts and a least clearance of %s m; expected "
                         "goal_reached, 0 and more than 0\n"
                         % (summary.final_state, "unknown" if summary.contacts is None else summary.contacts,
                            summary.least_clearance))
        return 1
    return 0


def _replay(bag: str, port: int) -> None:
    """Become the program that shows a recorded run in browsers until Ctrl-C; open pages connect to it again.

    Parameters
    ----------
    bag : str
        Its file.
    port : int
        Of the pages; 0: the first free one from 8080 on.
    """
    found = roslib.packages.find_node("m2wr_view", "live")
    if not found:
        sys.stderr.write("demo: there is no command \"live\" in m2wr_view; make build makes it\n")
        return
    print("the live view shows the recorded run now; Ctrl-C ends it", flush=True)
    os.execv(found[0], [found[0], "--bag", bag, "--port", str(port)])

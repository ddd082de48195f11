# SPDX-License-Identifier: BSD-3-Clause
"""The command line of ``compare_map``; what compares is imported after it has been read."""
from __future__ import annotations

import argparse
import math
import sys
from typing import List, Optional

import rosgraph

from m2wr_tools.robot_height import LASER_HEIGHT

_PURPOSE = "Compare a saved map, or all maps received on the topic map, with their world."


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code: 0, 1 where something cannot be read, 3 below ``--least``."""
    parser = argparse.ArgumentParser(prog="compare_map", description=_PURPOSE)
    add = parser.add_argument
    add("map", nargs="?", metavar="MAP.yaml", help="map as map_saver writes it")
    add("world", help="world file, or a name from m2wr_sim/worlds")
    add("--live", action="store_true", help="no file: every map on the topic map, until the node is stopped")
    add("--height", type=float, default=LASER_HEIGHT, help="of the laser above the floor [m] (%(default)s)")
    add("--offset", nargs=3, type=float, default=(0.0, 0.0, 0.0), metavar=("X", "Y", "YAW"),
        help="pose of the map frame in the world [m, rad] (0 0 0); the start pose if the odometry starts at zero")
    add("--picture", metavar="FILE.png", help="draw the map over the world")
    add("--least", type=float, default=0.0, help="exit code 3 if a smaller share (0 to 1) of the wall cells is correct")
    options = parser.parse_args(rosgraph.myargv(sys.argv)[1:] if argv is None else argv)
    if options.live == (options.map is not None):
        parser.error("expected either MAP.yaml or --live")
    if not all(map(math.isfinite, options.offset)):
        parser.error("--offset %s: expected finite numbers" % (options.offset,))
    from m2wr_tools.map_comparison.command import perform  # slow to import, and not needed for --help
    return perform(options)

# SPDX-License-Identifier: BSD-3-Clause
"""The command line of ``plot_map``; what draws is imported after it has been read."""
from __future__ import annotations

import argparse

from m2wr_tools.robot_height import LASER_HEIGHT

_PURPOSE = "Draw a saved map over the world it was made in, with the path of the robot."


def parser() -> argparse.ArgumentParser:
    """Return the command line's parser."""
    made = argparse.ArgumentParser(prog="plot_map", description=_PURPOSE)
    add = made.add_argument
    add("map", metavar="MAP.yaml", help="map as map_saver writes it")
    add("--world", metavar="WORLD|BAG", help="world file, name of a world of m2wr_sim, or a bag with "
        "/gazebo/world_markers")
    add("--trajectory", nargs="+", default=[], metavar="FILE",
        help="paths to draw, with lines 'stamp x y z qx qy qz qw' as slam_gmapping_replay writes them")
    add("--graph", metavar="FILE", help="pose graph to draw, as slam_gmapping_replay --graph writes it, or a saved "
        "state: nodes, loop closures, and candidates that were not accepted")
    add("--offset", nargs=3, type=float, default=(0.0, 0.0, 0.0), metavar=("X", "Y", "YAW"),
        help="pose of the map frame in the world [m, rad] (0 0 0)")
    add("--height", type=float, default=LASER_HEIGHT,
        help="of the laser above the floor, for world files [m] (%(default)s)")
    add("--out", metavar="FILE", help="picture, .png, .svg or .pdf (default: beside the map, MAP_plot.png)")
    add("--title", help="default: the names of map and world")
    return made


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    options = parser().parse_args()
    from m2wr_tools.map_figure.command import perform  # slow to import, and not needed for --help
    return perform(options)

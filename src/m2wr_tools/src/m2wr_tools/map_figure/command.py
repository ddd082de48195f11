# SPDX-License-Identifier: BSD-3-Clause
"""Draws a saved map over the world it was made in, with the path of the robot."""
from __future__ import annotations

import os
import sys
import zipfile
from typing import TYPE_CHECKING, List, Optional

from m2wr_files.state_file import StateError
from m2wr_gmapping import graph_view
from m2wr_maps.saved_map_reader import MapReadingError, read_map
from m2wr_tools.map_figure.arguments import parser
from m2wr_tools.map_figure.figure import FigureError, map_figure, write
from m2wr_tools.slam_benchmark.laser_logs import LogError
from m2wr_tools.slam_benchmark.trajectory_errors import trajectory
from m2wr_view.errors import ViewError
from m2wr_view.run_series import read_world

if TYPE_CHECKING:
    import argparse

    from m2wr_gmapping.graph_view import GraphView
    from m2wr_view.outlines import Outline


def read_outlines(world: str, height: float) -> List[Outline]:
    """Return the outlines of a world's obstacles.

    Parameters
    ----------
    world : str
        A bag, a world file, or the name of a world.
    height : float
        At which a world file is cut [m]; from a bag, all obstacles of a robot are taken.

    Raises
    ------
    FigureError, ViewError
        If it cannot be read.
    """
    if world.endswith(".bag"):
        solids = read_world(world)
        if solids is None:
            raise FigureError("bag {}: no message on /gazebo/world_markers; was that topic recorded?".format(world))
        return solids.blocking
    from m2wr_sim.errors import SimError  # slow to import, and needed for world files only
    from m2wr_tools.map_comparison.command import read_outlines as outlines_of_world
    try:
        return outlines_of_world(world, height)
    except SimError as error:
        raise FigureError(str(error)) from error


def read_graph(path: str) -> GraphView:
    """Return the pose graph in a file of the replay, or in a saved state.

    Parameters
    ----------
    path : str

    Raises
    ------
    GraphError, StateError
        If it cannot be read.
    """
    if not zipfile.is_zipfile(path):
        return graph_view.read(path)
    from m2wr_gmapping.io import state  # slow to import, and needed for states only
    mapper = state.load(path).mapper
    if mapper.filter is None:
        raise graph_view.GraphError("state {}: it has no nodes, no scan was processed".format(path))
    return graph_view.graph_of(mapper)


def _title(options: argparse.Namespace) -> str:
    """Return the title of the figure: the one that was asked for, or the names of map and world."""
    if options.title is not None:
        return options.title
    return " over ".join(os.path.basename(name) for name in (options.map, options.world) if name)


def main(arguments: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code."""
    return perform(parser().parse_args(arguments))


def perform(options: argparse.Namespace) -> int:
    """Draw what the options ask for; returns the exit code."""
    out = options.out or os.path.splitext(options.map)[0] + "_plot.png"
    try:
        saved = read_map(options.map)
        outlines = read_outlines(options.world, options.height) if options.world else ()
        ways = [(os.path.basename(path), trajectory(path)[1]) for path in options.trajectory]
        graph = read_graph(options.graph) if options.graph else None
        write(map_figure(saved, outlines, ways, options.offset, _title(options), graph), out)
    except (MapReadingError, FigureError, LogError, ViewError, graph_view.GraphError, StateError) as error:
        sys.stderr.write("plot_map: {}\n".format(error))
        return 1
    print(out)
    return 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: BSD-3-Clause
"""Compares maps with the world they were made in: a saved one, or all that are received on the topic ``map``."""
from __future__ import annotations

import os
import sys
import threading
from typing import TYPE_CHECKING, List, Optional, Sequence, Tuple

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from PIL import Image

from m2wr_maps.map_input import MapInputError, number, origin_of, read_pixels, read_values
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_sim.errors import SimError, WorldError
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.ros.shared_files import find_world, model_folders, package_folder
from m2wr_tools.map_comparison.agreement import SLICE, Truth, compare, format_agreement, picture

if TYPE_CHECKING:
    import argparse

    from m2wr_node.array_types import FloatArray, Int8Array
    from m2wr_sim.model.types import World
    from m2wr_view.outlines import Outline

SCALE = 3           # pixels a cell
LOOK = 0.5          # between two looks at whether ROS has ended [s], wall


def read_saved(path: str) -> Tuple[Int8Array, float, FloatArray]:
    """Return data (H, W) int8, resolution and origin (2,) of a map_saver YAML file; raises WorldError."""
    try:
        values = read_values(path)
        image = os.path.join(os.path.dirname(os.path.abspath(path)), values["image"])
        grey = read_pixels(image, lambda picture: "L")[::-1]
        resolution, origin = number(values, "resolution", 1e-6, 1e6), np.array(origin_of(values)[:2])
    except (OSError, MapInputError) as error:
        raise WorldError("%s: cannot be read as a map (%s); expected a YAML file of map_saver"
                         % (path, error)) from error
    return np.select([grey > 250, grey < 5], [0, 100], -1).astype(np.int8), resolution, origin


def read_world(world: str) -> World:
    """Return the World of a world file or name; raises WorldError."""
    share = package_folder()
    return load_world(find_world(world, os.path.join(share, "worlds")),
                      resolve_model=model_folders(share))


def read_truth(world: str, height: float, frame: Sequence[float] = (0.0, 0.0, 0.0)) -> Truth:
    """Return a world at the height of the laser, in the frame of a map.

    Parameters
    ----------
    world : str
        World file, or the name of a world.
    height : float
        Of the laser above the floor [m].
    frame : (3,) float
        Pose of the map's frame in the world [m, rad].

    Raises
    ------
    WorldError
        If the world cannot be read or has nothing at that height.
    """
    return Truth(read_world(world), height, frame)


def read_outlines(world: str, height: float) -> List[Outline]:
    """Return the outlines of all that a laser hits in a world.

    Parameters
    ----------
    world : str
        World file, or the name of a world.
    height : float
        Of the laser above the floor [m].

    Raises
    ------
    WorldError
        If the world cannot be read.
    """
    return obstacle_outlines(read_world(world), height - 0.5 * SLICE, height + 0.5 * SLICE)


def save_picture(path: str, data: Int8Array, resolution: float, origin: FloatArray, truth: Truth) -> None:
    """Draw a map over the truth into a file.

    Parameters
    ----------
    path : str
        File to write or read.
    data : (H, W) int8
        -1 unknown, 0 free, 100 occupied, lowest row first.
    resolution : float
        Side of a cell [m].
    origin : (2,) float
        Middle of cell (0, 0) in the frame of the map [m].
    truth : m2wr_tools.map_comparison.agreement.Truth
        The world in the frame of the map.
    """
    Image.fromarray(np.ascontiguousarray(picture(data, resolution, origin, truth).repeat(SCALE, 0).repeat(SCALE, 1))
                    ).save(path)


class LiveComparison:
    """Compares each received map with its world, and prints the last result at the end."""

    def __init__(self, truth: Truth) -> None:
        self._truth, self._news = truth, threading.Event()
        self._newest: Optional[OccupancyGrid] = None
        self._line: Optional[str] = None
        at_shutdown(self._news.set)
        rospy.Subscriber("map", OccupancyGrid, self._take, queue_size=1)

    def _take(self, message: OccupancyGrid) -> None:
        self._newest = message
        self._news.set()

    def run(self) -> int:
        """Compare until ROS ends; returns the exit code."""
        while not rospy.is_shutdown():
            self._news.wait(LOOK)           # shutdown hooks run before is_shutdown() returns True
            self._news.clear()
            message, self._newest = self._newest, None
            if message is not None:
                info = message.info
                data = np.array(message.data, np.int8).reshape(info.height, info.width)
                self._line = format_agreement(compare(
                    data, info.resolution, np.array([info.origin.position.x, info.origin.position.y]), self._truth))
                rospy.loginfo("map against world: %s", self._line)
        print("the last map against its world: %s" % (self._line or "there was none"))
        return 0


def perform(options: argparse.Namespace) -> int:
    """Compare what the options name; returns 0, 1 where something cannot be read, 3 below ``--least``."""
    try:
        truth = read_truth(options.world, options.height, options.offset)
        if options.live:
            start_node("compare_map", disable_rostime=True)
            return LiveComparison(truth).run()
        data, resolution, origin = read_saved(options.map)
    except (SimError, rospy.ROSException) as error:
        sys.stderr.write("compare_map: %s\n" % error)
        return 1
    found = compare(data, resolution, origin, truth)
    print(format_agreement(found))
    if options.picture:
        save_picture(options.picture, data, resolution, origin, truth)
    return 0 if found.on_walls >= options.least else 3

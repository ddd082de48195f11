# SPDX-License-Identifier: BSD-3-Clause
"""Compares maps with the world they were made in: a saved one, or all that come on the topic ``map``."""
import os
import sys
import threading

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid
from PIL import Image

from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node
from m2wr_sim.errors import SimError, WorldError
from m2wr_sim.model.outlines import obstacle_outlines
from m2wr_sim.model.sdf.loader import load_world
from m2wr_sim.ros.shared_files import find_world, model_folders, package_folder
from m2wr_tools.map_comparison.agreement import SLICE, Truth, compare, format_agreement, picture
from m2wr_view.map_input import MapInputError, number, origin_of, read_pixels, read_values

SCALE = 3           # pixels a cell
LOOK = 0.5          # between two looks at whether ROS has ended [s], wall


def read_saved(path):
    """Return data (H, W) int8, resolution and origin (2,) of a map_saver YAML file; raises WorldError."""
    try:
        values = read_values(path)
        image = os.path.join(os.path.dirname(os.path.abspath(path)), values["image"])
        grey = read_pixels(image, lambda picture: "L")[::-1]
        resolution, origin = number(values, "resolution", 1e-6, 1e6), np.array(origin_of(values)[:2])
    except (OSError, MapInputError) as error:
        raise WorldError("%s: no map that can be read (%s); expected a YAML file of map_saver"
                         % (path, error)) from error
    return np.select([grey > 250, grey < 5], [0, 100], -1).astype(np.int8), resolution, origin


def read_world(world):
    """Return the World of a world file or name; raises WorldError."""
    share = package_folder()
    return load_world(find_world(world, os.path.join(share, "worlds")),
                      resolve_model=model_folders(share))


def read_truth(world, height, frame=(0.0, 0.0, 0.0)):
    """Return the Truth of a world file or name in a frame of that pose (3,) in the world; raises WorldError."""
    return Truth(read_world(world), height, frame)


def read_outlines(world, height):
    """Return the outlines of all that a laser at a height [m] meets in a world; raises WorldError."""
    return obstacle_outlines(read_world(world), height - 0.5 * SLICE, height + 0.5 * SLICE)


def save_picture(path, data, resolution, origin, truth):
    """Draw the map over the truth into a file."""
    Image.fromarray(np.ascontiguousarray(picture(data, resolution, origin, truth).repeat(SCALE, 0).repeat(SCALE, 1))
                    ).save(path)


class LiveComparison:
    """Compares the newest map whenever one comes, and says how it was at the end."""

    def __init__(self, truth):
        self._truth, self._newest, self._news = truth, None, threading.Event()
        self._line = None
        at_shutdown(self._news.set)
        rospy.Subscriber("map", OccupancyGrid, self._take, queue_size=1)

    def _take(self, message):
        self._newest = message
        self._news.set()

    def run(self):
        """Compare until ROS ends; returns the exit code."""
        while not rospy.is_shutdown():
            self._news.wait(LOOK)           # what on_shutdown calls comes before is_shutdown() says so
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


def perform(options):
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

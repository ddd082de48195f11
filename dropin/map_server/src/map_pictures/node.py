# SPDX-License-Identifier: BSD-3-Clause
"""``map_server``: a saved map as a latched topic and a service."""
from __future__ import annotations

import sys
from typing import Sequence

import rospy
from nav_msgs.msg import MapMetaData, OccupancyGrid
from nav_msgs.srv import GetMap

from m2wr_maps.ros.message_conversion import ArrayGrid, ArrayMapAnswer, grid_message
from m2wr_node.ros.starting import start_node
from map_pictures.files import MapError, SavedMap, cells, read_map, read_picture

USAGE = "usage: map_server MAP.yaml\n       map_server IMAGE RESOLUTION\n"


def load(words: Sequence[str]) -> SavedMap:
    """Return the SavedMap named on the command line; raises MapError."""
    if len(words) == 1:
        return read_map(words[0])
    try:
        resolution = float(words[1])
    except ValueError:
        resolution = 0.0
    if not resolution > 0.0:
        raise MapError("resolution {!r}: expected a number above 0".format(words[1]))
    return SavedMap(cells(*read_picture(words[0])), resolution, (0.0, 0.0, 0.0))


def message_of(saved: SavedMap, frame: str) -> ArrayGrid:
    """Return the map as a message.

    Parameters
    ----------
    saved : SavedMap
    frame : str
        Frame of the map.
    """
    return grid_message(saved.data, saved.resolution, saved.origin, frame, rospy.Time.now())


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    words = rospy.myargv(sys.argv)[1:]
    if words in (["-h"], ["--help"]):
        sys.stdout.write(USAGE)
        return 0
    if len(words) not in (1, 2):
        sys.stderr.write(USAGE)
        return 2
    try:
        saved = load(words)
    except MapError as error:
        sys.stderr.write("map_server: %s\n" % error)
        return 1
    try:
        start_node("map_server")
        while not rospy.is_shutdown() and not rospy.get_time() and not rospy.rostime.is_wallclock():
            rospy.rostime.wallsleep(0.01)       # simulated time has not begun
    except rospy.ROSException:
        return 1
    message = message_of(saved, rospy.get_param("~frame_id", "map"))
    rospy.loginfo("read a map of %d x %d cells of %.3f m", message.info.width, message.info.height, saved.resolution)
    topic = rospy.Publisher("map", OccupancyGrid, queue_size=1, latch=True)
    info = rospy.Publisher("map_metadata", MapMetaData, queue_size=1, latch=True)
    rospy.Service("static_map", GetMap, lambda _: ArrayMapAnswer(message))
    topic.publish(message)
    info.publish(message.info)
    rospy.spin()
    return 0

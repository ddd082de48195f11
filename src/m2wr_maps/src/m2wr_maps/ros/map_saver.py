# SPDX-License-Identifier: BSD-3-Clause
"""``map_saver``: waits for a map and writes it as a picture and a YAML file."""
from __future__ import annotations

import argparse
import math
import sys
import threading
from typing import List, Sequence

import rospy

from m2wr_maps import map_file
from m2wr_maps.ros.message_conversion import ArrayGrid
from m2wr_node.ros.starting import start_node

WAIT_WARNING = 5.0      # [s], wall


def parse(arguments: Sequence[str]) -> argparse.Namespace:
    """Return the options of a command line without ROS arguments."""
    parser = argparse.ArgumentParser(prog="map_saver", description="Writes the map on the topic map (another one: "
                                     "map:=TOPIC) as NAME.pgm and NAME.yaml, both or neither.")
    parser.add_argument("-f", default="map", metavar="NAME", dest="name", help="file name without ending (map)")
    parser.add_argument("--occ", type=int, default=65, metavar="THRESHOLD", help="occupied from here on, 1 to 100 (65)")
    parser.add_argument("--free", type=int, default=25, metavar="THRESHOLD", help="free up to here, 0 to 100 (25)")
    options = parser.parse_args(arguments)
    if not 0 <= options.free < options.occ <= 100:
        parser.error("--free {} --occ {}: expected 0 <= free < occ <= 100".format(options.free, options.occ))
    return options


def save(message: ArrayGrid, options: argparse.Namespace) -> List[str]:
    """Write a map.

    Parameters
    ----------
    message : ArrayGrid
    options : argparse.Namespace
        Of :func:`parse`.

    Returns
    -------
    list of str
        The paths.

    Raises
    ------
    ValueError, MapFileError
        As of ``m2wr_maps.map_file.save``.
    """
    info = message.info
    data = message.data.reshape(info.height, info.width)
    turn = info.origin.orientation
    yaw = math.atan2(2.0 * (turn.w * turn.z + turn.x * turn.y), 1.0 - 2.0 * (turn.y ** 2 + turn.z ** 2))
    return map_file.save(options.name, data, info.resolution, (info.origin.position.x, info.origin.position.y, yaw),
                         options.free, options.occ)


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    options = parse(rospy.myargv(sys.argv)[1:])
    try:
        start_node("map_saver", anonymous=True, disable_rostime=True)
    except rospy.ROSException:
        return 1
    came = threading.Event()
    found: List[ArrayGrid] = []

    def take(message: ArrayGrid) -> None:
        if not came.is_set():
            found.append(message)
            came.set()

    subscriber = rospy.Subscriber("map", ArrayGrid, take, queue_size=1)
    rospy.loginfo("waiting for the map on %s", subscriber.resolved_name)
    waited = 0.0
    while not came.wait(0.1):
        if rospy.is_shutdown():
            rospy.logerr("no map received on %s; nothing was written", subscriber.resolved_name)
            return 1
        waited += 0.1
        if waited > WAIT_WARNING:
            rospy.logwarn_throttle(WAIT_WARNING, "no map on %s yet" % subscriber.resolved_name)
    message = found[0]
    rospy.loginfo("received a map of %d x %d cells of %.3f m", message.info.width, message.info.height,
                  message.info.resolution)
    try:
        for path in save(message, options):
            rospy.loginfo("wrote %s", path)
    except (OSError, ValueError) as error:
        rospy.logerr("%s", error)
        return 1
    return 0

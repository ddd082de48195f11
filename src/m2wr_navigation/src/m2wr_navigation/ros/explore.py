# SPDX-License-Identifier: BSD-3-Clause
"""``explore``: becomes another program, such as Bug 2, if the memory has no map; otherwise there is nothing to do."""
from __future__ import annotations

import argparse
import os
import sys
from typing import Optional

import rospkg
import rospy
from roslib.packages import find_node

from m2wr_lockstep.controller import Controller
from m2wr_navigation.best_path.memory import load
from m2wr_node.ros.starting import start_node
from m2wr_node.user_folder import from_user


def memory_folder(given: str, world: str) -> str:
    """Return the absolute path of the folder for map and experience.

    Parameters
    ----------
    given : str
        By the user, relative to the working folder of roslaunch; empty: ``best_path`` in ROS's folder.
    world : str
        Name or file of the world; it has a folder of its own in it.
    """
    top = from_user(given) if given else os.path.join(rospkg.get_ros_home(), "best_path")
    name = os.path.splitext(os.path.basename(world))[0]
    return os.path.join(top, name if name.strip(".") else "world")


def must_explore(folder: str) -> bool:
    """Return whether a folder has no usable map."""
    return load(folder, keep_damaged=False).cells is None


def main() -> int:
    """Entry point of the executable; returns the exit code."""
    words = rospy.myargv(sys.argv)[1:]
    parser = argparse.ArgumentParser(prog="explore", description="Run a node that explores, unless there is a map.")
    parser.add_argument("--memory", default="", help="folder with a folder for each world")
    parser.add_argument("--world", default="", help="name or file of the world")
    parser.add_argument("--map", default="", help="a map that is given; there is nothing to explore then")
    parser.add_argument("package", help="of the node that explores")
    parser.add_argument("node")
    options = parser.parse_args(words)
    if not options.map and must_explore(memory_folder(options.memory, options.world)):
        found = find_node(options.package, options.node)
        if not found:
            print("explore: there is no {} in {}".format(options.node, options.package), file=sys.stderr)
            return 1
        os.execv(found[0], [found[0]] + [word for word in sys.argv[1:] if word not in words])
    return _idle()


def _idle() -> int:
    """End; in lockstep stay, and answer each turn, for the simulator waits for this node."""
    start_node("bug2")
    rospy.loginfo("%s: there is a map, nothing has to be explored", rospy.get_name())
    if rospy.get_param("~lockstep", False) is not True:
        return 0
    controller = Controller()
    return controller.spin(_nothing, lambda: None) or 0


def _nothing(_now: float) -> Optional[int]:
    return None

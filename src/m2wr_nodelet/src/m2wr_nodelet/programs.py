# SPDX-License-Identifier: BSD-3-Clause
"""The programs of the package nodelet: they become a node that stands in, or the system's program."""
from __future__ import annotations

import os
import sys
from typing import List

import roslib.packages
import rospkg

from m2wr_nodelet.stand_in import node_for, remappings, system_program, wanted


def nodelet(arguments: List[str]) -> int:
    """Start a node in place of a nodelet, or else the system's program ``nodelet``.

    Parameters
    ----------
    arguments : list of str
        With the path of the program first.

    Returns
    -------
    int
        Exit code, if neither can be started.
    """
    name = wanted(arguments[1:])
    packages = rospkg.RosPack()
    node = node_for(name, packages) if name else None
    if node is None:
        return forward("nodelet", arguments)
    found = roslib.packages.find_node(node.package, node.node, packages)
    if not found:
        print("nodelet %s: package %s declares the node %s in its place, which is not built; run catkin build" % (
            name, node.package, node.node), file=sys.stderr)
        return 1
    return _become([found[0]] + remappings(arguments[1:]))


def forward(name: str, arguments: List[str]) -> int:
    """Start a program of the system's package nodelet.

    Parameters
    ----------
    name : str
    arguments : list of str
        With the path of the program first.

    Returns
    -------
    int
        Exit code, if it cannot be started.
    """
    path = system_program(name, arguments[0], os.environ)
    if path is None:
        print("the program %s of the package nodelet is not installed; install libnodeletlib-tools (Debian) or "
              "ros-noetic-nodelet (Ubuntu)" % name, file=sys.stderr)
        return 1
    return _become([path] + arguments[1:])


def _become(command: List[str]) -> int:
    try:
        os.execv(command[0], command)
    except OSError as error:
        print("%s cannot be started: %s" % (command[0], error), file=sys.stderr)
    return 1

# SPDX-License-Identifier: BSD-3-Clause
"""Where a missing ROS package is to be had."""
from __future__ import annotations

import os
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from m2wr_tools.doctor.machine import Machine

_NOETIC = "/opt/ros/noetic/setup.bash"
_LEGAL = re.compile(r"[a-zA-Z][a-zA-Z0-9_-]*\Z")
_FROM_SOURCE = ("Debian has no package of it: clone its source into the src folder of your workspace and build it, or "
                "take the element out of the launch file")
#: What does the same here for programs that exist on no supported platform without a desktop.
INSTEAD = {
    "rqt_robot_steering": "it is a window; drive in the live view (live:=true), or: rosrun teleop_twist_keyboard "
                          "teleop_twist_keyboard.py",
    "rqt_graph": "it is a window; rosnode list, rosnode info NODE; rosrun m2wr_sim doctor looks for missing links",
    "rqt_tf_tree": "it is a window; rosrun tf2_tools view_frames.py writes the tree to frames.pdf",
    "rqt_reconfigure": "it is a window; rosrun dynamic_reconfigure dynparam list, get, set",
    "rqt_plot": "it is a window; rostopic echo -p TOPIC writes a table; Foxglove draws (docs/how-to/bridges.md)",
    "rqt_console": "it is a window; rostopic echo /rosout",
    "rqt_controller_manager": "it is a window; rosrun controller_manager controller_manager list",
    "rqt_joint_trajectory_controller": "it is a window; rostopic pub CONTROLLER/command",
    "rqt_image_view": "it is a window; Foxglove shows images (docs/how-to/bridges.md)",
    "rqt_gui": "it is a window; the live view (live:=true) and Foxglove show the same",
}


def how_to_get(machine: Machine, package: str) -> str:
    """Return what to do about a missing package.

    Parameters
    ----------
    machine : Machine
        Asked for the packages of its distribution; nothing is downloaded.
    package : str
        ROS package.
    """
    if not _LEGAL.match(package):
        return "correct its name: a package name has letters, digits and _"
    if package in INSTEAD:
        return INSTEAD[package]
    stand_in = _stand_in(machine, package)
    if stand_in:
        return stand_in
    dashed = package.replace("_", "-").lower()
    if machine.exists(_NOETIC):
        return "sudo apt install ros-noetic-%s; if there is none: clone its source into src and build it" % dashed
    known = _debian(machine, dashed)
    return "sudo apt install %s" % known if known else _FROM_SOURCE


def _stand_in(machine: Machine, package: str) -> str:
    """Return what to do if the workspace has a stand-in that is not built."""
    for prefix in machine.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
        folder = os.path.join(os.path.dirname(prefix.rstrip("/")), "dropin", package)
        if prefix and machine.exists(os.path.join(folder, "package.xml")):
            return "the workspace has a stand-in: make build, then source devel/setup.bash again"
    return ""


def _debian(machine: Machine, dashed: str) -> str:
    """Return the Debian packages of a ROS package, from apt's local lists, or an empty text."""
    names = [pattern % dashed for pattern in ("%s", "ros-%s", "python3-%s", "lib%s-dev", "lib%s-tools", "%s-tools")]
    code, text = machine.run(["apt-cache", "show", "--no-all-versions"] + names)
    if code is None:
        return ""
    found = []
    for paragraph in text.split("\n\n"):
        name = re.search(r"^Package: (\S+)$", paragraph, re.MULTILINE)
        if name and name.group(1) in names and ("Robot OS" in paragraph or "(ROS)" in paragraph):
            found.append(name.group(1))
    return " ".join(sorted(set(found)))

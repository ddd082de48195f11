# SPDX-License-Identifier: BSD-3-Clause
"""The command ``controller_manager``."""
from __future__ import annotations

import argparse
import sys
from typing import List, Optional

import rospy

from controller_manager import controller_manager_interface as interface


def main(words: Optional[List[str]] = None) -> int:
    """Run the command; returns 0, or 1 if something failed."""
    words = rospy.myargv(sys.argv)[1:] if words is None else words
    parser = argparse.ArgumentParser(prog="controller_manager", description="List, load, start, stop and unload "
                                     "controllers of a simulated robot.")
    commands = parser.add_subparsers(dest="command", metavar="COMMAND")
    commands.required = True
    for name, alias, text in (("list", "lc", "loaded controllers"), ("list-types", "lt", "types that can be loaded")):
        commands.add_parser(name, aliases=[alias], help=text)
    for name, aliases, text in (("load", [], "load"), ("unload", [], "unload"), ("start", [], "start"),
                                ("stop", [], "stop"), ("spawn", ["sp"], "load and start"),
                                ("kill", ["kl"], "stop and unload")):
        commands.add_parser(name, aliases=aliases, help=text).add_argument("name", nargs="+")
    reload = commands.add_parser("reload-libraries", help="unload all controllers")
    reload.add_argument("--restore", action="store_true", help="load and start them again")
    arguments = parser.parse_args(words)
    try:
        rospy.init_node("controller_manager_command", anonymous=True, disable_rosout=True)
        return 0 if _run(arguments) else 1
    except (rospy.ROSException, rospy.ServiceException) as error:
        print("controller_manager: %s. Is there a master, and a robot with libgazebo_ros_control.so in this namespace, "
              "%s?" % (error, rospy.get_namespace()), file=sys.stderr)
        return 1


def _run(arguments: argparse.Namespace) -> bool:
    command = arguments.command
    if command in ("list", "lc"):
        interface.list_controllers()
        return True
    if command in ("list-types", "lt"):
        interface.list_controller_types()
        return True
    if command == "reload-libraries":
        return interface.reload_libraries(True, arguments.restore)
    names = arguments.name
    if command in ("load", "unload"):
        one = interface.load_controller if command == "load" else interface.unload_controller
        return all([one(name) for name in names])
    if command in ("start", "stop"):
        return interface.start_stop_controllers(names, command == "start")
    if command in ("spawn", "sp"):
        return all([interface.load_controller(name) for name in names]) and interface.start_controllers(names)
    return interface.stop_controllers(names) and all([interface.unload_controller(name) for name in names])

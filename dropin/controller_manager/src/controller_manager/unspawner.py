# SPDX-License-Identifier: BSD-3-Clause
"""The node ``unspawner``: stops controllers, and starts them again at its end."""
from __future__ import annotations

import argparse
import sys
from typing import List, Optional

import rospy

from controller_manager import controller_manager_interface as interface
from controller_manager.spawner import wait_for_manager, within

_AGAIN = 3.0            # s between two calls, because another node may start them
_FAREWELL = 2.0         # s of wall time for the call at the end
_BEST_EFFORT = 1


def main(words: Optional[List[str]] = None) -> int:
    """Run the node; returns 1 if there is no controller manager."""
    words = rospy.myargv(sys.argv)[1:] if words is None else words
    parser = argparse.ArgumentParser(prog="unspawner", description="Stop controllers, and start them again when this "
                                     "node ends.")
    parser.add_argument("controllers", nargs="+", metavar="NAME")
    names = parser.parse_args(words).controllers
    rospy.init_node("unspawner", anonymous=True)
    prefix = rospy.resolve_name("").rstrip("/")
    if not wait_for_manager(prefix, 30.0):
        return 0 if rospy.is_shutdown() else 1
    stopped: List[str] = []

    def restart() -> None:
        if stopped:
            within(_FAREWELL, lambda: interface.call("switch_controller", stopped, [], _BEST_EFFORT, False, 0.0,
                                                     namespace=prefix))

    rospy.on_shutdown(restart)
    try:
        while not rospy.is_shutdown():
            _stop(names, stopped, prefix)
            _rest(_AGAIN)
    except (OSError, rospy.ROSException, rospy.ServiceException) as error:
        if not rospy.is_shutdown():
            rospy.logerr("unspawner: %s. Has the simulator ended?", error)
            return 1
    return 0


def _stop(names: List[str], stopped: List[str], prefix: str) -> None:
    """Stop those controllers that are running, and add them to ``stopped``."""
    running = {controller.name for controller in interface.call("list_controllers", namespace=prefix).controller
               if controller.state == "running"}
    wanted = [name for name in names if name in running]
    if wanted and interface.call("switch_controller", [], wanted, _BEST_EFFORT, False, 0.0, namespace=prefix).ok:
        rospy.loginfo("Stopped controllers: %s", ", ".join(wanted))
        stopped.extend(name for name in wanted if name not in stopped)


def _rest(seconds: float) -> None:
    """Wait in wall time; returns early when the node ends."""
    steps = int(seconds / 0.1)
    for _ in range(steps):
        if rospy.is_shutdown():
            return
        rospy.rostime.wallsleep(0.1)

# SPDX-License-Identifier: BSD-3-Clause
"""The node ``spawner``: loads and starts controllers, and stops and unloads them at its end."""
from __future__ import annotations

import argparse
import functools
import os
import sys
import threading
import time
from typing import Any, Callable, List, Optional

import rosgraph
import rosparam
import rospy
from std_msgs.msg import Bool

from controller_manager import controller_manager_interface as interface

_PAUSE = 0.2            # s of wall time between two looks for services
_FAREWELL = 2.0         # s of wall time for a call at the end, when the simulator may be gone
_STRICT, _BEST_EFFORT = 2, 1


def main(words: Optional[List[str]] = None) -> int:
    """Run the node; returns 1 if there is no controller manager, or no controller could be started."""
    words = rospy.myargv(sys.argv)[1:] if words is None else words
    arguments = _parse(words)
    rospy.init_node("spawner", anonymous=True)
    if arguments.wait_for and not _wait_for(arguments.wait_for):
        return 0
    prefix = rospy.resolve_name(arguments.namespace or "").rstrip("/")
    try:
        return _spawn(arguments, prefix)
    except (OSError, rosgraph.MasterException, rospy.ROSException, rospy.ServiceException) as error:
        if not rospy.is_shutdown():
            rospy.logerr("Controller Spawner: %s. Has the simulator ended?", error)
            return 1
    return 0


def _spawn(arguments: argparse.Namespace, prefix: str) -> int:
    """Load and start the controllers, and wait for the end of the node; returns its exit code."""
    limit = None if arguments.no_timeout else arguments.timeout
    if not wait_for_manager(prefix, limit):
        return 0 if rospy.is_shutdown() else 1
    loaded = [name for name in _names(arguments.controllers, prefix) if _load(name, prefix)]
    if not loaded:
        return 1
    rospy.on_shutdown(lambda: remove(loaded, prefix))
    if not arguments.stopped:
        if not interface.call("switch_controller", loaded, [], _STRICT, False, 0.0, namespace=prefix).ok:
            rospy.logerr("Failed to start controllers: %s. The log of the simulator gives the reason.",
                         ", ".join(loaded))
            return 1
        rospy.loginfo("Started controllers: %s", ", ".join(loaded))
    rospy.spin()
    return 0


def _parse(words: List[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="spawner", description="Load and start controllers of a simulated robot; "
                                     "stop and unload them when this node ends.")
    parser.add_argument("--stopped", action="store_true", help="load the controllers, but do not start them")
    parser.add_argument("--wait-for", metavar="TOPIC", help="wait until this topic (std_msgs/Bool) is true")
    parser.add_argument("--namespace", metavar="NS", help="namespace of the controller manager")
    parser.add_argument("-t", "--timeout", metavar="T", type=float, default=30.0,
                        help="how long to wait for the controller manager [s] (default: %(default)s)")
    parser.add_argument("--no-timeout", action="store_true", help="wait for the controller manager without an end")
    parser.add_argument("--shutdown-timeout", help=argparse.SUPPRESS)       # has no effect, as in ros_control
    parser.add_argument("controllers", nargs="+", metavar="NAME", help="a controller, or a YAML file with controllers")
    return parser.parse_args(words)


def _wait_for(topic: str) -> bool:
    """Wait until a topic is true; return whether it is, or the node ends."""
    came = threading.Event()
    subscriber = rospy.Subscriber(topic, Bool, lambda message: came.set() if message.data else None)
    while not rospy.is_shutdown() and not came.wait(_PAUSE):
        pass
    subscriber.unregister()
    return came.is_set()


def managers() -> List[str]:
    """Return the namespaces of the robots that have a controller manager."""
    services = rosgraph.Master(rospy.get_name()).getSystemState()[2]
    end = "/controller_manager/load_controller"
    return sorted(name[:-len(end)] or "/" for name, _ in services if name.endswith(end))


def wait_for_manager(prefix: str, limit: Optional[float]) -> bool:
    """Wait for the services of a controller manager.

    Parameters
    ----------
    prefix : str
        Namespace of the robot, without a slash at its end.
    limit : float or None
        [s] of wall time; None: no limit.

    Returns
    -------
    bool
        Whether they are there; if not, what was found is logged.
    """
    began = time.monotonic()
    simulated = rospy.get_param("/use_sim_time", False)
    rospy.loginfo("Controller Spawner: Waiting for service %s/controller_manager/load_controller", prefix)
    while not rospy.is_shutdown():
        if (prefix or "/") in managers():
            return True
        if limit is not None and time.monotonic() - began > limit:
            if not (simulated and rospy.get_time() == 0.0):
                _report_missing(prefix)
                return False
            rospy.logwarn("Controller Spawner: Waiting for /clock to be available... Is the simulator running?")
            began = time.monotonic()
        time.sleep(_PAUSE)
    return False


def _report_missing(prefix: str) -> None:
    found = ", ".join(managers()) or "none"
    rospy.logerr("Controller Spawner couldn't find the expected controller_manager ROS interface. There is no service "
                 "%s/controller_manager/load_controller; robots with a controller manager: %s. It comes with a spawned "
                 "robot whose description has the plugin libgazebo_ros_control.so.", prefix, found)


def _names(words: List[str], prefix: str) -> List[str]:
    """Return the names of controllers; those of YAML files after their parameters were set."""
    found: List[str] = []
    for word in words:
        if not os.path.isfile(word):
            found.append(word)
            continue
        try:
            documents = rosparam.load_file(word, prefix or "/")
        except rosparam.RosParamException as error:
            rospy.logerr("%s: %s; expected YAML with the parameters of controllers", word, error)
            continue
        for values, namespace in documents:
            if not isinstance(values, dict):
                rospy.logerr("%s: read no mapping; expected names of controllers with their parameters", word)
                continue
            rosparam.upload_params(namespace, values)
            found.extend(str(name) for name in values)
    return found


def _load(name: str, prefix: str) -> bool:
    done = interface.call("load_controller", name, namespace=prefix).ok
    if done:
        rospy.loginfo("Loaded %s", name)
    else:
        rospy.logerr("Failed to load %s; the log of the simulator gives the reason", name)
    return done


def within(limit: float, function: Callable[[], Any]) -> bool:
    """Return whether a function, called in a thread, returned within a time, without an exception.

    Parameters
    ----------
    limit : float
        [s] of wall time.
    function : callable
    """
    done = threading.Event()

    def run() -> None:
        try:
            function()
        except (rospy.ROSException, rospy.ServiceException, rospy.ROSInterruptException):
            return
        done.set()

    threading.Thread(target=run, daemon=True).start()
    return done.wait(limit)


def remove(names: List[str], prefix: str) -> None:
    """Stop and unload controllers, in the reverse order; a simulator that is gone is not waited for.

    Parameters
    ----------
    names : list of str
    prefix : str
        Namespace of the robot, without a slash at its end.
    """
    backwards = list(reversed(names))
    if not within(_FAREWELL, lambda: interface.call("switch_controller", [], backwards, _BEST_EFFORT, False, 0.0,
                                                    namespace=prefix)):
        return
    for name in backwards:
        within(_FAREWELL, functools.partial(interface.call, "unload_controller", name, namespace=prefix))

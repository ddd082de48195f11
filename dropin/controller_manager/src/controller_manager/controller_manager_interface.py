# SPDX-License-Identifier: BSD-3-Clause
"""Functions that call the services of ``controller_manager``, relative to the namespace of the node."""
from __future__ import annotations

from typing import Any, Dict, List, Sequence

import rospy
from controller_manager_msgs.srv import (
    ListControllers,
    ListControllerTypes,
    LoadController,
    ReloadControllerLibraries,
    SwitchController,
    SwitchControllerRequest,
    UnloadController,
)

WAIT = 10.0                 # s of wall time for a service

_CLASSES: Dict[str, Any] = {
    "list_controllers": ListControllers, "list_controller_types": ListControllerTypes,
    "load_controller": LoadController, "unload_controller": UnloadController,
    "switch_controller": SwitchController, "reload_controller_libraries": ReloadControllerLibraries}


def call(service: str, *values: Any, namespace: str = "") -> Any:
    """Return the reply of a service of a controller manager.

    Parameters
    ----------
    service : str
        Such as ``load_controller``.
    *values : object
        Fields of the request.
    namespace : str
        Of the robot; empty: that of the node.

    Raises
    ------
    rospy.ROSException
        If the service does not appear within :data:`WAIT`.
    rospy.ServiceException
        If the call fails.
    """
    name = rospy.resolve_name("/".join(part for part in (namespace.rstrip("/"), "controller_manager", service) if part))
    rospy.wait_for_service(name, WAIT)
    return rospy.ServiceProxy(name, _CLASSES[service])(*values)


def list_controller_types() -> None:
    """Print all types of controllers that can be loaded."""
    for name in call("list_controller_types").types:
        print(name)


def list_controllers() -> None:
    """Print all loaded controllers."""
    controllers = call("list_controllers").controller
    if not controllers:
        print("No controllers are loaded in mechanism control")
    for controller in controllers:
        for claimed in controller.claimed_resources:
            print("'%s' - '%s' ( %s )" % (controller.name, claimed.hardware_interface, controller.state))


def load_controller(name: str) -> bool:
    """Load a controller, and print the result."""
    done = call("load_controller", name).ok
    print("Loaded '%s'" % name if done else "Error when loading '%s'; see the log of the simulator" % name)
    return done


def unload_controller(name: str) -> bool:
    """Unload a controller, and print the result."""
    done = call("unload_controller", name).ok
    print("Unloaded '%s' successfully" % name if done else
          "Error when unloading '%s'; see the log of the simulator" % name)
    return done


def start_controller(name: str) -> bool:
    """Start a controller."""
    return start_stop_controllers([name], True)


def start_controllers(names: Sequence[str]) -> bool:
    """Start several controllers, all or none."""
    return start_stop_controllers(names, True)


def stop_controller(name: str) -> bool:
    """Stop a controller."""
    return start_stop_controllers([name], False)


def stop_controllers(names: Sequence[str]) -> bool:
    """Stop several controllers, all or none."""
    return start_stop_controllers(names, False)


def start_stop_controllers(names: Sequence[str], st: bool) -> bool:
    """Return whether controllers could be started or stopped, and print it.

    Parameters
    ----------
    names : sequence of str
    st : bool
        Whether to start them.
    """
    start, stop = (list(names), []) if st else ([], list(names))
    done = call("switch_controller", start, stop, SwitchControllerRequest.STRICT, False, 0.0).ok
    word = "start" if st else "stop"
    print("%sed %s successfully" % ("Start" if st else "Stopp", list(names)) if done else
          "Error when %sing %s; see the log of the simulator" % (word if st else "stopp", list(names)))
    return done


def reload_libraries(force_kill: bool, restore: bool = False) -> bool:
    """Return whether all controllers could be unloaded, if ``force_kill``; ``restore`` loads and starts them again.

    Parameters
    ----------
    force_kill, restore : bool
    """
    before: List[Any] = call("list_controllers").controller if restore else []
    running = [controller.name for controller in before if controller.state == "running"]
    if force_kill and running:
        stop_controllers(running)
    done = call("reload_controller_libraries", force_kill).ok
    print("Successfully reloaded libraries" if done else "Failed to reload libraries. Do you still have controllers "
          "loaded?")
    for controller in before if done and force_kill else []:
        load_controller(controller.name)
    if done and force_kill and running:
        start_controllers(running)
    return done

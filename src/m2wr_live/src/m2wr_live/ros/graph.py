# SPDX-License-Identifier: BSD-3-Clause
"""Asks master and parameter server for what a page lists: nodes, frames, parameters, controllers."""
from __future__ import annotations

import logging
from typing import Any, Callable, Dict, List, Mapping

import rosgraph
import roslib.message
import rospy

from m2wr_live.scene import overview
from m2wr_sim.errors import SimError
from m2wr_tools.service_client import Connection

log = logging.getLogger("m2wr_live")

MOST_NODES = 30             # whose parameters, or controllers, are asked for
_UPDATES = "/parameter_updates"             # topic of a node with dynamic parameters
_LIST = "/list_controllers"                 # service of a controller manager


def read_overview(node: str, parents: Mapping[str, str]) -> List[overview.Section]:
    """Return what there is now; asks the master, and each controller manager.

    Parameters
    ----------
    node : str
        Name of this node.
    parents : mapping of str to str
        Parent of each frame that has one.

    Raises
    ------
    rosgraph.MasterException, OSError
        If the master does not answer.
    """
    published, subscribed, services = rosgraph.Master(node).getSystemState()
    nodes = [topic[:-len(_UPDATES)] for topic, _ in published if topic.endswith(_UPDATES)]
    values: Dict[str, Dict[str, object]] = {}
    for name in sorted(nodes)[:MOST_NODES]:
        found = rospy.get_param(name, {}) if name else {}
        if isinstance(found, dict):
            values[name] = found
    managers = sorted(name[:-len(_LIST)] for name, _ in services if name.endswith(_LIST))[:MOST_NODES]
    return [overview.nodes_section(published, subscribed), overview.frames_section(parents),
            overview.parameters_section(values), overview.controllers_section(_controllers(managers, _ask))]


def _ask(name: str) -> Any:
    kind = roslib.message.get_service_class("controller_manager_msgs/ListControllers")
    if kind is None:
        raise ImportError("the package controller_manager_msgs is not there")
    connection = Connection(name, kind)
    try:
        return connection()
    finally:
        connection.close()


def _controllers(managers: List[str], ask: Callable[[str], Any]) -> Dict[str, List[overview.Controller]]:
    """Return the controllers of each manager that answers."""
    found: Dict[str, List[overview.Controller]] = {}
    for manager in managers:
        try:
            answer = ask(manager + _LIST)
        except (ImportError, SimError) as error:    # no such messages here, or it has just ended
            log.debug("%s: %s", manager, error)
            continue
        found[manager] = [overview.Controller(one.name, one.type, one.state, tuple(
            joint for claim in one.claimed_resources for joint in claim.resources)) for one in answer.controller]
    return found

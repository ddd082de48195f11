# SPDX-License-Identifier: BSD-3-Clause
"""The recovery behaviours of move_base: which ones, their parameters, and what they may do to the costmaps."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence, Tuple

import rospy

from m2wr_navigation import registry
from m2wr_navigation.parameters import read
from m2wr_navigation.recoveries.recovery import Costmaps, Recovery
from m2wr_navigation.ros.transforms import TransformError

if TYPE_CHECKING:
    from m2wr_navigation.ros.costmap_server import CostmapServer

CLEAR, ROTATE = "clear_costmap_recovery/ClearCostmapRecovery", "rotate_recovery/RotateRecovery"
BACK_UP = "m2wr_navigation/BackUpRecovery"


class BothCostmaps(Costmaps):
    """The global and the local costmap of a node.

    Parameters
    ----------
    servers : mapping of str to CostmapServer
        ``global`` and ``local``.
    """

    def __init__(self, servers: Mapping[str, CostmapServer]) -> None:
        self._servers = servers

    def layer_names(self, which: str) -> List[str]:
        return [layer.name for layer in self._servers[which].costmap.obstacle_layers()]

    def clear(self, which: str, layers: Sequence[str], side: float, inside: bool) -> int:
        server = self._servers[which]
        try:
            pose = server.pose()
        except TransformError as error:
            rospy.logwarn("the %s costmap is not cleared: %s", which, error)
            return 0
        return server.costmap.clear_area(list(layers), pose, side, inside)


def default_list(values: Mapping[str, Any], circumscribed: float) -> List[Tuple[str, str, Dict[str, Any]]]:
    """Return name, type and parameters of the behaviours that move_base has without ``recovery_behaviors``.

    They are those of the original and, after the first turn, ``back_up``. It does nothing where the robot can turn.
    Where it cannot, neither turns nor cleared costmaps help, and few controllers back.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of move_base.
    circumscribed : float
        Circumscribed radius of the robot [m].
    """
    turn: List[Tuple[str, str, Dict[str, Any]]] = []
    back: List[Tuple[str, str, Dict[str, Any]]] = []
    if values["clearing_rotation_allowed"]:
        turn.append(("rotate_recovery", ROTATE, {}))
        back.append(("back_up", BACK_UP, {}))
    return [("conservative_reset", CLEAR, {"reset_distance": values["conservative_reset_dist"]}), *turn, *back,
            ("aggressive_reset", CLEAR, {"reset_distance": 4.0 * circumscribed}), *turn]


def listed(given: Any) -> Tuple[List[Tuple[str, str, Dict[str, Any]]], str]:
    """Return the behaviours of ``recovery_behaviors``, and why it cannot be used, if so.

    Parameters
    ----------
    given : object
        A list of {name, type}.
    """
    found: List[Tuple[str, str, Dict[str, Any]]] = []
    for entry in given if isinstance(given, list) else [given]:
        if not (isinstance(entry, dict) and isinstance(entry.get("name"), str) and isinstance(entry.get("type"), str)):
            return [], "it has the entry {!r}; expected a name and a type".format(entry)
        if entry["name"] in (name for name, _, _ in found):
            return [], "the name {} is there twice".format(entry["name"])
        found.append((entry["name"], entry["type"], {}))
    return found, ""


def make_recoveries(values: Mapping[str, Any], circumscribed: float, costmaps: Costmaps) -> List[Recovery]:
    """Return the recovery behaviours of this node's parameters.

    Parameters
    ----------
    values : mapping of str to object
        Parameters of move_base.
    circumscribed : float
        [m]
    costmaps : Costmaps
    """
    wanted = default_list(values, circumscribed)
    if rospy.has_param("~recovery_behaviors"):
        own, fault = listed(rospy.get_param("~recovery_behaviors"))
        if fault:
            rospy.logwarn("parameter ~recovery_behaviors is not used, but the default: %s", fault)
        else:
            wanted = own
    made: List[Recovery] = []
    for name, kind_name, defaults in wanted:
        try:
            kind = registry.find(registry.RECOVERIES, kind_name)
        except registry.UnknownPluginError as error:
            rospy.logwarn("recovery behaviour %s is left out: %s", name, error)
            continue
        given = rospy.get_param("~" + name, {})
        merged = dict(defaults, **(given if isinstance(given, dict) else {}))
        if kind_name == ROTATE:         # the real one reads the limits of the base from there
            base = rospy.get_param("~TrajectoryPlannerROS", {})
            merged = dict(base if isinstance(base, dict) else {}, **merged)
        settings, warnings = read(kind.PARAMETERS, merged, "~" + name)
        for sentence in warnings:
            rospy.logwarn("%s", sentence)
        made.append(kind(name, settings, costmaps))
    return made

# SPDX-License-Identifier: BSD-3-Clause
"""The recovery behaviours of move_base by its parameters, and what they may do to the costmaps."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, List, Mapping, Sequence

import rospy

from m2wr_navigation.recoveries.behaviours import made
from m2wr_navigation.recoveries.recovery import Costmaps
from m2wr_navigation.ros.transforms import TransformError

if TYPE_CHECKING:
    from m2wr_navigation.recoveries.recovery import Recovery
    from m2wr_navigation.ros.costmap_server import CostmapServer


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
    recoveries, warnings = made(values, circumscribed, costmaps, lambda name: rospy.get_param("~" + name, None))
    for sentence in warnings:
        rospy.logwarn("%s", sentence)
    return recoveries

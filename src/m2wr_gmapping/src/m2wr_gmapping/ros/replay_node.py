# SPDX-License-Identifier: BSD-3-Clause
"""The replay as a node: with parameters from the server, and its map on topics and a service.

It is used in launch files, with ``--on_done``, and if no file was requested. Otherwise the replay needs no master.
"""
from __future__ import annotations

import logging
from typing import TYPE_CHECKING, Any, Callable, Dict, Optional, Sequence

import rospy

from m2wr_gmapping.ros.node_parameters import NODE_PARAMETERS, private_parameters
from m2wr_gmapping.ros.outputs import MapTopics
from m2wr_node.ros.shutdown import at_shutdown
from m2wr_node.ros.starting import start_node

if TYPE_CHECKING:
    from m2wr_maps.saved_map import SavedMap

NAME = "slam_gmapping"


class ReplayNode:
    """Registers the node ``slam_gmapping``, or the name and the remappings of the command line.

    Parameters
    ----------
    loggers : sequence of str
        Loggers whose output goes to the screen and to /rosout; registering a node removes other handlers.
    """

    def __init__(self, loggers: Sequence[str]) -> None:
        start_node(NAME)
        rosout = logging.getLogger("rosout")
        for name in loggers:
            logging.getLogger(name).handlers, logging.getLogger(name).propagate = rosout.handlers, rosout.propagate
        self._topics: Optional[MapTopics] = None

    def parameters(self) -> Dict[str, Any]:
        """Return the filter's private parameters of the server, which include those of the command line."""
        own = set(NODE_PARAMETERS) - {"settle_time"}
        return {name: value for name, value in private_parameters().items() if name not in own}

    def show(self, grid: SavedMap, entropy: float, frame: str) -> None:
        """Publish a map, and return it in answers of the service.

        Parameters
        ----------
        grid : SavedMap
        entropy : float
            Entropy of the particles' weights.
        frame : str
            Frame of the map.
        """
        if self._topics is None:
            self._topics = MapTopics(frame)
        try:
            self._topics.publish(grid, entropy)
        except rospy.ROSException:
            if not rospy.is_shutdown():
                raise

    def on_end(self, stop: Callable[[], object]) -> None:
        """Call ``stop`` when ROS ends the node."""
        at_shutdown(stop)

    def stay(self) -> None:
        """Keep the map on the topics until the node is shut down."""
        rospy.loginfo("the map stays on %s and the service %s; Ctrl-C ends that", rospy.resolve_name("map"),
                      rospy.resolve_name("dynamic_map"))
        rospy.spin()

    def leave(self) -> None:
        """Unregister the node."""
        rospy.signal_shutdown("done")

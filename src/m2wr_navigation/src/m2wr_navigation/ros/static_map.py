# SPDX-License-Identifier: BSD-3-Clause
"""The map of the service ``static_map``."""
from __future__ import annotations

import time
from typing import Tuple

import rospy
from nav_msgs.srv import GetMap

from m2wr_maps.ros.message_conversion import ArrayMapAnswer
from m2wr_navigation.localization.localization_map import LocalizationMap, MapError
from m2wr_navigation.ros.amcl_messages import map_of_message

RETRY = 0.5                 # wall time between two requests [s], amcl's
COMPLAIN = 5.0              # wall time between two messages [s]


class ArrayGetMap(GetMap):
    """GetMap whose answer is read in one piece."""

    _response_class = ArrayMapAnswer


def fetch_map() -> Tuple[LocalizationMap, str]:
    """Return the map and its frame; asks until there is one.

    Raises
    ------
    rospy.ROSInterruptException
        If the node shuts down.
    """
    name, told = rospy.resolve_name("static_map"), 0.0
    proxy = rospy.ServiceProxy("static_map", ArrayGetMap)
    while not rospy.is_shutdown():
        try:
            answer = proxy()
            return map_of_message(answer.map), answer.map.header.frame_id
        except rospy.ServiceException as error:
            why = "no answer ({}); expected map_server, or another node with this service".format(error)
        except MapError as error:
            why = "its map is refused: {}".format(error)
        if time.monotonic() - told > COMPLAIN:
            told = time.monotonic()
            rospy.logwarn("waiting for the map of the service %s: %s. With ~use_map_topic it is taken from %s", name,
                          why, rospy.resolve_name("map"))
        rospy.rostime.wallsleep(RETRY)
    raise rospy.ROSInterruptException("shutdown")

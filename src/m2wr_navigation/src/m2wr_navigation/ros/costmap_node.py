# SPDX-License-Identifier: BSD-3-Clause
"""``costmap_2d_node``: one costmap by itself."""
from __future__ import annotations

import rospy

from m2wr_navigation.kernel_warm_up import compile_costmap_kernels
from m2wr_navigation.ros.costmap_server import CostmapError, CostmapServer, wait_until_ready
from m2wr_navigation.ros.transforms import Transforms
from m2wr_node.ros.starting import start_node


def main() -> int:
    """Run the node; return its exit code."""
    start_node("costmap_node")
    try:
        server = CostmapServer("costmap", Transforms())
    except CostmapError as error:
        rospy.logfatal("the costmap cannot be made: %s", error)
        return 1
    compile_costmap_kernels()
    server.start()
    if wait_until_ready([server], "costmap_2d_node"):
        rospy.loginfo("costmap_2d_node is ready: %s", rospy.resolve_name("~costmap/costmap"))
    rospy.spin()
    return 0

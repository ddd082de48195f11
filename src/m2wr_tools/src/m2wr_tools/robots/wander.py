# SPDX-License-Identifier: BSD-3-Clause
"""The command ``wander_robots``: one process that drives any number of robots, with obstacle avoidance."""
from __future__ import annotations

import argparse
import logging
from typing import List, Optional

import rospy
from geometry_msgs.msg import Twist
from sensor_msgs.msg import LaserScan

from m2wr_node.ros.starting import start_node
from motion_plan.obstacle_avoidance import ObstacleAvoidance
from motion_plan.regions import RegionReader, ScanError

_REFUSAL_PAUSE = 5.0        # s between two warnings about scans of one robot


class Wanderer:
    """Drives one robot: a command for every scan.

    Parameters
    ----------
    name : str
        Namespace of the robot.
    scan_topic, command_topic : str
        Below that namespace.
    """

    def __init__(self, name: str, scan_topic: str = "m2wr/laser/scan", command_topic: str = "cmd_vel") -> None:
        self.name, self._reader, self._behaviour = name, RegionReader(), ObstacleAvoidance()
        self._publisher = rospy.Publisher("/%s/%s" % (name, command_topic), Twist, queue_size=1)
        self._subscriber = rospy.Subscriber("/%s/%s" % (name, scan_topic), LaserScan, self._on_scan, queue_size=1,
                                            tcp_nodelay=True)

    def _on_scan(self, scan: LaserScan) -> None:
        command = Twist()
        try:
            regions = self._reader.read(scan.ranges, scan.angle_min, scan.angle_max, scan.angle_increment)
            command.linear.x, command.angular.z = self._behaviour.update(regions=regions)
        except ScanError as error:
            rospy.logwarn_throttle(_REFUSAL_PAUSE, "%s stops: %s" % (self.name, error))
        try:
            self._publisher.publish(command)
        except rospy.ROSException:
            if not rospy.is_shutdown():         # during a shutdown the topic may be closed
                raise


def main(argv: Optional[List[str]] = None) -> int:
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="wander_robots", description="Drive robots with obstacle avoidance.",
                                     formatter_class=argparse.ArgumentDefaultsHelpFormatter)
    parser.add_argument("--robots", type=int, default=3, metavar="N", help="number of robots")
    parser.add_argument("--name", default="robot", help="name of the robots, without their numbers")
    parser.add_argument("--first", type=int, default=1, metavar="K", help="number of the first robot")
    arguments = parser.parse_args(rospy.myargv(argv)[1:])
    start_node("wander_robots", anonymous=True)
    logging.getLogger("motion_plan").setLevel(logging.WARNING)      # no line for each decision of each robot
    wanderers = [Wanderer("%s%d" % (arguments.name, arguments.first + k)) for k in range(arguments.robots)]
    rospy.loginfo("driving %d robots", len(wanderers))
    rospy.spin()
    return 0

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""map_merge finds robots by their topics and publishes one map, which grows with each robot's map."""
import os
import sys
import unittest

import numpy as np
import rospy
from nav_msgs.msg import OccupancyGrid

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402

SIZE = 0.1                  # m: of a cell


def publish(robot, rows):
    """Publish a map whose corner is where the robot began; return the publisher, which has to be kept."""
    message = OccupancyGrid()
    message.header.frame_id = robot + "/map"
    message.info.resolution, message.info.origin.orientation.w = SIZE, 1.0
    message.info.height, message.info.width = np.array(rows).shape
    message.data = [value for row in rows for value in row]
    publisher = rospy.Publisher("/{}/map".format(robot), OccupancyGrid, queue_size=1, latch=True)
    publisher.publish(message)
    return publisher


class MapMerge(unittest.TestCase):
    def test_maps_of_robots_are_merged_as_they_come(self):
        merged = Recorder("/merged", OccupancyGrid)

        def cells():
            return None if not merged.messages else np.array(merged.messages[-1].data).reshape(
                merged.messages[-1].info.height, -1)

        kept = [publish("robot3", [[0] * 99] * 99), publish("robot1", [[0, 100]])]
        wait_until(lambda: cells() is not None and cells().tolist() == [[0, 100]], "the map of the first robot")
        kept.append(publish("robot2", [[100, 0]]))          # turned to the left: along y
        wait_until(lambda: cells().shape == (2, 20), "the map of both robots")
        last = merged.messages[-1]
        self.assertEqual((last.header.frame_id, round(last.info.resolution, 3)), ("world", SIZE))
        self.assertEqual(cells()[:, :2].tolist(), [[0, 100], [-1, -1]])
        self.assertEqual(cells()[:, 19].tolist(), [100, 0])
        self.assertEqual(int((cells() == -1).sum()), 36)


if __name__ == "__main__":
    rospy.init_node("map_merge_check")
    run_checks("merged_maps", MapMerge)

# SPDX-License-Identifier: BSD-3-Clause
"""The orientation that the node sends for its frame."""
import threading
from collections import deque

import numpy as np
import pytest
import rospy
from grid_map_msgs.msg import GridMap, GridMapInfo
from nav_msgs.msg import Odometry

from m2wr_elevation.dead_reckoning import rotation_of
from m2wr_elevation.ros.elevation_node import ElevationNode, quaternion_of


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 1), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0.1, -0.5, 0.3, 0.8)])
def test_a_rotation_becomes_its_quaternion(quaternion):
    np.testing.assert_allclose(rotation_of(quaternion_of(rotation_of(quaternion))), rotation_of(quaternion), atol=1e-12)


def test_the_messages_are_those_of_grid_map():
    assert GridMap._md5sum == "95681e052b1f73bf87b7eb984382b401"
    assert GridMapInfo._md5sum == "43ee5430e1c253682111cb6bedac0ef9"


def test_after_a_reset_of_the_simulation_nothing_old_is_used():
    node = object.__new__(ElevationNode)
    node.__dict__.update(_changed=threading.Condition(), _restarted=False, _cloud="old", _newest=None,
                         _imu=deque(["old"]), _odometry=deque())

    def take(stamp):
        message = Odometry()
        message.header.stamp = rospy.Time.from_sec(stamp)
        node._on_odometry(message)

    for stamp in (5.0, 5.1, 5.05):              # messages may overtake one another
        take(stamp)
    assert not node._restarted and node._cloud == "old" and len(node._odometry) == 3
    take(0.02)
    assert node._restarted and node._cloud is None and not node._imu
    assert [message.header.stamp.to_sec() for message in node._odometry] == [0.02]


def test_the_time_of_a_cloud_leaves_out_the_start(monkeypatch):
    node = object.__new__(ElevationNode)
    node.__dict__.update(_clouds=1, _used=3.0)
    assert node.used() == "1 clouds were mapped"
    monkeypatch.setattr("m2wr_elevation.ros.elevation_node.time.process_time", lambda: 5.0)
    node._clouds = 101
    assert node.used() == "101 clouds were mapped, 20.0 ms of processor time each: 0.20 of a core at 10 Hz"

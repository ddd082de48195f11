# SPDX-License-Identifier: BSD-3-Clause
"""The orientation that the node sends for its frame."""
import numpy as np
import pytest
from grid_map_msgs.msg import GridMap, GridMapInfo

from m2wr_elevation.dead_reckoning import rotation_of
from m2wr_elevation.ros.elevation_node import quaternion_of


@pytest.mark.parametrize("quaternion", [(0, 0, 0, 1), (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0.1, -0.5, 0.3, 0.8)])
def test_a_rotation_becomes_its_quaternion(quaternion):
    np.testing.assert_allclose(rotation_of(quaternion_of(rotation_of(quaternion))), rotation_of(quaternion), atol=1e-12)


def test_the_messages_are_those_of_grid_map():
    assert GridMap._md5sum == "95681e052b1f73bf87b7eb984382b401"
    assert GridMapInfo._md5sum == "43ee5430e1c253682111cb6bedac0ef9"

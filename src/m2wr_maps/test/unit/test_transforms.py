# SPDX-License-Identifier: BSD-3-Clause
"""Rotation matrices of quaternions, and the parts of a transform."""
import math

import numpy as np
import pytest
from geometry_msgs.msg import Quaternion, Transform, TransformStamped, Vector3

from m2wr_maps.transforms import rotation, transform_parts


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("length", [1.0, 0.3])
def test_quarter_turn_moves_the_axes(axis, length):
    quaternion = np.zeros(4)
    quaternion[axis] = quaternion[3] = length * math.sqrt(0.5)
    first, second = np.eye(3)[(axis + 1) % 3], np.eye(3)[(axis + 2) % 3]
    np.testing.assert_allclose(rotation(quaternion) @ first, second, atol=1e-15)
    np.testing.assert_allclose(rotation(quaternion) @ second, -first, atol=1e-15)


def test_parts_of_a_message():
    message = TransformStamped(transform=Transform(Vector3(1.0, 2.0, 3.0), Quaternion(0.0, 0.6, 0.0, 0.8)))
    assert transform_parts(message) == ((1.0, 2.0, 3.0), (0.0, 0.6, 0.0, 0.8))

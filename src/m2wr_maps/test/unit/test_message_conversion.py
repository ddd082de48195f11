# SPDX-License-Identifier: BSD-3-Clause
"""Messages from arrays; needs the message classes, but no master."""
import io

import numpy as np
import pytest
from genpy import Time
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetMapResponse
from std_msgs.msg import Header

from m2wr_maps.ros.message_conversion import (
    ArrayGrid,
    ArrayMapAnswer,
    covariance36,
    grid_message,
    path_message,
    pose_message,
    poses_message,
)


@pytest.fixture
def message():
    data = np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (7, 5))
    return grid_message(data, 0.25, (-1.0, 2.0, 0.5), "a/map", Time(3, 4))


def written(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_grid_serialises_like_the_standard_message(message):
    plain = OccupancyGrid().deserialize(written(message))
    assert plain.header == message.header and plain.info == message.info
    assert list(plain.data) == message.data.tolist()
    assert written(plain) == written(message)


def test_grid_round_trip(message):
    again = ArrayGrid().deserialize(written(message))
    assert again.header == message.header and again.info == message.info
    np.testing.assert_array_equal(again.data, message.data)


def test_map_response_serialises_like_the_standard_one(message):
    answer = ArrayMapAnswer(message)
    plain = GetMapResponse().deserialize(written(answer))
    assert list(plain.map.data) == message.data.tolist()
    np.testing.assert_array_equal(ArrayMapAnswer().deserialize(written(answer)).map.data, message.data)


@pytest.mark.parametrize("count, frame", [(0, "map"), (1, ""), (5, "r1/map")])
def test_paths_and_poses_serialise_like_standard_messages(count, frame):
    rng = np.random.default_rng(2)
    poses, stamps = rng.uniform(-3.0, 3.0, (count, 3)), np.array([0.0, 0.1, 1700000000.7, 12.9999999999, 5.0])[:count]
    header = Header(frame_id=frame, stamp=Time(3, 4))
    plain = Path(header=header)
    for pose, stamp in zip(poses, stamps):
        plain.poses.append(PoseStamped(header=Header(frame_id=frame, stamp=Time.from_sec(stamp)),
                                       pose=pose_message(pose)))
    again = Path().deserialize(written(path_message(poses, stamps, header)))
    assert again.header == plain.header and len(again.poses) == count
    for one, other in zip(again.poses, plain.poses):
        assert one.header.frame_id == frame and abs((one.header.stamp - other.header.stamp).to_nsec()) <= 1000
        np.testing.assert_allclose(one.pose.orientation.z, other.pose.orientation.z, rtol=0, atol=1e-15)
        assert one.pose.position == other.pose.position
    cloud = PoseArray(header=header, poses=[pose_message(pose) for pose in poses])
    found = PoseArray().deserialize(written(poses_message(poses, frame, Time(3, 4))))
    assert found.header == cloud.header and len(found.poses) == count
    for one, other in zip(found.poses, cloud.poses):
        assert one.position == other.position and one.orientation.w == pytest.approx(other.orientation.w, abs=1e-15)


def test_covariance_is_placed_at_x_y_and_yaw():
    full = np.array(covariance36(np.arange(1.0, 10.0).reshape(3, 3))).reshape(6, 6)
    np.testing.assert_array_equal(full[np.ix_([0, 1, 5], [0, 1, 5])], np.arange(1.0, 10.0).reshape(3, 3))
    assert np.count_nonzero(full) == 9

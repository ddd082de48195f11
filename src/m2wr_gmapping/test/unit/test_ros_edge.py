# SPDX-License-Identifier: BSD-3-Clause
"""Messages and parameters at the edge to ROS; needs the message classes, no master."""
import io

import numpy as np
import pytest
from genpy import Time
from geometry_msgs.msg import PoseArray, PoseStamped
from nav_msgs.msg import OccupancyGrid, Path
from nav_msgs.srv import GetMapResponse
from std_msgs.msg import Header

from m2wr_gmapping.config import ConfigError, GmappingConfig
from m2wr_gmapping.filter.occupancy import Grid
from m2wr_gmapping.ros import node_parameters as params
from m2wr_gmapping.ros.message_conversion import (
    ArrayGrid,
    ArrayMapAnswer,
    covariance36,
    grid_message,
    path_message,
    pose_message,
    poses_message,
)
from m2wr_gmapping.ros.node_parameters import NODE_PARAMETERS, NodeOptions, read_parameters
from m2wr_gmapping.ros.reconfigure import CHANGEABLE, changed, description


@pytest.fixture
def message():
    data = np.random.default_rng(1).choice(np.array([-1, 0, 100], np.int8), (7, 5))
    return grid_message(Grid(data, 0.25, np.array([-1.0, 2.0])), "a/map", Time(3, 4))


def written(message):
    buffer = io.BytesIO()
    message.serialize(buffer)
    return buffer.getvalue()


def test_a_grid_is_written_as_the_ordinary_message_is(message):
    plain = OccupancyGrid().deserialize(written(message))
    assert plain.header == message.header and plain.info == message.info
    assert list(plain.data) == message.data.tolist()
    assert written(plain) == written(message)


def test_a_grid_is_read_back(message):
    again = ArrayGrid().deserialize(written(message))
    assert again.header == message.header and again.info == message.info
    np.testing.assert_array_equal(again.data, message.data)


def test_the_answer_of_the_service_is_the_ordinary_one(message):
    answer = ArrayMapAnswer(message)
    plain = GetMapResponse().deserialize(written(answer))
    assert list(plain.map.data) == message.data.tolist()
    np.testing.assert_array_equal(ArrayMapAnswer().deserialize(written(answer)).map.data, message.data)


@pytest.mark.parametrize("count, frame", [(0, "map"), (1, ""), (5, "r1/map")])
def test_paths_and_particles_are_written_as_the_ordinary_messages_are(count, frame):
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


def test_the_covariance_stands_at_x_y_and_yaw():
    full = np.array(covariance36(np.arange(1.0, 10.0).reshape(3, 3))).reshape(6, 6)
    np.testing.assert_array_equal(full[np.ix_([0, 1, 5], [0, 1, 5])], np.arange(1.0, 10.0).reshape(3, 3))
    assert np.count_nonzero(full) == 9


def test_parameters_of_the_node_are_taken_out_and_named_when_wrong():
    config, options, warnings = read_parameters(
        {"particles": 12.0, "save_on_exit": "plan", "scan_queue": "many", "settle_time": 2, "bogus": 1,
         "sigma": "wide"})
    assert config["particles"] == 12
    assert options == NodeOptions(save_on_exit="plan", settle_time=2.0)
    text = "\n".join(warnings)
    assert "scan_queue: 'many'" in text and "~bogus" in text and "sigma: 'wide'" in text
    assert len(warnings) == 3


@pytest.mark.parametrize("given, wanted", [({}, (None, None)), ({"maxRange": 8}, (8.0, None)),
                                           ({"maxUrange": 3.5, "particles": 4}, (None, 3.5)),
                                           ({"maxRange": -1}, (7.0, 6.0)), ({"maxRange": "far"}, (None, None))])
def test_ranges_are_those_at_the_first_scan(monkeypatch, given, wanted):
    monkeypatch.setattr(params, "private_parameters", lambda: given)
    monkeypatch.setattr(params.rospy, "logwarn", lambda *_: None)
    config = params.read_ranges(GmappingConfig.from_mapping({"maxRange": 7, "maxUrange": 6, "particles": 9}))
    assert (config["maxRange"], config["maxUrange"], config["particles"]) == wanted + (9,)


@pytest.mark.parametrize("given, fits", [({}, True), ({"odom_frame": "map"}, False), ({"base_frame": "/odom"}, False),
                                         ({"map_frame": "odom", "odom_frame": "map"}, True),
                                         ({"odom_frame": "/"}, False)])
def test_three_frames_are_three(given, fits):
    config = GmappingConfig.from_mapping(given)
    if fits:
        params.check_frames(config)
    else:
        with pytest.raises(ConfigError, match="expected three different frames"):
            params.check_frames(config)


def test_a_map_that_could_not_be_written_at_the_end_is_told_at_the_start(tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    assert not params.trouble_at_exit("") and not params.trouble_at_exit("~/plan")
    assert "there is no folder" in params.trouble_at_exit("~/nowhere/plan")[0]
    monkeypatch.setattr(params.os, "access", lambda *_: False)              # the tests may be root, who may do anything
    assert "may not write into" in params.trouble_at_exit("~/plan")[0]


def test_every_option_of_the_node_is_told():
    assert set(NODE_PARAMETERS) == set(NodeOptions.__dataclass_fields__)


def test_changeable_parameters_change_and_the_others_stay():
    config = GmappingConfig.from_mapping({"particles": 7, "linearUpdate": 500})
    after = changed(config, {"linearUpdate": 2, "throttle_scans": 3.0, "particles": 9})
    assert (after["linearUpdate"], after["throttle_scans"], after["particles"]) == (2.0, 3, 7)
    told = description(config)
    assert set(told.defaults) == set(CHANGEABLE)
    assert told.max["linearUpdate"] == 500.0        # a value beyond the slider is no error

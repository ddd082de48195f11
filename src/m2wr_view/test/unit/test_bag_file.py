# SPDX-License-Identifier: BSD-3-Clause
"""Bags whose messages are not those of this installation."""
import pytest
import rosbag
import rospy
from nav_msgs.msg import Odometry

from m2wr_view.bag_file import read_messages
from m2wr_view.errors import ViewError
from m2wr_view.run_log import read_run

EXPECTED = {"/odom": "nav_msgs/Odometry"}


@pytest.fixture
def make_bag(tmp_path, monkeypatch):
    """Return a function that writes a bag with odometry in which some bytes stand in place of others."""
    monkeypatch.setattr(rosbag.bag, "_message_types", {})       # what this process has met in other bags

    def make(old, new):
        path = tmp_path / "odd.bag"
        with rosbag.Bag(str(path), "w") as bag:
            for k in range(3):
                message = Odometry()
                message.header.stamp = rospy.Time(k + 1)
                bag.write("/odom", message, rospy.Time(k + 1))
        whole = path.read_bytes()
        assert old in whole
        path.write_bytes(whole.replace(old, new))
        return str(path)
    return make


def test_installed_message_definitions_are_used(make_bag):
    path = make_bag(b"geometry_msgs/PoseWithCovariance pose\n", b"geometry_msgs/PoseWithCovariance nose\n")
    messages = [message for _, message, _ in read_messages(path, EXPECTED)]
    assert len(messages) == 3 and all(type(message) is Odometry for message in messages)
    assert read_run(path).times.tolist() == [1.0, 2.0, 3.0]


def test_a_type_of_another_make_is_refused(make_bag):
    path = make_bag(Odometry._md5sum.encode(), b"0" * 32)
    for read in (read_run, lambda name: list(read_messages(name, EXPECTED))):
        with pytest.raises(ViewError, match="nav_msgs/Odometry has the md5 sum 0000.* there; expected cd5e73d1"):
            read(path)

# SPDX-License-Identifier: BSD-3-Clause
"""Readers show each topic in the order in which its messages were recorded, also where their times do not tell it."""
import pytest
import rosbag
import rospy
from std_msgs.msg import String

from m2wr_tools.runs.bag_order import settle_times


def write(path, entries, compression=rosbag.Compression.LZ4, chunk=300):
    """Write (topic, text, time [s]) in this order, those of /talk by two publishers in turns."""
    with rosbag.Bag(str(path), "w", compression=compression, chunk_threshold=chunk) as bag:
        ways = ({}, {})
        for number, (topic, text, time) in enumerate(entries):
            bag._topic_connections = ways[number % 2]       # the writer itself knows one publisher a topic
            bag.write(topic, String(data=text), rospy.Time.from_sec(time))
    return str(path)


def read(path, topic="/talk"):
    with rosbag.Bag(path) as bag:
        return [message.data for _, message, _ in bag.read_messages(topics=[topic])]


def times(path):
    with rosbag.Bag(path) as bag:
        return [entry.time.to_nsec() for entry in bag._get_entries()]


@pytest.mark.parametrize("compression", [rosbag.Compression.NONE, rosbag.Compression.LZ4, rosbag.Compression.BZ2])
def test_messages_of_one_time_come_in_the_order_of_recording(tmp_path, compression):
    names = ["%02d" % number for number in range(40)]
    path = write(tmp_path / "run.bag", [("/talk", name, 1.0 + int(name) // 8) for name in names], compression)
    assert read(path) != names              # else there is nothing to mend
    assert settle_times(path) == 35
    assert read(path) == names
    assert settle_times(path) == 0


def test_times_are_rounded_to_nanoseconds_in_order(tmp_path):
    path = write(tmp_path / "run.bag", [("/talk", "a", 1.0), ("/talk", "b", 1.0), ("/talk", "c", 1.5),
                                        ("/other", "d", 1.5)])
    settle_times(path)
    assert times(path) == [1000000000, 1000000001, 1500000000, 1500000000]


def test_a_time_that_has_gone_back_stays(tmp_path):
    path = write(tmp_path / "run.bag", [("/talk", "before", 5.0), ("/talk", "after", 0.1), ("/talk", "then", 0.1)])
    settle_times(path)
    assert sorted(times(path)) == [100000000, 100000001, 5000000000]


def test_the_end_of_a_chunk_is_not_before_its_last_message(tmp_path):
    path = write(tmp_path / "run.bag", [("/talk", name, 2.0) for name in "abcd"], chunk=10000)
    settle_times(path)
    with rosbag.Bag(path) as bag:
        assert bag.get_end_time() == pytest.approx(2.0 + 3e-9, abs=1e-12)
        assert len(list(bag.read_messages(start_time=rospy.Time(2, 3)))) == 1


@pytest.mark.parametrize("spoil, message", [
    (lambda data: b"no bag at all", "no bag of version 2.0"),
    (lambda data: data[:len(data) // 2], "no index"),
    (lambda data: data.replace(b"index_pos=", b"index_xxx="), "no index"),
])
def test_what_is_no_closed_bag_is_said_so(tmp_path, spoil, message):
    path = write(tmp_path / "run.bag", [("/talk", "a", 1.0)] * 20)
    with open(path, "rb") as stream:
        data = stream.read()
    with open(path, "wb") as stream:
        stream.write(spoil(data))
    with pytest.raises(ValueError, match=message):
        settle_times(path)

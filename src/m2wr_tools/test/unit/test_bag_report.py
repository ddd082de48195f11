# SPDX-License-Identifier: BSD-3-Clause
"""The report on a bag: rates, gaps, what is missing, the outcome."""
import os
import subprocess
import sys

import numpy as np
import pytest
import rosbag
import rospy
from rosgraph_msgs.msg import Clock
from std_msgs.msg import String

from m2wr_tools.runs.bag_report import Topic, main


def test_rate_and_gaps_are_counted():
    times = np.concatenate((np.arange(0.0, 5.0, 0.05), np.arange(6.0, 10.0, 0.05)))
    topic = Topic("/odom", "nav_msgs/Odometry", times)
    assert topic.gaps == 1 and topic.longest == pytest.approx(1.05) and topic.longest_at == pytest.approx(4.95)
    assert topic.rate == pytest.approx(179 / 9.95)


def test_jitter_is_no_gap_and_few_messages_have_no_rate():
    times = np.arange(100) * 0.01
    times[50:] += 0.06
    assert Topic("/clock", "x", times).gaps == 0
    assert Topic("/m_line", "x", np.array([1.0, 2.0, 9.0])).rate is None


def test_the_report_names_what_is_there_and_what_is_not(tmp_path, capsys):
    path = str(tmp_path / "run.bag")
    with rosbag.Bag(path, "w") as bag:
        for number in range(101):
            now = rospy.Time.from_sec(1.0 + 0.05 * number)
            bag.write("/clock", Clock(now), now)
        bag.write("/bug2/state", String("goal_reached"), now)
    assert main([path]) == 0
    text = capsys.readouterr().out
    assert "102 messages, 5.0 s" in text and "20.0 Hz" in text
    assert "not in the bag: /odom (the path), /tf (frames)" in text and "/gazebo/world_markers (the world)" in text
    assert "outcome                      goal reached" in text and "least clearance              not recorded" in text


def test_unreadable_bags_are_reported_with_the_others(tmp_path, capsys):
    path = str(tmp_path / "run.bag")
    with rosbag.Bag(path, "w") as bag:
        bag.write("/clock", Clock(), rospy.Time(1))
    assert main([str(tmp_path / "no.bag"), path]) == 1
    said = capsys.readouterr()
    assert "no.bag: No such file" in said.err and "1 messages" in said.out


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path):
    path = str(tmp_path / "run.bag")
    with rosbag.Bag(path, "w") as bag:
        bag.write("/clock", Clock(), rospy.Time(1))
    program = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "scripts", "m2wr_sim", "bag_report")
    reader, writer = os.pipe()
    os.close(reader)
    with os.fdopen(writer, "wb") as closed:
        done = subprocess.run([sys.executable, program] + 3 * [path], stdout=closed, stderr=subprocess.PIPE,
                              universal_newlines=True, timeout=60)
    assert (done.returncode, done.stderr) == (0, "")

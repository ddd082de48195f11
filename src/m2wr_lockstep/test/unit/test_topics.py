# SPDX-License-Identifier: BSD-3-Clause
"""What of the simulation's topics is counted, and when a sensor that makes ticks publishes."""
from types import SimpleNamespace

import pytest
import rospy
from sensor_msgs.msg import LaserScan

from m2wr_lockstep.server.ros.topics import LockstepTopics

PORT = SimpleNamespace(wanted=lambda: True, publish=lambda message: None, close=lambda: None)


@pytest.fixture
def topics(monkeypatch):
    """Topics of lockstep without a network."""
    monkeypatch.setattr(rospy, "resolve_name", lambda name: name)
    monkeypatch.setattr(rospy, "Subscriber", lambda *_, **__: SimpleNamespace(unregister=lambda: None))
    return LockstepTopics()


def test_ticks_need_no_subscriber_unless_another_sensor_has_one(topics):
    made = [topics.counted(PORT, name, LaserScan) for name in ("left/scan", "right/scan")]
    heard = {}
    for number, port in enumerate(made):
        port._port = SimpleNamespace(wanted=lambda number=number: heard.get(number, False))
    assert [port.wanted() for port in made] == [True, True]
    heard[1] = True
    assert [port.wanted() for port in made] == [False, True]
    heard[0] = True
    assert [port.wanted() for port in made] == [True, True]


def test_a_topic_that_is_removed_is_a_change(topics):
    for made in (topics.counted(PORT, "/scan", LaserScan),
                 topics.subscribe("/cmd_vel", None, None)):
        topics.changed = False
        made.close()
        assert topics.changed
    assert not topics.ticking


def test_replies_are_counted_again_without_the_robot(topics):
    robot = topics.subscribe("/cmd_vel", None, None)
    topics.listen("/cmd_vel")
    assert not topics._counting
    robot.close()
    topics.listen("/cmd_vel")
    assert list(topics._counting) == ["/cmd_vel"] and topics.inbox.topics() == {"/cmd_vel"}

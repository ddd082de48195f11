# SPDX-License-Identifier: BSD-3-Clause
"""m2wr_node.ros.shutdown: hooks before and after the shutdown was requested."""
import pytest
import rospy

from m2wr_node.ros.shutdown import at_shutdown, until_shutdown


@pytest.fixture
def hooks(monkeypatch):
    """What rospy has been given; the shutdown is requested once the second list holds True."""
    given, requested = [], []
    monkeypatch.setattr(rospy, "on_shutdown", given.append)
    monkeypatch.setattr(rospy.core, "is_shutdown_requested", lambda: bool(requested))
    return given, requested


def test_a_hook_in_time_waits_for_the_shutdown(hooks):
    calls = []
    at_shutdown(lambda: calls.append(1))
    assert calls == []
    hooks[0][0]()
    assert calls == [1]


def test_a_late_hook_is_called_at_once_and_only_once(hooks):
    calls = []
    hooks[1].append(True)
    at_shutdown(lambda: calls.append(1))
    assert calls == [1]
    hooks[0][0]()
    assert calls == [1]


def test_a_closed_topic_is_an_error_only_before_the_shutdown(hooks):
    with pytest.raises(rospy.ROSException), until_shutdown():
        raise rospy.ROSException("publish() to a closed topic")
    hooks[1].append(True)
    with until_shutdown():
        raise rospy.ROSException("publish() to a closed topic")
    with pytest.raises(ValueError), until_shutdown():
        raise ValueError("something else")

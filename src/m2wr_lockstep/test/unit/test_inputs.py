# SPDX-License-Identifier: BSD-3-Clause
"""What a controller waits for before a turn."""
import threading
from collections import namedtuple

import pytest

from m2wr_lockstep.client.inputs import KEPT, UNASKED, Inputs, TurnError

Message = namedtuple("Message", "stamp")


@pytest.fixture
def inputs():
    """Inputs of odometry and scans; what is handed over is in ``inputs.seen``."""
    made = Inputs()
    made.seen = []
    for topic in ("/odom", "/scan"):
        made.add(topic, lambda message, topic=topic: made.seen.append((topic, message)))
    return made


def test_messages_are_kept_until_the_turn(inputs):
    inputs.receive("/odom", 1)
    assert inputs.seen == []
    inputs.take({"/odom": 1}, 0.0)
    assert inputs.seen == [("/odom", 1)]


def test_topics_come_in_the_order_in_which_they_were_added(inputs):
    for topic, message in (("/scan", 1), ("/odom", 2), ("/scan", 3), ("/odom", 4)):
        inputs.receive(topic, message)
    inputs.take({"/odom": 2, "/scan": 2}, 0.0)
    assert inputs.seen == [("/odom", 2), ("/odom", 4), ("/scan", 1), ("/scan", 3)]


def test_a_message_is_handed_over_once(inputs):
    inputs.receive("/odom", 1)
    inputs.take({}, 0.0)
    inputs.take({}, 0.0)
    assert inputs.seen == [("/odom", 1)]


def test_the_turn_waits_for_what_is_on_its_way(inputs):
    taking = threading.Thread(target=inputs.take, args=({"/odom": 2, "/tf": 9}, 20.0))
    taking.start()
    inputs.receive("/odom", 1)
    inputs.receive("/odom", 2)
    taking.join(20.0)
    assert not taking.is_alive() and inputs.seen == [("/odom", 1), ("/odom", 2)]


def test_what_is_missing_is_named(inputs):
    inputs.receive("/scan", 1)
    with pytest.raises(TurnError, match=r"0 s .*1 of 2 messages on /scan"):
        inputs.take({"/odom": 0, "/scan": 2}, 0.0)
    assert inputs.seen == []


def test_uncounted_messages_do_not_replace_counted_ones(inputs):
    inputs.receive("/odom", Message(1))
    inputs.receive("/odom", Message(2))
    with pytest.raises(TurnError, match="1 of 2"):
        inputs.take({"/odom": 2}, 0.0, lambda message: message.stamp > 1)
    inputs.receive("/odom", Message(3))
    inputs.take({"/odom": 2}, 0.0, lambda message: message.stamp > 1)
    assert [message.stamp for _, message in inputs.seen] == [2, 3]


def test_unwanted_messages_are_waited_for_and_dropped(inputs):
    inputs.receive("/odom", Message(9))
    inputs.take({"/odom": 1}, 0.0, None, lambda message: message.stamp < 5)
    assert inputs.seen == []
    inputs.take({}, 0.0)
    assert inputs.seen == []


def test_only_the_callers_messages_fill_its_counts(inputs):
    inputs.receive("/odom", 1, "/other")
    inputs.receive("/odom", 2, "/gazebo")
    with pytest.raises(TurnError, match="1 of 2 messages on /odom by /gazebo"):
        inputs.take({"/odom": 2}, 0.0, sender="/gazebo")
    inputs.receive("/odom", 3, "/gazebo")
    inputs.take({"/odom": 2}, 0.0, sender="/gazebo")
    assert [message for _, message in inputs.seen] == [1, 2, 3]         # the other's are heard all the same


def overfill(inputs):
    for number in range(KEPT + 5):
        inputs.receive("/odom", number)


def taken(inputs, least):
    inputs.take({"/odom": least}, 0.0)
    messages = [message for _, message in inputs.seen]
    del inputs.seen[:]
    return messages


@pytest.fixture
def clocked():
    """Inputs of odometry whose wall clock stands at ``clocked.now``."""
    made = Inputs(lambda: made.now)
    made.now, made.seen = 0.0, []
    made.add("/odom", lambda message: made.seen.append(("/odom", message)))
    return made


def test_before_the_first_turn_only_the_newest_are_kept(clocked):
    overfill(clocked)
    assert clocked.dropped == 5 and taken(clocked, KEPT) == list(range(5, KEPT + 5))


def test_between_turns_everything_is_kept(clocked):
    clocked.take({}, 0.0)
    clocked.now = UNASKED
    overfill(clocked)
    assert clocked.dropped == 0 and taken(clocked, KEPT + 5) == list(range(KEPT + 5))


def test_after_a_turn_that_failed_only_the_newest_are_kept(clocked):
    clocked.take({}, 0.0)
    with pytest.raises(TurnError):
        clocked.take({"/odom": 1}, 0.0)
    overfill(clocked)
    assert clocked.dropped == 5


def test_long_after_the_newest_turn_only_the_newest_are_kept(clocked):
    clocked.take({}, 0.0)
    overfill(clocked)
    clocked.now = UNASKED + 1.0
    overfill(clocked)
    assert clocked.dropped == KEPT + 10 and taken(clocked, KEPT) == list(range(5, KEPT + 5))


def test_two_callbacks_of_one_topic(inputs):
    also = []
    inputs.add("/odom", also.append)
    inputs.receive("/odom", 7)
    inputs.take({"/odom": 1}, 0.0)
    assert also == [7] and inputs.seen == [("/odom", 7)]

# SPDX-License-Identifier: BSD-3-Clause
"""What waits for a client is bounded, in turns, and the newest."""
from m2wr_bridge.web import outbox
from m2wr_bridge.web.outbox import Outbox, Stream


def take_all(box, now):
    taken = []
    while True:
        frames, _ = box.take(now)
        if not frames:
            return taken
        taken += frames


def stream(depth=10, period=0.0):
    return Stream(lambda message: [message], depth, period)


def test_answers_keep_their_order_and_come_first():
    box, one = Outbox(lambda: None), stream()
    box.offer(one, "topic", 1)
    box.answer("a")
    box.answer("b")
    assert take_all(box, 0.0) == ["a", "b", "topic"]


def test_a_full_stream_drops_its_oldest():
    box, one = Outbox(lambda: None), stream(depth=2)
    for number in range(5):
        box.offer(one, str(number), 1)
    assert take_all(box, 0.0) == ["3", "4"] and box.dropped == 3


def test_streams_take_turns():
    box, one, two = Outbox(lambda: None), stream(), stream()
    for number in range(3):
        box.offer(one, "a%d" % number, 1)
    box.offer(two, "b", 1)
    assert take_all(box, 0.0) == ["a0", "b", "a1", "a2"]


def test_a_throttled_stream_waits_and_sends_the_newest():
    box, one = Outbox(lambda: None), stream(depth=1, period=0.5)
    box.offer(one, "1", 1)
    assert box.take(10.0) == (["1"], 0.0)
    box.offer(one, "2", 1)
    box.offer(one, "3", 1)
    assert box.take(10.25) == ([], 0.25)
    assert box.take(10.5) == (["3"], 0.0)
    assert box.take(11.0) == ([], None)


def test_bytes_of_all_streams_are_bounded(monkeypatch):
    monkeypatch.setattr(outbox, "MOST_BYTES", 100)
    box, one, two = Outbox(lambda: None), stream(1000), stream(1000)
    for number in range(50):
        box.offer(one, "a%d" % number, 10)
        box.offer(two, "b%d" % number, 10)
    left = take_all(box, 0.0)
    assert len(left) <= 11 and {"a49", "b49"} <= set(left)


def test_answers_that_are_not_read_overflow(monkeypatch):
    box = Outbox(lambda: None)
    for _ in range(outbox.MOST_ANSWERS):
        box.answer("x")
    assert not box.overflowed
    box.answer("x")
    assert box.overflowed and take_all(box, 0.0) == []


def test_a_removed_stream_sends_nothing():
    box, one = Outbox(lambda: None), stream()
    box.offer(one, "1", 1)
    box.remove(one)
    assert take_all(box, 0.0) == []
    box.offer(one, "2", 1)
    assert take_all(box, 0.0) == []

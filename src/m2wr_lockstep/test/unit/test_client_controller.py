# SPDX-License-Identifier: BSD-3-Clause
"""The controller's turns as far as they need no master."""
import threading

import pytest
import rospy
from m2wr_lockstep.srv import TurnRequest

from m2wr_lockstep.client import controller
from m2wr_lockstep.controller import Controller


@pytest.fixture
def said(monkeypatch):
    """What the controller says."""
    lines = []
    for name in ("loginfo", "logwarn"):
        monkeypatch.setattr(rospy, name, lambda words, *values: lines.append(words % values))
    return lines


def request(tick):
    return TurnRequest(tick, rospy.Time(tick), rospy.Time(0), [], [])


def test_two_turns_never_run_at_once():
    made, entered, resume, running, most = Controller(), threading.Event(), threading.Event(), [], []

    def turn(_):
        running.append(None)
        most.append(len(running))
        entered.set()
        resume.wait(20.0)
        running.pop()

    made._turn = turn
    asking = [threading.Thread(target=made._serve, args=(request(tick),)) for tick in (1, 2)]
    asking[0].start()
    assert entered.wait(20.0)
    asking[1].start()
    asking[1].join(0.3)             # time enough to get in where nothing holds it back
    resume.set()
    for thread in asking:
        thread.join(20.0)
    assert most == [1, 1]


def wait_without_turns():
    """Let a controller wait for half a second without a request for a turn."""
    made = Controller()
    waiting = threading.Thread(target=made._wait_for_the_end)
    waiting.start()
    waiting.join(0.5)
    made._ended.set()
    waiting.join(20.0)
    assert not waiting.is_alive()


def test_a_missing_first_turn_is_logged(said, monkeypatch):
    monkeypatch.setattr(controller, "REMINDER", 0.01)
    wait_without_turns()
    assert "first lockstep request (0.01 s)" in said[0]
    assert 2 <= len(said) <= 8      # less and less often


def test_waiting_is_a_warning_only_after_a_minute(monkeypatch):
    told = {"info": [], "warn": []}
    for level, lines in told.items():
        monkeypatch.setattr(rospy, "log" + level, lambda text, *words, lines=lines: lines.append(text % words))
    monkeypatch.setattr(controller, "REMINDER", 0.01)
    monkeypatch.setattr(controller, "LONG_WAIT", 0.03)
    wait_without_turns()
    assert "(0.01 s)" in told["info"][0] and told["warn"] and "(0.01 s)" not in told["warn"][0]


def test_that_messages_were_dropped_is_said(said, monkeypatch):
    monkeypatch.setattr(controller, "REMINDER", 0.01)
    made = Controller()
    made._last, made._inputs.dropped = 1, 7
    waiting = threading.Thread(target=made._wait_for_the_end)
    waiting.start()
    waiting.join(0.3)
    made._ended.set()
    waiting.join(20.0)
    assert len(said) == 1 and "7 messages were dropped" in said[0]


def test_the_messages_of_a_turn_are_those_of_who_asks():
    made, seen = Controller(), []
    made._turn = lambda now: None
    made._inputs.add("/tf", seen.append)
    asked = request(1)
    asked.topics, asked.counts = ["/tf"], [1]
    asked._connection_header = {"callerid": "/gazebo"}
    turn = threading.Thread(target=made._serve, args=(asked,))
    turn.start()
    made._inputs.receive("/tf", "of another", "/robot_state_publisher")
    turn.join(0.3)
    assert turn.is_alive() and seen == []
    made._inputs.receive("/tf", "of the simulator", "/gazebo")
    turn.join(20.0)
    assert seen == ["of another", "of the simulator"]

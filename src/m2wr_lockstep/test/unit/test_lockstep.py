# SPDX-License-Identifier: BSD-3-Clause
"""Who takes part, and when time may advance, without a master."""
import logging
import threading
import time
from types import SimpleNamespace

import pytest

from m2wr_lockstep.errors import LockstepError
from m2wr_lockstep.server.conductor import TurnAnswer, TurnFailed
from m2wr_lockstep.server.inbox import Inbox
from m2wr_lockstep.server.message_counts import MessageCounts
from m2wr_lockstep.server.participants import Listener
from m2wr_lockstep.server.ros import lockstep as module
from m2wr_lockstep.server.ros.gate import Look
from m2wr_lockstep.server.ros.listeners import Link
from m2wr_lockstep.server.ros.lockstep import Lockstep, Settings
from m2wr_node.internals.connections import Connection


class Loop:
    """A loop that serves one request whenever it waits."""

    def __init__(self, stopping=False):
        self.stops, self.requests = stopping, []

    def wait_until(self, condition, seconds):
        """Wait as the real loop does."""
        deadline = time.monotonic() + seconds
        while not condition():
            if self.stops:
                raise InterruptedError("the node ends")
            if self.requests:
                self.requests.pop()()
            if time.monotonic() > deadline:
                return False
        return True

    def wake(self):
        """Nothing to do: wait_until looks all the time."""

    def stopping(self):
        """Whether the node is to end."""
        return self.stops


class Answering:
    """A caller of a controller that answers at once, or is dead; ``Answering.made`` are all there were."""

    made, dead = [], set()

    def __init__(self, name, wake):
        self.name, self.closed = name, False
        self.made.append(self)

    def ask(self, request):
        def result():
            if self.name in self.dead:
                raise TurnFailed("connection refused")
            return TurnAnswer((), False, False, "")
        return SimpleNamespace(done=lambda: True, result=result)

    def idle(self):
        return True

    def close(self):
        self.closed = True


class Moving:
    """A simulator whose every advance is a tick."""

    now_ns = 0

    def __init__(self, topics):
        self.topics = topics

    def advance(self, until_ns):
        self.now_ns += 50000000
        self.topics.tick_due = True
        return self.now_ns


@pytest.fixture
def stage(monkeypatch):
    """A lockstep of /first and /second that continues without a silent one; ``stage.look()`` finds nothing missing."""
    monkeypatch.setattr(module, "Caller", Answering)
    monkeypatch.setattr(Answering, "made", [])
    monkeypatch.setattr(Answering, "dead", set())
    topics = SimpleNamespace(ticking={1}, inbox=Inbox(), counts=MessageCounts(), changed=True, tick_due=False,
                             listen=None)
    monkeypatch.setattr(module, "Gate", lambda *_: SimpleNamespace(look=lambda without: Look([], [])))
    made = Lockstep(Settings(["/first", "/second"], [], [], 0.5, True), topics)
    with monkeypatch.context() as without_thread:
        without_thread.setattr(Lockstep, "_watch", lambda self: None)
        made.attach(Loop(), Moving(topics))
    return SimpleNamespace(lockstep=made, look=made._look_once,
                           members=lambda: [member.name for member in made._conductor.members])


def opened(stage):
    assert not stage.lockstep.open()
    stage.look()
    assert stage.lockstep.open() and stage.members() == ["/first", "/second"]
    return stage.lockstep


def test_a_lost_controller_does_not_return_by_an_earlier_look(stage):
    lockstep = opened(stage)
    stage.look()                            # the graph is looked at once more, and the result is not used
    lockstep.advance(0)
    Answering.dead.add("/first")
    lockstep.advance(0)
    assert lockstep.open() and stage.members() == ["/second"]
    Answering.dead.clear()
    stage.look()
    assert lockstep.open() and stage.members() == ["/first", "/second"]
    assert [caller.name for caller in Answering.made] == ["/first", "/second", "/first"] and Answering.made[0].closed


def test_a_look_that_began_before_a_loss_says_nothing(stage):
    lockstep = opened(stage)
    lockstep.advance(0)
    Answering.dead.add("/first")

    def look(without):
        lockstep.advance(0)                 # the loss falls into the look
        return Look([], [])

    lockstep._gate.look = look
    stage.look()
    assert lockstep.open() and stage.members() == ["/second"]


def test_expected_controllers_while_a_caller_is_replaced(stage):
    lockstep = opened(stage)
    lockstep.advance(0)
    Answering.dead.add("/first")
    lockstep.advance(0)
    del lockstep._callers["/first"]
    assert sorted(lockstep._expected()) == ["/first", "/second"]


def test_an_error_while_looking_does_not_end_the_looking(stage, monkeypatch, caplog):
    lockstep, looks = stage.lockstep, []

    def look(without):
        looks.append(None)
        if len(looks) == 1:
            raise KeyError("/first")
        lockstep._closing = True
        return Look([], [])

    lockstep._gate.look = look
    lockstep.open()
    watching = threading.Thread(target=lockstep._watch, daemon=True)
    watching.start()
    watching.join(20.0)
    assert len(looks) == 2 and lockstep.open()
    assert "looking for the participants failed" in caplog.text


# ---- listeners ---------------------------------------------------------------------------------------------------

@pytest.fixture
def deaf(stage):
    """A stage with a listener that never reads."""
    link = Link("/gazebo", "/rviz", "/tf", None)
    barrier = stage.lockstep._barrier
    barrier.all = barrier.shared = [link]
    barrier._unread = SimpleNamespace(of=lambda ends: 7)
    barrier._continue_on_silence, barrier._patience = False, 20.0
    return stage.lockstep


def test_services_are_answered_while_a_listener_does_not_read(deaf):
    served = []

    def serve():
        served.append(None)
        deaf._barrier._unread = SimpleNamespace(of=lambda ends: 0)

    deaf._loop.requests.append(serve)
    deaf._barrier.wait(deaf._barrier.all)
    assert served


def test_the_node_can_end_while_a_listener_does_not_read(deaf):
    deaf._loop.stops = True
    with pytest.raises(InterruptedError):
        deaf._barrier.wait(deaf._barrier.all)
    deaf._before_trigger()                  # in the middle of a step it continues at once


def test_in_the_middle_of_a_step_no_client_is_served(deaf):
    deaf._barrier._patience = 0.2
    deaf._loop.wake = deaf._loop.wait_until = None              # would fail when called
    deaf._before_trigger()
    with pytest.raises(LockstepError, match="/rviz has not read what /gazebo sent on /tf within 0.2 s"):
        deaf.advance(0)                     # behind the step, where it is not taken for the fault of a plugin


@pytest.mark.parametrize("respawned", [False, True])
def test_time_waits_for_a_listener_that_is_started_again(stage, respawned, caplog):
    lockstep, forgotten = opened(stage), []
    lockstep._barrier._listeners = [Listener("/mapper", (), respawned), Listener("/rviz", ())]
    lockstep._connections = [Connection("/gazebo", "/mapper", "/scan", (1, 2))]
    lockstep._gate.forget = lambda name, connections: forgotten.append((name, list(connections)))
    gone, there = Link("/gazebo", "/mapper", "/scan", "gone"), Link("/gazebo", "/rviz", "/scan", "there")
    lockstep._barrier.all = [gone, there]
    lockstep._barrier._unread = SimpleNamespace(of=lambda ends: None if ends == "gone" else 0)
    lockstep.advance(0)
    assert lockstep._barrier.all == [there]
    if respawned:
        assert not lockstep.open() and "/mapper has died" in caplog.text
        assert forgotten == [("/mapper", lockstep._connections)]
        stage.look()                    # it is back
    assert lockstep.open()


def test_a_listener_that_cannot_be_watched_is_named(deaf, caplog):
    def refuse(ends):
        raise OSError(1, "Operation not permitted")

    deaf._barrier._unread = SimpleNamespace(of=refuse)
    with caplog.at_level(logging.WARNING):
        deaf._barrier.wait(deaf._barrier.all)
    assert deaf._barrier.all == [] and "/rviz" in caplog.text and "Operation not permitted" in caplog.text

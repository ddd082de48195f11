# SPDX-License-Identifier: BSD-3-Clause
"""Which received messages are held back, and which are delivered."""
from m2wr_lockstep.server.inbox import Inbox


def test_a_slot_that_is_not_connected_yet_is_not_waited_for():
    inbox, delivered = Inbox(), []
    inbox.hold("/a")
    slot = inbox.open("/cmd_vel", delivered.append)
    assert inbox.has("/cmd_vel", "/a", 1)
    inbox.mark_connected()
    assert not inbox.has("/cmd_vel", "/a", 1)
    inbox.close(slot)
    assert inbox.has("/cmd_vel", "/a", 1)


def test_every_slot_of_a_topic_gets_the_message():
    inbox, first, second = Inbox(), [], []
    inbox.hold("/a")
    slots = [inbox.open("/cmd_vel", callback) for callback in (first.append, second.append)]
    inbox.mark_connected()
    inbox.arrive(slots[0], "/a", 1)
    assert not inbox.has("/cmd_vel", "/a", 1)
    inbox.arrive(slots[1], "/a", 1)
    assert inbox.has("/cmd_vel", "/a", 1)
    inbox.admit("/cmd_vel", "/a", 1)
    inbox.deliver()
    assert (first, second) == ([1], [1])


def test_an_arrival_wakes_the_waiting_thread():
    woken = []
    inbox = Inbox(lambda: woken.append(True))
    slot = inbox.open("/cmd_vel", lambda message: None)
    inbox.hold("/a")
    inbox.mark_connected()
    inbox.arrive(slot, "/a", 1)
    assert woken

# SPDX-License-Identifier: BSD-3-Clause
"""Lockstep with controllers that are plain objects: order, waiting, what counts when, and who is to blame."""
import logging

import pytest

from m2wr_lockstep.errors import LockstepError
from m2wr_lockstep.server.conductor import Conductor, TurnAnswer, TurnFailed
from m2wr_lockstep.server.inbox import Inbox
from m2wr_lockstep.server.message_counts import MessageCounts
from m2wr_lockstep.server.participants import Reply

MS = 1000000


class Answered:
    """An answer that is there, or an error."""

    def __init__(self, answer):
        self._answer = answer

    def done(self):
        return self._answer is not None

    def result(self):
        if isinstance(self._answer, Exception):
            raise self._answer
        return self._answer


class Rig:
    """A conductor; ``scripts[name](request)`` plays a controller and returns its answer, None for silence."""

    def __init__(self, *names, replies=(), continue_on_silence=False):
        self.inbox, self.counts, self.requests, self.settled, self.waits = Inbox(), MessageCounts(), [], 0, []
        self.delivered = []
        self.slot = self.inbox.open("/cmd_vel", self.delivered.append)
        self.inbox.mark_connected()
        self.scripts = {name: lambda request: answer() for name in names}
        self.conductor = Conductor(self._ask, self._wait, self.inbox, self.counts, replies, 2.0, continue_on_silence,
                                   self._settle)
        for name in names:
            self.conductor.join(name, 0)

    def _ask(self, name, request):
        self.requests.append((name, request))
        return Answered(self.scripts[name](request))

    def _wait(self, condition, seconds):
        self.waits.append(seconds)
        return condition()

    def _settle(self):
        self.settled += 1

    def send(self, sender, message):
        """Let a command arrive."""
        self.inbox.arrive(self.slot, sender, message)

    def deliver(self):
        """Return what reaches the robot at the next step boundary."""
        del self.delivered[:]
        self.inbox.deliver()
        return list(self.delivered)


def answer(*published, over=False, leave=False, note=""):
    return TurnAnswer(tuple(published), over, leave, note)


def test_controllers_are_asked_in_order_with_the_time():
    rig = Rig("/a", "/b")
    rig.conductor.tick(51 * MS)
    rig.conductor.tick(101 * MS)
    assert [(name, request.tick, request.now_ns) for name, request in rig.requests] == [
        ("/a", 1, 51 * MS), ("/b", 1, 51 * MS), ("/a", 2, 101 * MS), ("/b", 2, 101 * MS)]


def test_a_turn_counts_messages_since_the_previous_turn():
    rig = Rig("/a")
    rig.counts.count("/odom")
    rig.counts.count("/odom")
    rig.conductor.tick(1)
    rig.counts.count("/scan")
    rig.conductor.tick(2)
    rig.conductor.tick(3)
    assert [request.news for _, request in rig.requests] == [{"/odom": 2}, {"/scan": 1}, {}]


def test_a_command_counts_after_its_sender_has_answered():
    rig = Rig("/a")
    rig.send("/a", "go")
    assert rig.deliver() == []
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 0, 1))
    rig.conductor.tick(1)
    assert rig.deliver() == ["go"] and rig.deliver() == []


def test_a_message_beyond_the_count_waits_for_the_next_answer():
    rig = Rig("/a")
    rig.send("/a", "first")
    rig.send("/a", "second")
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 0, 1))
    rig.conductor.tick(1)
    assert rig.deliver() == ["first"]
    rig.conductor.tick(2)
    assert rig.deliver() == ["second"]


def test_commands_of_other_nodes_count_at_once():
    rig = Rig("/a")
    rig.send("/joystick", "stop")
    assert rig.deliver() == ["stop"]


def test_the_last_in_order_wins_however_they_arrive():
    for order in (("/a", "/b"), ("/b", "/a")):
        rig = Rig("/a", "/b")
        for sender in order:
            rig.send(sender, "of " + sender)
            rig.scripts[sender] = lambda request: answer(("/cmd_vel", 0, 1))
        rig.conductor.tick(1)
        assert rig.deliver() == ["of /b"]


def test_a_stop_in_another_turn_does_not_undo_a_later_command():
    """A supervisor switches the last controller off, which stops the robot, and the one before it on, which drives."""
    rig = Rig("/supervisor", "/driver", "/stopped")
    rig.send("/driver", "drive")
    rig.send("/stopped", "stop")
    rig.scripts["/driver"] = lambda request: answer(("/cmd_vel", 0, 1))
    rig.scripts["/stopped"] = lambda request: answer(("/cmd_vel", 1, 0))
    rig.conductor.tick(1)
    assert rig.deliver() == ["drive"]


def test_listeners_are_waited_for_after_every_turn():
    rig = Rig("/a", "/b")
    rig.conductor.tick(1)
    assert rig.settled == 2


def test_who_does_not_answer_is_named_with_its_last_answer():
    rig = Rig("/a", "/b")
    rig.scripts["/b"] = lambda request: answer(note="following the wall")
    rig.conductor.tick(51 * MS)
    rig.scripts["/b"] = lambda request: None
    with pytest.raises(LockstepError) as caught:
        rig.conductor.tick(101 * MS)
    for words in ("/b has not answered tick 2 at 0.101 s within 2 s", "tick 1 at 0.051 s", "\"following the wall\""):
        assert words in str(caught.value)


def test_one_that_never_answered_is_said_to_have_said_nothing():
    rig = Rig("/a")
    rig.scripts["/a"] = lambda request: None
    with pytest.raises(LockstepError, match="it has not answered any before"):
        rig.conductor.tick(1)


def test_one_that_died_is_named_with_the_reason():
    rig = Rig("/a")
    rig.scripts["/a"] = lambda request: TurnFailed("connection reset")
    with pytest.raises(LockstepError, match=r"/a failed in tick 1 .*connection reset"):
        rig.conductor.tick(1)


def test_messages_that_were_counted_and_do_not_come_are_an_error():
    rig = Rig("/a")
    rig.conductor.tick(0)
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 1, 1))
    rig.send("/a", "only one")
    with pytest.raises(LockstepError, match=r"/a says .*published 2 messages on /cmd_vel"):
        rig.conductor.tick(1)


def test_messages_of_the_very_first_turn_must_come_all_the_same():
    rig = Rig("/a")
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 3, 1))
    with pytest.raises(LockstepError, match=r"/a says in tick 1 .*published 1 messages on /cmd_vel"):
        rig.conductor.tick(1)


def test_messages_before_the_connection_are_not_waited_for():
    rig = Rig("/a")
    rig.send("/a", "heard")
    rig.send("/a", "go")
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 4, 1))         # three of them did not arrive
    rig.conductor.tick(1)
    assert rig.deliver() == ["go"] and rig.waits[-2:] == [1.0, 2.0]
    rig.send("/a", "second")
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 0, 1))
    rig.conductor.tick(2)
    assert rig.deliver() == ["second"]


def test_a_lost_early_message_is_not_counted_as_a_command():
    rig = Rig("/a", "/b")
    rig.send("/a", "of /a")
    rig.send("/b", "of /b")
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 0, 1))
    rig.scripts["/b"] = lambda request: answer(("/cmd_vel", 2, 1))
    rig.conductor.tick(1)
    assert rig.deliver() == ["of /b"]           # its own turn's, not one from before all turns


def test_messages_during_a_replacement_are_not_waited_for():
    rig = Rig("/a")
    rig.conductor.tick(1)
    rig.inbox.close(rig.slot)
    rig.slot = rig.inbox.open("/cmd_vel", rig.delivered.append)
    rig.send("/a", "not held back")
    rig.conductor.mark_connected()
    rig.scripts["/a"] = lambda request: answer(("/cmd_vel", 1, 0))
    rig.conductor.tick(2)
    with pytest.raises(LockstepError, match="published 1 messages"):
        rig.conductor.tick(3)                   # connected all the time


def test_topics_without_a_subscription_are_not_waited_for():
    rig = Rig("/a")
    rig.scripts["/a"] = lambda request: answer(("/state", 0, 5))
    rig.conductor.tick(1)


def test_continuing_leaves_out_a_silent_controller_and_logs_it(caplog):
    rig = Rig("/a", "/b", continue_on_silence=True)
    rig.scripts["/a"] = lambda request: None
    with caplog.at_level(logging.WARNING):
        rig.conductor.tick(1)
        rig.conductor.tick(2)
    assert [name for name, _ in rig.requests] == ["/a", "/b", "/b"]
    assert rig.conductor.lost == ["/a"] and "/a has not answered" in caplog.text
    rig.send("/a", "late")
    assert rig.deliver() == ["late"]            # not a controller now


def test_a_returning_controller_keeps_its_place():
    rig = Rig("/a", "/b", continue_on_silence=True)
    rig.scripts["/a"] = lambda request: None
    rig.conductor.tick(51 * MS)
    rig.counts.count("/odom")
    rig.scripts["/a"] = lambda request: answer()
    rig.conductor.join("/a", 75 * MS, 0)
    rig.counts.count("/odom")
    del rig.requests[:]
    rig.conductor.tick(101 * MS)
    (first, request), (second, _) = rig.requests
    assert (first, second) == ("/a", "/b") and rig.conductor.lost == []
    assert request.since_ns == 75 * MS and request.news == {"/odom": 1}


def test_after_a_reset_of_time_no_controller_is_late():
    rig = Rig("/a", continue_on_silence=True)
    rig.conductor.tick(51 * MS)
    rig.conductor.join("/b", 75 * MS)
    rig.scripts["/b"] = lambda request: answer()
    rig.conductor.tick(101 * MS)
    rig.conductor.tick(1 * MS)
    assert [request.since_ns for name, request in rig.requests if name == "/b"] == [75 * MS, 0]


def test_a_controller_may_leave_or_end_the_run():
    rig = Rig("/a", "/b")
    rig.scripts["/a"] = lambda request: answer(leave=True)
    rig.conductor.tick(1)
    assert rig.conductor.over is None
    rig.scripts["/b"] = lambda request: answer(over=True)
    rig.conductor.tick(2)
    assert [name for name, _ in rig.requests] == ["/a", "/b", "/b"]
    assert rig.conductor.over == "/b" and rig.conductor.members == [] and rig.conductor.lost == []


def test_one_that_has_left_can_still_stop_the_robot():
    rig = Rig("/a")

    def leave(request):
        rig.send("/a", "drive")
        rig.send("/a", "stop")                  # sent after the answer, and here before it was looked at
        return answer(("/cmd_vel", 0, 1), leave=True)

    rig.scripts["/a"] = leave
    rig.conductor.tick(1)
    assert rig.deliver() == ["stop"]
    rig.send("/a", "stop again")
    assert rig.deliver() == ["stop again"]


def test_the_last_turn_of_a_run_is_finished_by_all():
    rig = Rig("/a", "/b")
    rig.scripts["/a"] = lambda request: answer(over=True)
    rig.scripts["/b"] = lambda request: answer(("/cmd_vel", 1, 0))
    rig.send("/b", "stop")
    rig.conductor.tick(1)
    assert rig.deliver() == ["stop"]


# ---- replies ------------------------------------------------------------------------------------------------------

def test_as_many_replies_as_triggers_are_waited_for():
    rig = Rig(replies=[Reply("/scan", "/cmd_vel")])
    rig.counts.count("/scan")
    rig.counts.count("/scan")
    rig.send("/script", "one")
    with pytest.raises(LockstepError, match="/scan -> /cmd_vel: no answer on /cmd_vel to /scan"):
        rig.conductor.collect_replies(51 * MS)
    rig.send("/script", "two")
    rig.conductor.collect_replies(51 * MS)
    assert rig.deliver() == ["two"] and rig.settled == 1
    waits = len(rig.waits)
    rig.conductor.collect_replies(52 * MS)
    assert len(rig.waits) == waits              # nothing new, nothing owed


def test_only_the_named_nodes_replies_count():
    rig = Rig(replies=[Reply("/scan", "/cmd_vel", "/script")])
    rig.counts.count("/scan")
    rig.send("/joystick", "left")
    assert rig.deliver() == ["left"]
    with pytest.raises(LockstepError, match="by /script"):
        rig.conductor.collect_replies(0)


def test_once_is_once():
    rig = Rig(replies=[Reply("/scan", "/cmd_vel", once=True)])
    for _ in range(3):
        rig.counts.count("/scan")
    rig.send("/script", "only")
    rig.conductor.collect_replies(0)
    rig.counts.count("/scan")
    rig.conductor.collect_replies(0)
    assert rig.deliver() == ["only"]


def test_after_the_one_reply_messages_count_at_once():
    rig = Rig(replies=[Reply("/scan", "/cmd_vel", once=True)])
    rig.counts.count("/scan")
    rig.send("/script", "reply")
    rig.send("/script", "one more")
    rig.conductor.collect_replies(0)
    assert rig.deliver() == ["one more"]
    rig.send("/script", "later")
    assert rig.deliver() == ["later"]


def test_two_replies_on_one_topic_are_held_until_both_are_done():
    rig = Rig(replies=[Reply("/scan", "/cmd_vel", once=True), Reply("/odom", "/cmd_vel", once=True)])
    for trigger in ("/scan", "/odom"):
        rig.counts.count(trigger)
        rig.send("/script", "to " + trigger)
        rig.conductor.collect_replies(0)
        assert rig.deliver() == ["to " + trigger]
    rig.send("/script", "later")
    assert rig.deliver() == ["later"]


def test_a_surplus_reply_does_not_shift_those_that_follow(caplog):
    rig = Rig(replies=[Reply("/scan", "/cmd_vel")])
    rig.send("/script", "surplus")
    for number in range(3):
        rig.counts.count("/scan")
        rig.send("/script", number)
        rig.conductor.collect_replies(number * MS)
        assert rig.deliver() == [number]
    rig.counts.count("/scan")
    rig.send("/script", "surplus")
    rig.send("/script", 3)
    rig.conductor.collect_replies(3 * MS)
    assert rig.deliver() == [3]
    assert caplog.text.count("2 messages on /cmd_vel") == 1


def test_continuing_without_a_reply(caplog):
    rig = Rig(replies=[Reply("/scan", "/cmd_vel")], continue_on_silence=True)
    rig.counts.count("/scan")
    rig.conductor.collect_replies(0)
    assert "no answer on /cmd_vel" in caplog.text
    waits = len(rig.waits)
    rig.counts.count("/scan")
    rig.conductor.collect_replies(50 * MS)
    assert len(rig.waits) == waits              # given up
    rig.send("/script", "late")
    assert rig.deliver() == ["late"]

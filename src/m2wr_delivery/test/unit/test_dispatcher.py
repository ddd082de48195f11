# SPDX-License-Identifier: BSD-3-Clause
"""The base sells each parcel to the robot with the least bid, and learns what became of it."""
import pytest

from m2wr_delivery.dispatcher import ASSIGNED, DONE, GIVEN_UP, OPEN, SILENCE, WAITING, Dispatcher
from m2wr_delivery.parcels import DELIVERED, FAILED, RETURNED, Parcel, Result, Status

PARCELS = [Parcel("p1", (1.0, 0.0), (2.0, 0.0)), Parcel("p2", (3.0, 0.0), (4.0, 0.0))]


def status(robot, time, bids=None, parcel="", results=(), loaded=False):
    return Status(robot, time, (0.0, 0.0), 1.0, "waiting", parcel, loaded, tuple(results), bids or {})


def sold(dispatcher, now=0.0):
    dispatcher.assign(now)
    for name, known in list(dispatcher.heard.items()):
        dispatcher.hear(known._replace(time=now + WAITING))
    return dispatcher.assign(now + WAITING)


def test_the_least_bid_wins_and_each_robot_gets_one():
    base = Dispatcher(PARCELS)
    base.hear(status("a", 0.0, {"p1": 5.0, "p2": 6.0}))
    base.hear(status("b", 0.0, {"p1": 4.0, "p2": 9.0}))
    board = sold(base)
    assert board.assigned == {"b": PARCELS[0], "a": PARCELS[1]} and board.offered == ()


def test_nothing_is_sold_before_other_robots_could_bid():
    base = Dispatcher(PARCELS)
    base.hear(status("a", 0.0, {"p1": 5.0}))
    assert base.assign(0.0).assigned == {}
    base.hear(status("a", 1.0, {"p1": 5.0}))
    assert base.assign(1.0).assigned == {}


def test_a_robot_that_is_not_heard_gets_nothing():
    base = Dispatcher(PARCELS)
    base.hear(status("a", 0.0, {"p1": 5.0}))
    base.assign(10.0)
    assert base.assign(20.0).assigned == {}


def test_a_delivered_parcel_is_done():
    base = Dispatcher(PARCELS[:1])
    base.hear(status("a", 0.0, {"p1": 1.0}))
    sold(base)
    base.hear(status("a", 9.0, results=[Result("p1", DELIVERED, 8.0)]))
    assert base.entries["p1"].state == DONE and base.finished


def test_a_failed_parcel_is_offered_again_and_then_given_up():
    base = Dispatcher(PARCELS[:1])
    base.hear(status("a", 0.0, {"p1": 1.0}))
    sold(base)
    base.hear(status("a", 9.0, {"p1": 1.0}, results=[Result("p1", FAILED, 8.0, "stuck")]))
    assert base.entries["p1"].state == OPEN
    base.assign(9.0)
    assert base.assign(9.0 + WAITING).assigned == {}, "the robot that failed"
    base.hear(status("b", 12.0, {"p1": 5.0}))
    assert sold(base, 12.0).assigned == {"b": PARCELS[0]}
    base.hear(status("b", 20.0, results=[Result("p1", FAILED, 19.0, "no way")]))
    assert base.entries["p1"].state == GIVEN_UP and base.entries["p1"].attempts == {"a": "stuck", "b": "no way"}


def test_a_parcel_that_was_brought_back_is_given_up():
    base = Dispatcher(PARCELS[:1])
    base.hear(status("a", 0.0, {"p1": 1.0}))
    sold(base)
    base.hear(status("a", 9.0, results=[Result("p1", RETURNED, 8.0, "no way")]))
    assert base.entries["p1"].state == GIVEN_UP


@pytest.mark.parametrize("loaded, state", [(False, OPEN), (True, ASSIGNED)])
def test_a_silent_robot_loses_a_parcel_that_it_has_not_loaded(loaded, state):
    base = Dispatcher(PARCELS[:1])
    base.hear(status("a", 0.0, {"p1": 1.0}))
    sold(base)
    base.hear(status("a", 5.0, parcel="p1", loaded=loaded))
    base.assign(6.0 + SILENCE)
    assert base.entries["p1"].state == state
    assert ("not heard since 5 s" in base.entries["p1"].attempts.get("a", "")) is not loaded


def test_a_result_counts_once_and_old_messages_do_not():
    base = Dispatcher(PARCELS[:1])
    failed = [Result("p1", FAILED, 1.0, "x")]
    base.hear(status("a", 5.0, results=failed))
    base.hear(status("a", 6.0, results=failed))
    base.hear(status("a", 2.0, {"p1": 1.0}))
    assert base.heard["a"].time == 6.0 and base.entries["p1"].attempts == {"a": "x"}


def test_two_parcels_of_one_name_are_refused():
    with pytest.raises(ValueError, match="one name"):
        Dispatcher([PARCELS[0], PARCELS[0]])

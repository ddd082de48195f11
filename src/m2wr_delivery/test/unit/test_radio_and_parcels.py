# SPDX-License-Identifier: BSD-3-Clause
"""Radio messages: who hears whom, and nothing but well-formed messages is taken."""
import pytest

from m2wr_delivery.parcels import DELIVERED, Board, Parcel, Result, Status, board_of, status_of
from m2wr_delivery.radio import MOST_BYTES, decode, encode, groups

PARCEL = Parcel("parcel1", (1.0, 2.0), (3.0, 4.0))
STATUS = Status("robot1", 5.0, (1.0, 2.0), 0.5, "waiting", "parcel1", True, (Result("parcel0", DELIVERED, 4.0),),
                {"parcel2": 9.0})


def test_robots_pass_messages_on():
    places = {"base": (0.0, 0.0), "a": (4.0, 0.0), "b": (8.0, 0.0), "c": (20.0, 0.0)}
    assert sorted(map(sorted, groups(places, 5.0))) == [["a", "b", "base"], ["c"]]
    assert sorted(map(sorted, groups(places, 3.0))) == [["a"], ["b"], ["base"], ["c"]]


def test_messages_survive_the_radio():
    assert status_of(decode(encode(STATUS.message()))) == STATUS
    board = Board(7.0, (PARCEL,), {"robot2": PARCEL})
    assert board_of(decode(encode(board.message()))) == board
    assert status_of({"kind": "board"}) is None and board_of({"kind": "status"}) is None


@pytest.mark.parametrize("text, words", [
    ("x" * (MOST_BYTES + 1), "at most"), ("[1]", "list"), ("{", "Expecting"), ('{"a": NaN}', "NaN"),
    ("[" * 15000, "nested too deeply")])
def test_what_is_no_message_is_refused(text, words):
    with pytest.raises(ValueError, match=words):
        decode(text)


@pytest.mark.parametrize("change, words", [
    ({"robot": 1}, "robot"), ({"robot": "x" * 400}, "robot"), ({"time": "now"}, "time"), ({"time": True}, "time"),
    ({"place": [1.0]}, "place"), ({"place": [1.0, None]}, "place"), ({"battery": 1e999}, "battery"),
    ({"results": [["p", "lost", 1.0, ""]]}, "result"), ({"results": [[]] * 1001}, "results"),
    ({"bids": {"p": "cheap"}}, "bid"), ({"bids": []}, "bids")])
def test_a_wrong_status_is_refused_with_its_member(change, words):
    with pytest.raises(ValueError, match=words):
        status_of(dict(decode(encode(STATUS.message())), **change))


@pytest.mark.parametrize("change", [{"offered": [["p", [0, 0]]]}, {"offered": {}}, {"assigned": {"robot1": "p"}},
                                    {"time": None}])
def test_a_wrong_board_is_refused(change):
    with pytest.raises(ValueError):
        board_of(dict(decode(encode(Board(1.0, (PARCEL,), {}).message())), **change))

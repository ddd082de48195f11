# SPDX-License-Identifier: BSD-3-Clause
"""Parcels, and messages about them between robots and base."""
from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, NamedTuple, Optional, Tuple

Point = Tuple[float, float]

DELIVERED, FAILED, RETURNED = RESULTS = ("delivered", "failed", "returned")
MOST_RESULTS = 1000         # of a robot in one message
MOST_TEXT = 300             # characters of a name or reason


class Parcel(NamedTuple):
    """What has to be brought from where to where; places in the frame of the base [m]."""

    name: str
    pick_up: Point
    drop_off: Point


class Result(NamedTuple):
    """What became of a parcel that a robot was assigned: one of RESULTS, at which time [s], and why."""

    parcel: str
    result: str
    time: float
    reason: str = ""


class Status(NamedTuple):
    """What a robot tells once a second.

    Attributes
    ----------
    robot : str
    time : float
        [s]
    place : (float, float)
        Where it takes itself to be [m].
    battery : float
        0 to 1.
    stage : str
    parcel : str
        That it was assigned; empty: none.
    loaded : bool
    results : tuple of Result
        All so far, so that a message that is lost is no loss.
    bids : dict of str to float
        Time for each offered parcel [s]; absent: it cannot.
    """

    robot: str
    time: float
    place: Point
    battery: float
    stage: str
    parcel: str = ""
    loaded: bool = False
    results: Tuple[Result, ...] = ()
    bids: Dict[str, float] = {}

    def message(self) -> Dict[str, Any]:
        """Return it as a message for :func:`m2wr_delivery.radio.encode`."""
        return dict(self._asdict(), kind="status", results=[list(result) for result in self.results])


class Board(NamedTuple):
    """What the base tells once a second: the parcels that are offered, and who was assigned which."""

    time: float
    offered: Tuple[Parcel, ...]
    assigned: Dict[str, Parcel]

    def message(self) -> Dict[str, Any]:
        """Return it as a message for :func:`m2wr_delivery.radio.encode`."""
        return {"kind": "board", "time": self.time, "offered": [list(parcel) for parcel in self.offered],
                "assigned": {robot: list(parcel) for robot, parcel in self.assigned.items()}}


def _number(value: Any, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise ValueError("{} is {!r}; expected a finite number".format(what, value))
    return float(value)


def _text(value: Any, what: str) -> str:
    if not isinstance(value, str) or len(value) > MOST_TEXT:
        raise ValueError("{} is {}; expected a text of at most {} characters".format(
            what, type(value).__name__, MOST_TEXT))
    return value


def _rows(value: Any, what: str) -> List[Any]:
    if not isinstance(value, list) or len(value) > MOST_RESULTS:
        raise ValueError("{} is no list of at most {}".format(what, MOST_RESULTS))
    return value


def _point(value: Any, what: str) -> Point:
    if not isinstance(value, list) or len(value) != 2:
        raise ValueError("{} is not [x, y]".format(what))
    return _number(value[0], what), _number(value[1], what)


def _mapping(value: Any, what: str) -> Mapping[str, Any]:
    if not isinstance(value, dict) or len(value) > MOST_RESULTS:
        raise ValueError("{} is no object of at most {} members".format(what, MOST_RESULTS))
    return value


def _parcel(value: Any) -> Parcel:
    row = _rows(value, "a parcel")
    if len(row) != 3:
        raise ValueError("a parcel has {} members; expected name, pick-up and drop-off".format(len(row)))
    return Parcel(_text(row[0], "the name of a parcel"), _point(row[1], "a pick-up"), _point(row[2], "a drop-off"))


def status_of(message: Mapping[str, Any]) -> Optional[Status]:
    """Return the status in a message; None if it is of another kind.

    Raises
    ------
    ValueError
        If something in it is missing or wrong.
    """
    if message.get("kind") != "status":
        return None
    results = []
    for row in _rows(message.get("results"), "results"):
        if not isinstance(row, list) or len(row) != 4 or row[1] not in RESULTS:
            raise ValueError("a result is not [parcel, one of {}, time, reason]".format(", ".join(RESULTS)))
        results.append(Result(_text(row[0], "a parcel"), row[1], _number(row[2], "a time"), _text(row[3], "a reason")))
    offers = _mapping(message.get("bids"), "bids")
    bids = {_text(name, "a parcel"): _number(bid, "a bid") for name, bid in offers.items()}
    return Status(_text(message.get("robot"), "robot"), _number(message.get("time"), "time"),
                  _point(message.get("place"), "place"), _number(message.get("battery"), "battery"),
                  _text(message.get("stage"), "stage"), _text(message.get("parcel"), "parcel"),
                  message.get("loaded") is True, tuple(results), bids)


def board_of(message: Mapping[str, Any]) -> Optional[Board]:
    """Return the board in a message; None if it is of another kind.

    Raises
    ------
    ValueError
        If something in it is missing or wrong.
    """
    if message.get("kind") != "board":
        return None
    offered = tuple(_parcel(row) for row in _rows(message.get("offered"), "offered"))
    assigned = _mapping(message.get("assigned"), "assigned")
    return Board(_number(message.get("time"), "time"), offered,
                 {_text(robot, "a robot"): _parcel(row) for robot, row in assigned.items()})

# SPDX-License-Identifier: BSD-3-Clause
"""The base: assigns parcels to robots by auction, and keeps what it hears of them."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import Dict, List, Mapping, Sequence, Set, Tuple

from m2wr_delivery.parcels import DELIVERED, RETURNED, Board, Parcel, Status

FRESH = 3.0                 # s: an older status is of a robot that is not heard
WAITING = 2.0               # s that the base waits for more bids after the first one
SILENCE = 120.0             # s after which a parcel is offered again, if the robot had not loaded it
MOST_ATTEMPTS = 2           # robots that try a parcel

OPEN, ASSIGNED, DONE, GIVEN_UP = "open", "assigned", "delivered", "given up"


@dataclass
class Entry:
    """What the base knows of a parcel.

    Attributes
    ----------
    parcel : Parcel
    state : str
        OPEN, ASSIGNED, DONE or GIVEN_UP.
    robot : str
        That it is assigned to, or that delivered it.
    since : float
        When that was assigned [s].
    attempts : dict of str to str
        Why robots did not deliver it.
    """

    parcel: Parcel
    state: str = OPEN
    robot: str = ""
    since: float = 0.0
    attempts: Dict[str, str] = field(default_factory=dict)


class Dispatcher:
    """Sells parcels by sequential single-item auctions (Lagoudakis et al., 2005): the least bid of all wins.

    Parameters
    ----------
    parcels : sequence of Parcel

    Attributes
    ----------
    entries : dict of str to Entry
        By the names of the parcels.
    heard : dict of str to Status
        The last status of each robot.

    Raises
    ------
    ValueError
        If two parcels have one name.
    """

    def __init__(self, parcels: Sequence[Parcel]) -> None:
        self.entries = {parcel.name: Entry(parcel) for parcel in parcels}
        if len(self.entries) != len(parcels):
            raise ValueError("two parcels have one name")
        self.heard: Dict[str, Status] = {}
        self._read: Dict[str, int] = {}         # robot -> number of its results that were read
        self._first_bid = -1.0

    @property
    def finished(self) -> bool:
        """Whether every parcel was delivered or given up."""
        return all(entry.state in (DONE, GIVEN_UP) for entry in self.entries.values())

    def hear(self, status: Status) -> None:
        """Take what a robot tells."""
        before = self.heard.get(status.robot)
        if before is not None and status.time < before.time:
            return
        self.heard[status.robot] = status
        for result in status.results[self._read.get(status.robot, 0):]:
            entry = self.entries.get(result.parcel)
            if entry is None or entry.state == DONE:
                continue
            if result.result == DELIVERED:
                entry.state, entry.robot = DONE, status.robot
                continue
            entry.attempts[status.robot] = result.reason
            if entry.state == ASSIGNED and entry.robot == status.robot:
                entry.state, entry.robot = OPEN, ""
            if result.result == RETURNED or len(entry.attempts) >= MOST_ATTEMPTS:
                entry.state = GIVEN_UP
        self._read[status.robot] = len(status.results)

    def assign(self, now: float) -> Board:
        """Sell what can be sold; return what to tell the robots.

        Parameters
        ----------
        now : float
            [s]
        """
        self._reopen(now)
        busy = {entry.robot for entry in self.entries.values() if entry.state == ASSIGNED}
        idle = {name: status for name, status in self.heard.items()
                if now - status.time < FRESH and not status.parcel and name not in busy}
        bids = self._bids(idle)
        if not bids:
            self._first_bid = -1.0
        elif self._first_bid < 0.0:
            self._first_bid = now
        if bids and now - self._first_bid >= WAITING:
            self._sell(bids, now)
        offered = tuple(entry.parcel for entry in self.entries.values() if entry.state == OPEN)
        return Board(now, offered, {entry.robot: entry.parcel for entry in self.entries.values()
                                    if entry.state == ASSIGNED})

    def give_up(self, parcel: str, robot: str, reason: str) -> None:
        """Give up a parcel that is on a lost robot, even if the base has offered it again meanwhile.

        Parameters
        ----------
        parcel, robot, reason : str
        """
        entry = self.entries[parcel]
        if entry.state in (OPEN, ASSIGNED):
            entry.attempts[robot] = reason
            entry.state = GIVEN_UP

    def _reopen(self, now: float) -> None:
        for entry in self.entries.values():
            if entry.state != ASSIGNED:
                continue
            status = self.heard[entry.robot]
            if now - max(status.time, entry.since) > SILENCE and not status.loaded:
                entry.attempts[entry.robot] = "not heard since {:.0f} s, when it was at ({:.1f}, {:.1f})".format(
                    status.time, *status.place)
                entry.state = GIVEN_UP if len(entry.attempts) >= MOST_ATTEMPTS else OPEN
                entry.robot = ""

    def _bids(self, idle: Mapping[str, Status]) -> List[Tuple[float, str, str]]:
        """Return (bid, robot, parcel) of robots for open parcels that they have not tried, in order."""
        return sorted((bid, name, parcel) for name, status in idle.items() for parcel, bid in status.bids.items()
                      if parcel in self.entries and self.entries[parcel].state == OPEN
                      and name not in self.entries[parcel].attempts)

    def _sell(self, bids: Sequence[Tuple[float, str, str]], now: float) -> None:
        sold: Set[str] = set()
        for _, robot, parcel in bids:
            if robot not in sold and self.entries[parcel].state == OPEN:
                sold.add(robot)
                entry = self.entries[parcel]
                entry.state, entry.robot, entry.since = ASSIGNED, robot, now

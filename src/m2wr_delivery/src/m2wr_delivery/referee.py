# SPDX-License-Identifier: BSD-3-Clause
"""What is true: batteries, loads, who hears whom, and when the run ends."""
from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_delivery.carrier import FULL, TILT
from m2wr_delivery.dispatcher import ASSIGNED, GIVEN_UP, OPEN, SILENCE, Dispatcher
from m2wr_delivery.energy import Battery, EnergyModel
from m2wr_delivery.parcels import status_of
from m2wr_delivery.radio import BASE, decode, encode, groups
from m2wr_delivery.scenario import BERTH, CHARGER_REACH

if TYPE_CHECKING:
    from m2wr_delivery.parcels import Parcel, Point
    from m2wr_delivery.scenario import Scenario

REACH = 0.6                 # m from robot to a parcel or a drop-off
HOME = 0.5                  # m from a robot's own place at the base: at home
STANDING = 0.08             # m/s: a slower robot can be loaded
TELL_PERIOD = 1.0           # s between two messages of the base
FIX_NOISE = 0.03            # m: standard deviation of a differential GPS with its antenna on open ground
IDLE_LIMIT = 90.0           # s without any event, with nothing assigned, after which the run ends


class Truth(NamedTuple):
    """Where a robot really is: x, y, z [m], heading and tilt of its z axis [rad]."""

    x: float
    y: float
    z: float
    yaw: float
    tilt: float


class Senses(NamedTuple):
    """What a robot is told.

    Attributes
    ----------
    battery : float
        0 to 1.
    loaded : bool
    inbox : tuple of str
        Radio messages.
    fix : (float, float) or None
        Where it is, if the base hears it, once a second [m].
    """

    battery: float
    loaded: bool
    inbox: Tuple[str, ...]
    fix: "Optional[Point]" = None


class Event(NamedTuple):
    """Something that happened at a time [s]."""

    time: float
    text: str


@dataclass
class Cargo:
    """A parcel as it really is.

    Attributes
    ----------
    parcel : Parcel
    place : (float, float)
        Where it lies, if no robot carries it [m].
    robot : str
        That carries it, or brought it last; empty: none yet.
    carried : bool
    picked_up, delivered : float or None
        When [s].
    """

    parcel: "Parcel"
    place: "Point"
    robot: str = ""
    carried: bool = False
    picked_up: Optional[float] = None
    delivered: Optional[float] = None


@dataclass
class Member:
    """A robot as it really is.

    Attributes
    ----------
    battery : Battery
    truth : Truth or None
    distance : float
        Driven [m].
    in_contact : float
        Time in radio contact with the base [s].
    path : list of (float, float)
        One point a second [m].
    end : str
        Why it moves no more; empty: it can move.
    told : float
        When it last sent a radio message, heard or not [s].
    silent : str
        Since when its node has told nothing; empty: it tells.
    """

    battery: Battery
    truth: Optional[Truth] = None
    distance: float = 0.0
    in_contact: float = 0.0
    speed: float = 0.0
    path: List["Point"] = field(default_factory=list)
    end: str = ""
    told: float = math.nan
    silent: str = ""

    @property
    def lost(self) -> str:
        """Why nothing is to be expected of it any more; empty: it is at work."""
        return self.end or self.silent


class Referee:
    """The run.

    Parameters
    ----------
    scenario : Scenario
    energy : EnergyModel, optional

    Attributes
    ----------
    cargo : dict of str to Cargo
    members : dict of str to Member
    base : Dispatcher
    events : list of Event
    time, began : float
        Of the last and of the first step [s].
    rejected : list of str
        Why messages were refused.
    """

    def __init__(self, scenario: Scenario, energy: Optional[EnergyModel] = None) -> None:
        self._scenario, self._energy = scenario, energy or EnergyModel()
        self.cargo = {parcel.name: Cargo(parcel, parcel.pick_up) for parcel in scenario.parcels}
        self.members = {name: Member(Battery(scenario.settings.capacity)) for name in scenario.starts}
        self.base = Dispatcher(scenario.parcels)
        self.events: List[Event] = []
        self.time, self._told, self._changed, self.began = 0.0, -math.inf, 0.0, math.nan
        self._states: Dict[str, str] = {}
        self.rejected: List[str] = []
        self._random = np.random.default_rng([scenario.seed, 11])

    def step(self, now: float, truth: Mapping[str, Truth], outboxes: Mapping[str, Sequence[str]]) -> Dict[str, Senses]:
        """Take what robots did, and find what they sense next.

        Parameters
        ----------
        now : float
            [s]
        truth : mapping of str to Truth
            Of the robots that are known now.
        outboxes : mapping of str to sequence of str
            Their radio messages.

        Returns
        -------
        dict of str to Senses
        """
        if math.isnan(self.began):
            self.began = self._changed = now
        elapsed, self.time = max(0.0, now - self.time) if self.time else 0.0, now
        for name, place in truth.items():
            self._move(name, place, elapsed)
        for name in self.members:
            self._listen(name, bool(outboxes.get(name)))
        fixes: Dict[str, Point] = {}
        inboxes = self._pass_on(now, outboxes, elapsed, fixes)
        self._note()
        carriers = {cargo.robot for cargo in self.cargo.values() if cargo.carried}
        return {name: Senses(member.battery.share, name in carriers, tuple(inboxes[name]), fixes.get(name))
                for name, member in self.members.items()}

    def powered(self, name: str) -> bool:
        """Return whether a robot has energy left."""
        return not self.members[name].battery.flat

    def pick_up(self, name: str) -> str:
        """Load the parcel beside a robot; return why not, or nothing."""
        member = self.members[name]
        problem = self._cannot_handle(name)
        if problem:
            return problem
        if any(cargo.carried and cargo.robot == name for cargo in self.cargo.values()):
            return "{} carries a parcel already".format(name)
        wanted = [cargo for cargo in self.cargo.values() if not cargo.carried and cargo.delivered is None
                  and self._away(member, cargo.place) < REACH]
        told = self.base.heard.get(name)
        wanted.sort(key=lambda cargo: told is None or cargo.parcel.name != told.parcel)     # its own one first
        if not wanted:
            return "there is no parcel within {:g} m of {}".format(REACH, name)
        wanted[0].robot, wanted[0].carried, wanted[0].picked_up = name, True, self.time
        self._event("{} picks up {}".format(name, wanted[0].parcel.name))
        return ""

    def put_down(self, name: str) -> str:
        """Unload the parcel of a robot; return why not, or nothing."""
        member = self.members[name]
        cargo = next((cargo for cargo in self.cargo.values() if cargo.carried and cargo.robot == name), None)
        problem = self._cannot_handle(name) or ("" if cargo else "{} carries nothing".format(name))
        if problem or cargo is None or member.truth is None:
            return problem
        cargo.carried, cargo.place = False, (member.truth.x, member.truth.y)
        if self._away(member, cargo.parcel.drop_off) < REACH:
            cargo.delivered = self.time
            self._event("{} delivers {}".format(name, cargo.parcel.name))
        else:
            self._event("{} puts {} down at ({:.1f}, {:.1f})".format(name, cargo.parcel.name, *cargo.place))
        return ""

    def finished(self) -> str:
        """Return why the run ends, or nothing."""
        if self.time - self.began > self._scenario.settings.limit:
            return "the limit of {:g} s".format(self._scenario.settings.limit)
        if all(member.lost for member in self.members.values()):
            return "no robot can move"
        if self.base.finished and all(member.lost or self._home(name) for name, member in self.members.items()):
            return "every parcel is delivered or given up, and the robots are back"
        busy = any(entry.state == ASSIGNED for entry in self.base.entries.values())
        if not busy and self.time - self._changed > IDLE_LIMIT \
                and all(member.lost or member.battery.share >= FULL for member in self.members.values()):
            return "no robot takes the parcels that are left"
        return ""

    # ---- parts of a step -----------------------------------------------------------------------------------------

    def _move(self, name: str, truth: Truth, elapsed: float) -> None:
        member = self.members[name]
        before, member.truth = member.truth, truth
        if before is None or elapsed <= 0.0:
            return
        length = math.hypot(truth.x - before.x, truth.y - before.y)
        turned = math.remainder(truth.yaw - before.yaw, 2.0 * math.pi)
        member.distance, member.speed = member.distance + length, length / elapsed
        member.battery.take(elapsed * self._energy.power(length / elapsed, (truth.z - before.z) / elapsed,
                                                         turned / elapsed))
        if math.hypot(truth.x, truth.y) < CHARGER_REACH and not member.end:
            member.battery.charge(elapsed * self._scenario.settings.charger)
        if not member.path or int(self.time) > int(self.time - elapsed):
            member.path.append((truth.x, truth.y))
        if not member.end and truth.tilt > TILT:
            member.end = "tipped over at ({:.1f}, {:.1f})".format(truth.x, truth.y)
            self._event("{} {}".format(name, member.end))
        if not member.end and member.battery.flat:
            member.end = "battery flat at ({:.1f}, {:.1f})".format(truth.x, truth.y)
            self._event("{}: {}".format(name, member.end))

    def _listen(self, name: str, tells: bool) -> None:
        """Note whether the node of a robot tells anything; one that has ended does not, and its robot stands."""
        member = self.members[name]
        if tells or math.isnan(member.told):
            member.told = self.time
            if member.silent:
                member.silent = ""
                self._event("{} tells something again".format(name))
        elif not member.lost and self.time - member.told > SILENCE:
            place = member.truth or Truth(math.nan, math.nan, 0.0, 0.0, 0.0)
            member.silent = "its node has told nothing since {:.0f} s, at ({:.1f}, {:.1f})".format(
                member.told - self.began, place.x, place.y)
            self._event("{}: {}".format(name, member.silent))

    def _pass_on(self, now: float, outboxes: Mapping[str, Sequence[str]], elapsed: float,
                 fixes: "Dict[str, Point]") -> Dict[str, List[str]]:
        """Pass messages on within range; those of the base too. Fill in fixes; return the inboxes."""
        places = {name: (member.truth.x, member.truth.y) for name, member in self.members.items()
                  if member.truth is not None and not member.battery.flat}
        inboxes: Dict[str, List[str]] = {name: [] for name in self.members}
        for group in groups(dict(places, **{BASE: (0.0, 0.0)}), self._scenario.settings.radio):
            for name in sorted(group - {BASE}):
                for text in outboxes.get(name, ()):
                    self._deliver(name, text, group, inboxes)
            if BASE in group:
                for name in group - {BASE}:
                    self.members[name].in_contact += elapsed
                if now - self._told >= TELL_PERIOD:
                    self._told = now
                    board = encode(self.base.assign(now).message())
                    for name in sorted(group - {BASE}):
                        inboxes[name].append(board)
                        x, y = self._random.normal(places[name], FIX_NOISE).tolist()
                        fixes[name] = (x, y)
        self._write_off()
        return inboxes

    def _deliver(self, name: str, text: str, group: "frozenset[str]", inboxes: Dict[str, List[str]]) -> None:
        try:
            status = status_of(decode(text))
            if status is None:
                raise ValueError("it is no status; only the base tells something else")
            if status.robot != name:
                raise ValueError("it is a status of {}".format(status.robot))
        except ValueError as error:
            self.rejected.append("radio message of {} is refused: {}".format(name, error))
            return
        if BASE in group:
            self.base.hear(status)
        for other in group - {BASE, name}:
            inboxes[other].append(text)

    def _write_off(self) -> None:
        """Give up what lost robots have; no other robot can fetch a parcel from them."""
        for parcel, cargo in self.cargo.items():
            if cargo.carried and self.members[cargo.robot].lost:
                self.base.give_up(parcel, cargo.robot, self.members[cargo.robot].lost)

    def _note(self) -> None:
        """Write down what the base learns."""
        for name, entry in self.base.entries.items():
            state = "{} {}".format(entry.state, entry.robot if entry.state == ASSIGNED else "").strip()
            if self._states.get(name, OPEN) != state:
                self._states[name] = state
                if entry.state == ASSIGNED:
                    self._event("{} is assigned to {}".format(name, entry.robot))
                elif entry.state == GIVEN_UP:
                    self._event("{} is given up: {}".format(name, "; ".join(sorted(entry.attempts.values()))))
                elif entry.state == OPEN:
                    self._event("{} is open again".format(name))

    def _event(self, text: str) -> None:
        self.events.append(Event(self.time - self.began, text))
        self._changed = self.time

    def _cannot_handle(self, name: str) -> str:
        member = self.members[name]
        if member.end or member.truth is None:
            return "{} cannot move".format(name)
        if member.speed > STANDING:
            return "{} drives at {:.2f} m/s; expected it to stand".format(name, member.speed)
        return ""

    def _away(self, member: Member, place: "Point") -> float:
        return math.inf if member.truth is None else math.hypot(place[0] - member.truth.x, place[1] - member.truth.y)

    def _home(self, name: str) -> bool:
        start = self._scenario.starts[name]
        return self._away(self.members[name], (start[0], start[1])) < max(HOME, 0.3 * BERTH)

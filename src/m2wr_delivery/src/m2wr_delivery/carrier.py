# SPDX-License-Identifier: BSD-3-Clause
"""What a robot decides: which parcel, where to, when to charge, and when to give up."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Callable, Dict, List, Mapping, NamedTuple, Optional, Sequence, Tuple

from m2wr_delivery.energy import EnergyModel
from m2wr_delivery.navigator import Navigator, Way
from m2wr_delivery.parcels import DELIVERED, FAILED, RETURNED, Board, Parcel, Result, Status, board_of, status_of
from m2wr_delivery.radio import decode, encode
from m2wr_elevation.planning import follow

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from m2wr_delivery.parcels import Point
    from m2wr_elevation.elevation_map import MapSettings

MEAN_SPEED = 0.2            # m/s, stops and turns included
CLOSE = 0.3                 # m from a goal: there
STANDS = 0.5                # s after which a robot that was stopped stands
HANDLING = 10.0             # s of attempts to load or unload
PLAN_PERIOD, TELL_PERIOD, BID_PERIOD, HOME_PERIOD = 0.5, 1.0, 5.0, 5.0      # s
BLOCKED = 10.0              # s without a way over traversable ground, after which a goal is given up
FORGOTTEN = 5.0             # s after which a robot is no longer where it said it was
RESERVE = 1.5               # times the energy for the way home
KEPT = 0.1                  # of the capacity, never planned with
FULL = 0.95                 # of the capacity
STILL, STILL_TIME = 0.15, 5.0           # m, above the noise of two fixes; s without moving by it: stuck
FIX_AGE = 2.0               # s after which wheels and map say better where the robot is
PATIENCE = (4.0, 60.0)      # times the time that the way to a goal should take, and seconds more: no progress
TURNED = 0.4                # rad: a robot that turned by it moves
ESCAPE, ESCAPE_TIME, MOST_ESCAPES = (-0.25, 0.5), 2.0, 8        # m/s, rad/s; s; for one parcel
YIELD, YIELD_ANGLE, YIELD_TIME = 1.0, 1.2, 6.0      # m; rad; s: waits for a robot ahead with a lesser name
TILT = math.radians(60.0)   # tipped over

WAITING, TO_PICK_UP, LOADING, TO_DROP_OFF, UNLOADING, TO_CHARGER, CHARGING, BRINGING_BACK, TIPPED = STAGES = (
    "waiting", "to pick-up", "loading", "to drop-off", "unloading", "to charger", "charging", "bringing back", "tipped")

Layers = Mapping[str, "NDArray[np.float64]"]


class Sense(NamedTuple):
    """What a robot knows at one time.

    Attributes
    ----------
    time : float
        [s]
    x, y, yaw : float
        Where it takes itself to be [m, rad].
    tilt : float
        Of its z axis [rad].
    battery : float
        0 to 1.
    loaded : bool
    inbox : sequence of str
        Radio messages.
    layers : callable
        Returns the layers of its elevation map.
    fix : (float, float) or None
        Where the base says it is, if that is new [m].
    """

    time: float
    x: float
    y: float
    yaw: float
    tilt: float
    battery: float
    loaded: bool
    inbox: Sequence[str]
    layers: Callable[[], Layers]
    fix: "Optional[Point]" = None


class Action(NamedTuple):
    """Velocity [m/s], yaw rate [rad/s], radio messages, and what to do with a parcel: pick_up, put_down or nothing."""

    linear: float
    angular: float
    outbox: Tuple[str, ...] = ()
    request: str = ""


class Carrier:
    """The decisions of one robot.

    Parameters
    ----------
    name : str
    home : (float, float)
        Its place at the charger [m].
    capacity : float
        Of its battery [J].
    settings : MapSettings
        Of its elevation map.
    half : float
        Half the side of the field [m].
    charger : float
        Power of the charger [W].
    energy : EnergyModel, optional

    Attributes
    ----------
    stage : str
        Of STAGES.
    way : Way or None
        That it follows.
    rejected : list of str
        Why radio messages were refused.
    """

    def __init__(self, name: str, home: Point, capacity: float, settings: MapSettings, half: float,
                 charger: float, energy: Optional[EnergyModel] = None) -> None:
        self.name, self.stage = name, WAITING
        self.way: Optional[Way] = None
        self._home, self._capacity, self._charger, self._energy = home, capacity, charger, energy or EnergyModel()
        self._navigator = Navigator(settings, half)
        self.rejected: List[str] = []
        self._task: Optional[Parcel] = None
        self._results: List[Result] = []
        self._others: Dict[str, Tuple[float, Point]] = {}
        self._board: Optional[Board] = None
        self._bids: Dict[str, float] = {}
        self._reason = ""                   # why the parcel is brought back
        self._home_length = 0.0             # m
        self._due: Dict[str, float] = {}    # work -> when it is due [s]
        self._looked = -math.inf            # when the navigator was shown the map [s]
        self._still: Optional[Tuple[float, float, float, float]] = None     # time, x, y, yaw
        self._fix: Optional[Tuple[float, Point]] = None
        self._sought: Optional[Point] = None            # goal that is driven to
        self._late = math.inf                           # when that takes too long [s]
        self._escaping = self._yielding = -math.inf
        self._escapes = 0
        self._blocked_since = self._handling_since = math.inf

    def step(self, sense: Sense) -> Action:
        """Return what to do now; call it ten times a second."""
        self._listen(sense)
        if sense.fix is not None:
            self._fix = (sense.time, sense.fix)
        if sense.tilt > TILT and self.stage != TIPPED:
            self._end(sense, FAILED, "tipped over at ({:.1f}, {:.1f})".format(sense.x, sense.y))
            self.stage = TIPPED
        command, request = (0.0, 0.0), ""
        if self.stage != TIPPED:
            self._decide(sense)
            goal = self._goal(sense)
            if goal is None:
                self._still = self._sought = None
                if sense.time - self._handling_since > STANDS and self._is_due("handle", sense.time, TELL_PERIOD):
                    request = {LOADING: "pick_up", UNLOADING: "put_down", BRINGING_BACK: "put_down"}.get(self.stage, "")
            else:
                command = self._drive(sense, goal)
        outbox: Tuple[str, ...] = ()
        if self._is_due("tell", sense.time, TELL_PERIOD):
            self._bid(sense)
            status = Status(self.name, sense.time, (sense.x, sense.y), sense.battery, self.stage,
                            self._task.name if self._task else "", sense.loaded, tuple(self._results), self._bids)
            outbox = (encode(status.message()),)
        return Action(command[0], command[1], outbox, request)

    def others(self, now: float) -> List[Point]:
        """Return where the robots are that were heard lately [m].

        Parameters
        ----------
        now : float
            [s]
        """
        return [place for heard, place in self._others.values() if now - heard < FORGOTTEN]

    # ---- what to do ----------------------------------------------------------------------------------------------

    def _listen(self, sense: Sense) -> None:
        for text in sense.inbox:
            try:
                message = decode(text)
                board, status = board_of(message), status_of(message)
            except ValueError as error:
                self.rejected.append(str(error))
                continue
            if board is not None:
                self._board = board
            elif status is not None and status.robot != self.name:
                self._others[status.robot] = (sense.time, status.place)

    def _decide(self, sense: Sense) -> None:
        """Set the stage."""
        assigned = self._board.assigned.get(self.name) if self._board else None
        if self._task is None and assigned and not any(result.parcel == assigned.name for result in self._results):
            self._task, self._escapes = assigned, 0
            self.stage = TO_PICK_UP
        elif self._task is not None and assigned != self._task and self.stage == TO_PICK_UP:
            self._leave()               # the base has given it to another robot
        if self.stage in (TO_CHARGER, CHARGING):
            self._charge(sense)
        elif self._needs_charge(sense):
            self.stage = TO_CHARGER
        elif self.stage == BRINGING_BACK and self._handling_since == math.inf and self._is_at(sense, self._home):
            self._handling_since = sense.time
        elif self.stage in (LOADING, UNLOADING, BRINGING_BACK):
            self._handle(sense)
        elif self.stage == TO_PICK_UP and self._task and self._is_at(sense, self._task.pick_up):
            self.stage, self._handling_since = LOADING, sense.time
        elif self.stage == TO_DROP_OFF and self._task and self._is_at(sense, self._task.drop_off):
            self.stage, self._handling_since = UNLOADING, sense.time

    def _charge(self, sense: Sense) -> None:
        if self.stage == TO_CHARGER and self._is_at(sense, self._home):
            self.stage = CHARGING
        if self.stage == CHARGING and sense.battery >= FULL:
            self.stage = WAITING if self._task is None else TO_DROP_OFF if sense.loaded else TO_PICK_UP
            if sense.loaded and self._reason:
                self.stage = BRINGING_BACK

    def _handle(self, sense: Sense) -> None:
        """Load or unload until it is done or takes too long."""
        assert self._task is not None
        if self.stage == LOADING and sense.loaded:
            self.stage = TO_DROP_OFF
        elif self.stage == UNLOADING and not sense.loaded:
            self._end(sense, DELIVERED)
        elif self.stage == BRINGING_BACK and not sense.loaded:
            self._end(sense, RETURNED, self._reason)
        elif sense.time - self._handling_since > HANDLING and self.stage == LOADING:
            self._end(sense, FAILED, "there is no parcel to load")
        elif sense.time - self._handling_since > HANDLING and self.stage == UNLOADING:
            self._fail(sense, "the parcel could not be put down")

    def _needs_charge(self, sense: Sense) -> bool:
        if self._is_due("home", sense.time, HOME_PERIOD):
            self._look(sense)
            self._home_length = self._navigator.plan((sense.x, sense.y), self._home).length
        wanted = RESERVE * self._energy.for_way(self._home_length, MEAN_SPEED) + KEPT * self._capacity
        return sense.battery * self._capacity < wanted

    def _goal(self, sense: Sense) -> Optional[Point]:
        """Return where to drive; None to stand."""
        if self.stage == TO_PICK_UP and self._task:
            return self._task.pick_up
        if self.stage == TO_DROP_OFF and self._task:
            return self._task.drop_off
        if self.stage in (TO_CHARGER, BRINGING_BACK, WAITING) and not self._is_at(sense, self._home):
            return self._home
        return None

    def _is_at(self, sense: Sense, place: Point) -> bool:
        return math.hypot(place[0] - sense.x, place[1] - sense.y) < CLOSE

    def _end(self, sense: Sense, result: str, reason: str = "") -> None:
        """Write down what became of the parcel, and wait for another."""
        if self._task is not None:
            self._results.append(Result(self._task.name, result, sense.time, reason))
        self._leave()

    def _leave(self) -> None:
        """Wait for another parcel."""
        self._task, self._reason, self.stage, self.way = None, "", WAITING, None

    def _fail(self, sense: Sense, reason: str) -> None:
        """Give a parcel up: where it is, or at the base if it was loaded."""
        if sense.loaded and self.stage != BRINGING_BACK:
            self.stage, self._reason, self._escapes, self._handling_since = BRINGING_BACK, reason, 0, math.inf
        elif not sense.loaded:
            self._end(sense, FAILED, reason)

    def _look(self, sense: Sense) -> None:
        """Show the navigator the map, once in a step."""
        if self._looked != sense.time:
            self._looked = sense.time
            self._navigator.see(sense.layers())

    def _bid(self, sense: Sense) -> None:
        """Compute how long each offered parcel would take."""
        if self._task is not None or self.stage not in (WAITING, CHARGING) or not self._board:
            self._bids = {}
            return
        offered = {parcel.name: parcel for parcel in self._board.offered}
        self._bids = {name: bid for name, bid in self._bids.items() if name in offered}
        if not self._is_due("bid", sense.time, BID_PERIOD) and self._bids:
            return
        self._look(sense)
        for name, parcel in offered.items():
            if any(result.parcel == name for result in self._results):
                continue
            legs = [self._navigator.plan(*ends) for ends in (
                ((sense.x, sense.y), parcel.pick_up), (parcel.pick_up, parcel.drop_off), (parcel.drop_off, self._home))]
            needed = RESERVE * self._energy.for_way(sum(leg.length for leg in legs), MEAN_SPEED)
            reason = ""
            if legs[0].blocked or legs[1].blocked:
                reason = "no traversable way to its {}".format("pick-up" if legs[0].blocked else "drop-off")
            elif needed > (1.0 - KEPT) * self._capacity:
                reason = "its way may need {:.0f} J, of {:.0f} J in the battery {:.0f} are kept".format(
                    needed, self._capacity, KEPT * self._capacity)
            if reason:
                self._results.append(Result(name, FAILED, sense.time, reason))
                continue
            missing = max(0.0, needed + KEPT * self._capacity - sense.battery * self._capacity)
            self._bids[name] = (legs[0].length + legs[1].length) / MEAN_SPEED + missing / self._charger

    # ---- how to drive --------------------------------------------------------------------------------------------

    def _drive(self, sense: Sense, goal: Point) -> Tuple[float, float]:
        """Return the command towards a goal."""
        now = sense.time
        if now < self._escaping:
            return ESCAPE[0], ESCAPE[1] if self._escapes % 2 else -ESCAPE[1]
        if self._is_due("plan", now, PLAN_PERIOD) or self.way is None:
            self._look(sense)
            self.way = self._navigator.plan((sense.x, sense.y), goal, self.others(now))
            self._look_for_block(sense)
        if self.way is not None and goal != self._sought:
            self._sought, self._late = goal, now + PATIENCE[0] * self.way.length / MEAN_SPEED + PATIENCE[1]
        if now > self._late:
            self._late = math.inf
            self._fail(sense, "no progress near ({:.1f}, {:.1f})".format(sense.x, sense.y))
        if self.way is None:            # the goal was given up
            return 0.0, 0.0
        if self._gives_way(sense) or self._ends_here(sense):
            self._still = None
            return 0.0, 0.0
        if self._is_stuck(sense):
            return self._escape(sense)
        return follow(self.way.points, sense.x, sense.y, sense.yaw)

    def _look_for_block(self, sense: Sense) -> None:
        assert self.way is not None
        if not self.way.blocked or self.stage not in (TO_PICK_UP, TO_DROP_OFF):
            self._blocked_since = math.inf
            return
        self._blocked_since = min(self._blocked_since, sense.time)
        if sense.time - self._blocked_since > BLOCKED:
            self._blocked_since = math.inf
            self._fail(sense, "no traversable way to its {} from ({:.1f}, {:.1f})".format(
                "pick-up" if self.stage == TO_PICK_UP else "drop-off", sense.x, sense.y))

    def _ends_here(self, sense: Sense) -> bool:
        """Return whether the robot is where its way would enter ground that is not traversable."""
        return self.way is not None and self.way.blocked \
            and self._is_at(sense, (float(self.way.points[-1, 0]), float(self.way.points[-1, 1])))

    def _gives_way(self, sense: Sense) -> bool:
        """Return whether to wait for a robot ahead whose name is less."""
        for name, (heard, (x, y)) in self._others.items():
            ahead = math.remainder(math.atan2(y - sense.y, x - sense.x) - sense.yaw, 2.0 * math.pi)
            if name < self.name and sense.time - heard < FORGOTTEN and abs(ahead) < YIELD_ANGLE \
                    and math.hypot(x - sense.x, y - sense.y) < YIELD:
                if self._yielding == -math.inf:
                    self._yielding = sense.time
                return sense.time - self._yielding < YIELD_TIME
        self._yielding = -math.inf
        return False

    def _is_stuck(self, sense: Sense) -> bool:
        """Return whether the robot neither moves nor turns; wheels that slip do not count if the base is heard."""
        x, y = sense.x, sense.y
        if self._fix is not None and sense.time - self._fix[0] < FIX_AGE:
            x, y = self._fix[1]
        if self._still is None or math.hypot(x - self._still[1], y - self._still[2]) > STILL \
                or abs(math.remainder(sense.yaw - self._still[3], 2.0 * math.pi)) > TURNED:
            self._still = (sense.time, x, y, sense.yaw)
        return sense.time - self._still[0] > STILL_TIME

    def _escape(self, sense: Sense) -> Tuple[float, float]:
        """Back away from a place where the robot got stuck, and keep away from it."""
        self._navigator.avoid(sense.x + 0.4 * math.cos(sense.yaw), sense.y + 0.4 * math.sin(sense.yaw))
        self._escaping, self._still, self.way = sense.time + ESCAPE_TIME, None, None
        self._escapes += 1
        if self._escapes > MOST_ESCAPES:
            self._escapes = 0
            self._fail(sense, "stuck at ({:.1f}, {:.1f})".format(sense.x, sense.y))
        return ESCAPE

    def _is_due(self, work: str, now: float, period: float) -> bool:
        if now < self._due.get(work, -math.inf):
            return False
        self._due[work] = now + period
        return True

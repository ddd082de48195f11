# SPDX-License-Identifier: BSD-3-Clause
"""Lockstep over rospy: starts when all nodes are connected, then asks controllers for turns and waits for listeners."""
from __future__ import annotations

import logging
import threading
import time
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

import rospy

from m2wr_lockstep.errors import ConfigError, LockstepError
from m2wr_lockstep.server.conductor import Conductor, PendingAnswer, TurnRequest
from m2wr_lockstep.server.interfaces import Loop, Simulator
from m2wr_lockstep.server.participants import read_listeners, read_replies
from m2wr_lockstep.server.ros.caller import Caller
from m2wr_lockstep.server.ros.gate import Gate, Look
from m2wr_lockstep.server.ros.listeners import ListenerBarrier
from m2wr_lockstep.server.ros.topics import LockstepTopics
from m2wr_node.internals.connections import Connection

log = logging.getLogger(__name__)

_LOOK_PAUSE = 0.1               # s of wall time between two looks at the graph
_RETURN_PAUSE = 1.0             # the same while the run continues without a controller, which may come back
_REMIND = 5.0                   # s of wall time between two log lines on what is missing


class Settings(NamedTuple):
    """The node's parameters: lists of entries as the README of m2wr_sim describes them, and wall time [s]."""

    controllers: Sequence[str]
    replies: Sequence[str]
    listeners: Sequence[str]
    patience: float
    continue_on_silence: bool


class Lockstep:
    """Advances a simulation only when all participants are connected and have answered.

    Parameters
    ----------
    settings : Settings
    topics : LockstepTopics

    Raises
    ------
    ConfigError
        If no controller and no reply is named, or an entry cannot be read.
    """

    _loop: Loop                         # these three from attach() on
    _simulator: Simulator
    _conductor: Conductor

    def __init__(self, settings: Settings, topics: LockstepTopics) -> None:
        self._topics, self._settings = topics, settings
        replies = read_replies(settings.replies, rospy.resolve_name)
        listeners = read_listeners(settings.listeners, rospy.resolve_name)
        names = [rospy.resolve_name(name) for name in settings.controllers]
        if not (names or replies):
            raise ConfigError("parameter ~lockstep is true, but ~lockstep_controllers and ~lockstep_replies are "
                              "empty; expected the names of the nodes that control the robot")
        self._names, self._listeners, self._replies = names, listeners, replies
        self._gate = Gate(names, listeners, replies, lambda: bool(topics.ticking))
        self._barrier = ListenerBarrier(listeners, settings.patience, settings.continue_on_silence,
                                        self._close_for)
        self._callers: Dict[str, Caller] = {}
        self._connections: Sequence[Connection] = ()
        self._look: Optional[Tuple[int, Look, List[str]]] = None        # generation, result, expected controllers
        self._open, self._generation = False, 0
        self._wanted, self._closing = threading.Event(), False
        self._failure: Optional[LockstepError] = None
        self._missing: List[str] = []
        self._waited = 0.0
        topics.triggers = {reply.trigger for reply in replies}
        topics.before_trigger = self._before_trigger

    def attach(self, loop: Loop, simulator: Simulator) -> None:
        """Start to look for the participants.

        Parameters
        ----------
        loop : Loop
            Of the simulation's thread.
        simulator : Simulator
        """
        self._loop, self._simulator = loop, simulator
        self._barrier.attach(loop)
        self._conductor = Conductor(self._ask, loop.wait_until, self._topics.inbox, self._topics.counts, self._replies,
                                    self._settings.patience, self._settings.continue_on_silence,
                                    lambda: self._barrier.wait(self._barrier.foreign))
        self._topics.on_arrival = loop.wake
        threading.Thread(target=self._watch, name="lockstep gate", daemon=True).start()

    def close(self) -> None:
        """Disconnect from the controllers."""
        self._closing = True
        self._wanted.set()
        for caller in self._callers.values():
            caller.close()

    # ---- called by the loop ------------------------------------------------------------------------------------

    def open(self) -> bool:
        """Return whether time may advance; if not, a thread looks for what is missing."""
        if self._conductor.over:
            return False
        if self._topics.changed:
            for reply in self._replies:
                self._topics.listen(reply.topic)
            self._topics.changed, self._open = False, False
            self._outdate()
        if self._open and not self._conductor.lost:
            return True
        self._wanted.set()
        look, self._look = self._look, None
        if look is not None and look[0] == self._generation:
            self._admit(*look[1:])
        return self._open

    def advance(self, until_ns: int) -> int:
        """Advance to the simulator's next event, at most to ``until_ns``, and wait for the participants there.

        Raises
        ------
        LockstepError
            If one does not answer, unless the run continues without it.
        """
        now_ns = self._simulator.advance(until_ns)
        if self._failure is not None:
            raise self._failure
        conductor = self._conductor
        if self._replies:
            conductor.collect_replies(now_ns)
        if self._topics.tick_due:
            self._topics.tick_due = False
            lost, began = len(conductor.lost), time.monotonic()
            conductor.tick(now_ns)
            if len(conductor.lost) != lost:
                self._outdate()
            self._barrier.wait(self._barrier.all)
            self._waited += time.monotonic() - began
            if conductor.over:
                log.info("lockstep: %s ended the run at %.3f s (tick %d); simulated time stops",
                         conductor.over, now_ns * 1e-9, conductor.ticks)
        return now_ns

    def status(self) -> Tuple[bool, int, float, List[str], List[str]]:
        """Return ``(open, ticks, seconds waited in ticks, names of lost controllers, what is missing)``."""
        conductor = self._conductor
        return (self._open and not conductor.over, conductor.ticks, self._waited, list(conductor.lost),
                ["nothing: %s ended the run" % conductor.over] if conductor.over
                else [] if self._open else list(self._missing))

    # ---- participants ------------------------------------------------------------------------------------------

    def _outdate(self) -> None:
        """Discard what was seen so far, and what is being looked at now."""
        self._generation += 1
        self._look = None

    def _watch(self) -> None:
        """Look at the graph, in a thread of its own, while a look is wanted."""
        logged = time.monotonic()
        while not self._closing and not rospy.is_shutdown():
            if not self._wanted.wait(_REMIND):
                logged = time.monotonic()
                continue
            opening, missing = not self._open, ["the end of an error (see the log)"]
            try:
                missing = self._look_once()
            except Exception:       # the next look may succeed
                log.exception("lockstep: looking for the participants failed; trying again")
            self._missing = missing
            if not missing:
                logged = time.monotonic()
            elif opening and time.monotonic() - logged > _REMIND:
                logged = time.monotonic()
                log.info("lockstep: simulation paused at %.3f s until there is %s", self._simulator.now_ns * 1e-9,
                         "; ".join(missing[:6]) + ("; and %d more" % (len(missing) - 6) if len(missing) > 6 else ""))
            time.sleep(_LOOK_PAUSE if opening else _RETURN_PAUSE)

    def _look_once(self) -> List[str]:
        """Look at the graph and keep the result if nothing is missing; returns what is."""
        generation, expected = self._generation, self._expected()
        look = self._gate.look(set(self._names) - set(expected))
        if not look.missing:
            self._wanted.clear()        # first: it may be wanted again as soon as the result is stored
            self._look = (generation, look, expected)
            self._loop.wake()
        return look.missing

    def _expected(self) -> List[str]:
        """Return the controllers that must be present: all at the start, later those that have not left.

        Of the lost ones it is one at a time, and only when its last call has ended, so that each can come back alone.
        """
        conductor = self._conductor
        if not conductor.ticks:
            return self._names
        if not self._open:
            return [member.name for member in list(conductor.members)]
        callers = [(name, self._callers.get(name)) for name in list(conductor.lost)]
        back = [name for name, caller in callers if caller is None or caller.idle()]
        turn = back[int(time.monotonic()) % len(back):][:1] if back else []
        return [member.name for member in list(conductor.members)] + turn

    def _admit(self, look: Look, expected: List[str]) -> None:
        """Add the new participants, all of which are connected, and let time advance."""
        conductor = self._conductor
        first = not conductor.ticks
        for name in expected:
            present = [member.name for member in conductor.members]
            if name not in present and (first or name in conductor.lost):
                old, self._callers[name] = self._callers.get(name), Caller(name, self._loop.wake)
                if old is not None:
                    old.close()
                order = self._names.index
                conductor.join(name, self._simulator.now_ns, sum(order(other) < order(name) for other in present))
                if not first:
                    log.info("lockstep: %s takes part from %.3f s on", name, self._simulator.now_ns * 1e-9)
        conductor.mark_connected()
        self._outdate()         # a look from before does not know who is lost from now on
        self._connections = look.connections
        self._barrier.connect(look.connections)
        if not self._open:
            self._open = True
            log.info("lockstep: all nodes are connected at %.3f s: %s%s", self._simulator.now_ns * 1e-9,
                     ", ".join([member.name for member in conductor.members] + [str(reply) for reply in self._replies]),
                     "; listeners: " + ", ".join(entry.name for entry in self._listeners) if self._listeners else "")

    def _ask(self, name: str, request: TurnRequest) -> PendingAnswer:
        return self._callers[name].ask(request)

    def _before_trigger(self) -> None:
        """Wait within a step: an error is raised after it, as a plugin would be blamed for it here."""
        try:
            self._barrier.wait(self._barrier.shared, between_steps=False)
        except LockstepError as error:
            self._failure = error

    def _close_for(self, name: str) -> None:
        """Stop time until a listener that has died has been started again."""
        log.warning("lockstep: %s has died at %.3f s; simulated time stops until it is back", name,
                    self._simulator.now_ns * 1e-9)
        self._gate.forget(name, self._connections)
        self._open = False
        self._outdate()

# SPDX-License-Identifier: BSD-3-Clause
"""The node's loop: one thread owns the world, other threads send it requests."""
from __future__ import annotations

import math
import queue
import threading
import time
from typing import TYPE_CHECKING, Any, Callable, Optional, Tuple, TypeVar

from m2wr_sim.runtime.simulator import Simulator

if TYPE_CHECKING:
    from m2wr_lockstep.server.ros.lockstep import Lockstep

_Result = TypeVar("_Result")

_BATCH_NS = 10000000        # of simulated time between two checks of the request queue
_BATCH_WALL = 0.05          # s of wall time, at most, of a batch; viewers would see longer ones as jumps
_SLOW = _BATCH_NS * 1e-9 / _BATCH_WALL      # real-time factor below which batches are shorter for that reason
_IDLE_WAIT = 0.1            # s, while paused
_MAX_LAG = 0.1              # s of wall time of delay that is made up for; beyond it the schedule restarts
_LIGHT = 0.001              # s of CPU time of an average batch, below which stepping is lazy
_SAMPLE = 16                # batches over which that average is taken
_HOUSEKEEPING = 5           # batches between two calls of on_turn while stepping is lazy
_LEAST_SHARE = 0.001        # s of wall time that the requests of one turn may always take


class ShuttingDown(Exception):
    """The loop has ended and answers no more requests."""


class _Request:
    """A call that waits to run in the loop's thread."""

    def __init__(self, function: Callable[[], Any]) -> None:
        self._function, self._done = function, threading.Event()
        self._result: Any = None
        self._error: Optional[BaseException] = None

    def run(self) -> None:
        try:
            self._result = self._function()
        except BaseException as error:          # raised in the waiting thread
            self._error = error
        self._done.set()

    def refuse(self) -> None:
        self._error = ShuttingDown("the simulation is shutting down")
        self._done.set()

    def wait(self) -> Any:
        self._done.wait()
        if self._error is not None:
            raise self._error
        return self._result


def _nothing() -> None:
    """Do nothing, in the loop's thread."""


def batch_length(factor: float, step_ns: int) -> int:
    """Return the length of a batch of steps.

    Parameters
    ----------
    factor : float
        Real-time factor; 0: as fast as possible.
    step_ns : int
        Physics step [ns].

    Returns
    -------
    int
        Simulated time [ns].
    """
    if not 0.0 < factor < _SLOW:
        return _BATCH_NS
    return max(int(_BATCH_WALL * 1e9 * factor) // step_ns, 1) * step_ns


class Pacer:
    """Synchronises simulated time with wall time.

    A delay of more than 0.1 s is not made up for: a slow machine gets a slower simulation instead of jumps.
    """

    def __init__(self, factor: float, clock: Callable[[], float] = time.monotonic) -> None:
        self._factor, self._clock = factor, clock
        self._origin: Optional[Tuple[float, int]] = None

    def restart(self) -> None:
        """Start a new schedule at the next call of :meth:`ahead`."""
        self._origin = None

    def ahead(self, now_ns: int) -> float:
        """Return by how much the simulation is ahead of its schedule [s of wall time], at least 0."""
        if not self._factor:
            return 0.0
        wall = self._clock()
        if self._origin is None:
            self._origin = (wall, now_ns)
        ahead = self._origin[0] + (now_ns - self._origin[1]) * 1e-9 / self._factor - wall
        if ahead < -_MAX_LAG:
            self._origin = (wall, now_ns)
        return max(0.0, ahead)


class Loop:
    """Steps a simulator and serves requests at step boundaries.

    A request is answered at the next step boundary. There is one exception: simulated time is behind its schedule, and
    requests have taken 0.1 s more than the steps meanwhile. Then requests and steps get equal shares of the time: a
    request waits until the batch of steps has ended and earlier requests are answered.

    Parameters
    ----------
    simulator : Simulator
    factor : float
        Simulated seconds per second; 0: as fast as possible.
    stopping : callable
        Returns whether to end.
    on_turn : callable
        Housekeeping: called every 10 to 50 ms of simulated time, and while the loop is idle; must be quick.
    lockstep : Lockstep, optional
        Advances the simulator instead of this loop.
    """

    def __init__(self, simulator: Simulator, factor: float, stopping: Callable[[], bool], on_turn: Callable[[], Any],
                 lockstep: Optional[Lockstep] = None) -> None:
        self._simulator, self._stopping, self._on_turn = simulator, stopping, on_turn
        self._lockstep, self._served = lockstep, False
        self._factor, self._pacer = factor, Pacer(factor)
        self._requests: "queue.SimpleQueue[_Request]" = queue.SimpleQueue()
        # A lock that is free if requests have arrived. It is waited for instead of the queue: a signal at the end of a
        # SimpleQueue's timeout makes that wait endless.
        self._arrived = threading.Lock()
        self._arrived.acquire()
        self._ended = False
        self._stepped = 0.0             # s of CPU time of the steps in the last batch with requests
        self._debt = 0.0                # s by which requests have delayed the steps, not yet made up for
        self._lazily, self._turns, self._spent = False, 0, math.inf     # see _choose

    def set_factor(self, factor: float) -> None:
        """Continue with another real-time factor; call this in the loop's thread."""
        self._factor, self._pacer = factor, Pacer(factor)

    def step(self) -> str:
        """Make one step while paused; call this in the loop's thread. Return why it was refused, or ""."""
        simulator = self._simulator
        if self._lockstep is not None:
            return "in lockstep, steps wait for the answers of the controllers; single steps are not possible"
        if not simulator.paused:
            return "the simulation runs; pause it first, with the service pause_physics or \"rosrun m2wr_sim pause\""
        simulator.paused = False
        try:
            simulator.advance(simulator.now_ns + simulator.step_ns)
        finally:
            simulator.paused = True
        return ""

    def call(self, function: Callable[[], _Result]) -> _Result:
        """Run ``function()`` in the loop's thread between two steps and return its result."""
        request = _Request(function)
        self._put(request)
        if self._ended:
            self._refuse_all()
        return request.wait()

    def wake(self) -> None:
        """Make :meth:`wait_until` check its condition again; any thread may call this."""
        self._put(_Request(_nothing))

    def stopping(self) -> bool:
        """Return whether the loop is to end."""
        return self._stopping()

    def end_if_asked(self) -> None:
        """Raise ShuttingDown if the loop is to end; for long operations in the loop's thread."""
        if self._stopping():
            raise ShuttingDown("the simulation is shutting down")

    def _put(self, request: _Request) -> None:
        self._requests.put(request)
        self._announce()

    def _announce(self) -> None:
        try:
            self._arrived.release()
        except RuntimeError:            # it is free already
            pass

    def wait_until(self, condition: Callable[[], bool], seconds: float) -> bool:
        """Serve requests until a condition holds.

        Parameters
        ----------
        condition : callable
            Returns a bool.
        seconds : float
            Greatest wall time to wait [s].

        Returns
        -------
        bool
            Whether the condition holds.

        Raises
        ------
        ShuttingDown
            If the loop is to end before.
        """
        deadline = time.monotonic() + seconds
        while not condition():
            self.end_if_asked()
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._serve(min(left, _IDLE_WAIT))
        return True

    def run(self) -> None:
        """Run until ``stopping()``."""
        simulator = self._simulator
        try:
            while not self._stopping():
                began, asked = time.monotonic(), self._requests.qsize()
                if asked:
                    self._serve(0.0, max(self._stepped, _LEAST_SHARE, _MAX_LAG - self._debt))
                    self._charge(began)
                if simulator.paused or not (self._lockstep is None or self._lockstep.open()):
                    self._pacer.restart()
                    self._debt = 0.0
                    self._serve(_IDLE_WAIT)
                else:
                    self._run_batch(simulator, asked > 0)
                    if self._lazily and self._turns % _HOUSEKEEPING:
                        continue
                self._on_turn()
        except ShuttingDown:
            pass
        finally:
            self._ended = True
            self._refuse_all()

    def _charge(self, since: float) -> None:
        """Add the wall time since a moment to the debt.

        The debt is limited to twice the delay that is made up for, so that one long request does not delay many others.
        """
        self._debt = min(self._debt + time.monotonic() - since, 2.0 * _MAX_LAG)

    def _run_batch(self, simulator: Simulator, asked: bool = False) -> None:
        """Advance by about 10 ms, less at a small real-time factor, then wait for the wall clock.

        ``asked`` is whether requests were served before. If so, time in which the steps wait for a CPU counts for the
        requests: on a busy machine, most of a request's cost is switching between threads.
        """
        self._turns += 1
        if self._turns % _SAMPLE == 0 and self._lockstep is None:
            self._choose()
        lazily = self._lazily
        advance = simulator.advance if self._lockstep is None else self._lockstep.advance
        # batches end on a grid, so that requests do not shift what happens at their ends
        step_ns = simulator.step_ns
        batch_ns = batch_length(self._factor, step_ns)
        end_ns = max((simulator.now_ns // batch_ns + 1) * batch_ns, simulator.now_ns + step_ns)
        self._served = False
        watched = asked or self._debt > 0.0
        began, spent = (time.monotonic(), time.thread_time()) if watched else (0.0, 0.0)
        while simulator.now_ns + step_ns <= end_ns:
            if lazily:                  # not in lockstep
                simulator.advance(end_ns, True)
            else:
                advance(end_ns)
            if self._served or self._requests.qsize() and self._debt <= _MAX_LAG:
                break
        if watched:
            self._stepped = time.thread_time() - spent
            if asked and self._lockstep is None:        # in lockstep, steps wait for controllers
                self._charge(began + self._stepped)
            self._debt = max(self._debt - self._stepped, 0.0)
        ahead = self._pacer.ahead(simulator.now_ns)
        if ahead > 0.0:
            self._debt = 0.0            # the simulation is ahead: no delay is left
        while ahead > 0.0:
            if not self._serve(min(ahead, _IDLE_WAIT), ahead) and ahead <= _IDLE_WAIT:
                return                  # on schedule
            if simulator.paused or self._stopping():
                return
            if ahead > _IDLE_WAIT:
                self._on_turn()         # at a small real-time factor, housekeeping follows wall time
            ahead = self._pacer.ahead(simulator.now_ns)

    def _choose(self) -> None:
        """Choose lazy stepping if batches take little CPU time, else regular stepping.

        Most of the cost of a short batch is to load the engine into the CPU's caches again. So lazy stepping computes
        steps only when something reads the world. With much work, steps at their time keep the clock messages regular.
        """
        spent = time.thread_time()
        self._lazily, self._spent = 0.0 <= spent - self._spent < _SAMPLE * _LIGHT, spent

    def _serve(self, patience: float, budget: float = math.inf) -> bool:
        """Answer requests in the order of their arrival; return whether any may have arrived.

        Waits up to ``patience`` seconds for the first request. After ``budget`` seconds of wall time the other requests
        wait until after the next steps. So requests delay a step by at most the budget and one request.
        """
        if patience > 0.0:
            arrived = self._arrived.acquire(True, patience)
        else:
            arrived = self._arrived.acquire(False)      # before the queue is emptied: later requests release it again
        if not arrived:
            return False
        simulator = self._simulator
        simulator.settle()              # before a request is taken: if this fails, the request is refused
        before_ns, end = simulator.now_ns, time.monotonic() + budget
        try:
            for _ in range(self._requests.qsize()):     # later requests wait, or the simulation might never advance
                self._requests.get_nowait().run()
                self._served = True
                if simulator.now_ns < before_ns:
                    self._pacer.restart()
                if time.monotonic() >= end:
                    break
        except queue.Empty:
            pass
        if self._requests.qsize():
            self._announce()
        return True

    def _refuse_all(self) -> None:
        try:
            while True:
                self._requests.get_nowait().refuse()
        except queue.Empty:
            pass

# SPDX-License-Identifier: BSD-3-Clause
"""The node's loop: one thread owns the world, everybody else asks it."""
import math
import queue
import threading
import time

_BATCH_NS = 10000000        # of simulated time between two looks at the request queue
_BATCH_WALL = 0.05          # s on the wall that a batch stands for at most, or viewers would see it as a jump
_SLOW = _BATCH_NS * 1e-9 / _BATCH_WALL      # real-time factor below which batches are shorter for that
_IDLE_WAIT = 0.1            # s, while paused
_MAX_LAG = 0.1              # s of wall time that may be caught up before the schedule is moved
_LIGHT = 0.001              # s of processor time that a batch may take on average for the engine to be left behind
_SAMPLE = 16                # batches over which that is looked at
_HOUSEKEEPING = 5           # batches between two calls of on_turn then
_LEAST_SHARE = 0.001        # s of wall time that the requests of one turn may take in any case


class ShuttingDown(Exception):
    """The loop has ended; no request is answered any more."""


class _Request:
    """A call waiting to be made in the loop's thread."""

    def __init__(self, function):
        self._function, self._done = function, threading.Event()
        self._result = self._error = None

    def run(self):
        try:
            self._result = self._function()
        except BaseException as error:          # handed to whoever waits
            self._error = error
        self._done.set()

    def refuse(self):
        self._error = ShuttingDown("the simulation is shutting down")
        self._done.set()

    def wait(self):
        self._done.wait()
        if self._error is not None:
            raise self._error
        return self._result


def _nothing():
    """Do nothing, in the loop's thread."""


def batch_length(factor, step_ns):
    """Return how much simulated time [ns] to let pass at once, for a real-time factor (0: as fast as it can)."""
    if not 0.0 < factor < _SLOW:
        return _BATCH_NS
    return max(int(_BATCH_WALL * 1e9 * factor) // step_ns, 1) * step_ns


class Pacer:
    """Keeps simulated time in step with the wall clock.

    Time lost is not made up beyond a tenth of a second: a slow machine gets a slower simulation, not a jumpy one.
    """

    def __init__(self, factor, clock=time.monotonic):
        self._factor, self._clock = factor, clock
        self._origin = None

    def restart(self):
        """Start a new schedule at the next call of :meth:`ahead`."""
        self._origin = None

    def ahead(self, now_ns):
        """Return how many seconds the simulation is ahead of its schedule, at least 0."""
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

    A request is answered at the next step boundary.  Only if time is behind its schedule, and requests have held it up
    for 0.1 s more than the steps took meanwhile, requests and steps take equal shares: then a request waits until the
    batch of steps has ended, and for those before it.

    Parameters
    ----------
    simulator : Simulator
    factor : float
        Simulated seconds per second; 0 means as fast as it goes.
    stopping : callable
        Tells when to end.
    on_turn : callable
        Called about every 10 to 50 ms of simulated time, and while idle or waiting for long, for housekeeping; must be
        quick.
    lockstep : Lockstep, optional
        Lets time pass in the simulator's place, when it is open.
    """

    def __init__(self, simulator, factor, stopping, on_turn, lockstep=None):
        self._simulator, self._stopping, self._on_turn = simulator, stopping, on_turn
        self._lockstep, self._served = lockstep, False
        self._factor, self._pacer = factor, Pacer(factor)
        self._requests = queue.SimpleQueue()
        # waited for in the queue's place: a signal at the very end of a SimpleQueue's time-out makes that wait endless;
        # a lock that is free when something has come, for waiting on it is a single call
        self._arrived = threading.Lock()
        self._arrived.acquire()
        self._ended = False
        self._stepped = 0.0             # s of processor time that the steps of the last such batch took
        self._debt = 0.0                # s for which requests have held time up beyond that, and it is not made up for
        self._lazily, self._turns, self._spent = False, 0, math.inf     # whether the engine may be behind; see _choose

    def set_factor(self, factor):
        """Go on with another real-time factor; to be called in the loop's thread."""
        self._factor, self._pacer = factor, Pacer(factor)

    def step(self):
        """Let one step pass while paused; to be called in the loop's thread.  Returns why not, or an empty string."""
        simulator = self._simulator
        if self._lockstep is not None:
            return "in lockstep, time passes with the answers of the controllers; single steps are not possible"
        if not simulator.paused:
            return "time is running; pause it first, with the service pause_physics or \"rosrun m2wr_sim pause\""
        simulator.paused = False
        try:
            simulator.advance(simulator.now_ns + simulator.step_ns)
        finally:
            simulator.paused = True
        return ""

    def call(self, function):
        """Run ``function()`` in the loop's thread between two steps and return what it returns."""
        request = _Request(function)
        self._put(request)
        if self._ended:
            self._refuse_all()
        return request.wait()

    def wake(self):
        """Let :meth:`wait_until` look at its condition again; called from any thread."""
        self._put(_Request(_nothing))

    def stopping(self):
        """Tell whether the loop is to end."""
        return self._stopping()

    def end_if_asked(self):
        """Raise ShuttingDown if the loop is to end; for what takes long in the loop's thread."""
        if self._stopping():
            raise ShuttingDown("the simulation is shutting down")

    def _put(self, request):
        self._requests.put(request)
        self._announce()

    def _announce(self):
        try:
            self._arrived.release()
        except RuntimeError:            # it is free already
            pass

    def wait_until(self, condition, seconds):
        """Serve requests until ``condition()`` holds, at most so many wall seconds; returns whether it does.

        Raises
        ------
        ShuttingDown
            If the loop is to end meanwhile.
        """
        deadline = time.monotonic() + seconds
        while not condition():
            self.end_if_asked()
            left = deadline - time.monotonic()
            if left <= 0.0:
                return False
            self._serve(min(left, _IDLE_WAIT))
        return True

    def run(self):
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

    def _charge(self, since):
        """Add the wall time since then to the debt.

        Beyond twice what can be caught up it is forgotten: one long request does not hold up many after it.
        """
        self._debt = min(self._debt + time.monotonic() - since, 2.0 * _MAX_LAG)

    def _run_batch(self, simulator, asked=False):
        """Let about 10 ms pass, less where time is slow, and wait for the clock on the wall.

        ``asked`` tells whether requests came before it.  If so, what the steps wait for the processor counts as theirs:
        most of what a request costs on a busy machine are the changes between threads behind it.
        """
        self._turns += 1
        if self._turns % _SAMPLE == 0 and self._lockstep is None:
            self._choose()
        lazily = self._lazily
        advance = simulator.advance if self._lockstep is None else self._lockstep.advance
        # ends of batches lie on a grid, so that requests do not move moments that depend on them
        step_ns = simulator.step_ns
        batch_ns = batch_length(self._factor, step_ns)
        end_ns = max((simulator.now_ns // batch_ns + 1) * batch_ns, simulator.now_ns + step_ns)
        self._served = False
        watched = asked or self._debt > 0.0
        began, spent = (time.monotonic(), time.thread_time()) if watched else (0.0, 0.0)
        while simulator.now_ns + step_ns <= end_ns:
            if lazily:
                advance(end_ns, True)
            else:
                advance(end_ns)
            if self._served or self._requests.qsize() and self._debt <= _MAX_LAG:
                break
        if watched:
            self._stepped = time.thread_time() - spent
            if asked and self._lockstep is None:        # in lockstep, steps wait for the controllers
                self._charge(began + self._stepped)
            self._debt = max(self._debt - self._stepped, 0.0)
        ahead = self._pacer.ahead(simulator.now_ns)
        if ahead > 0.0:
            self._debt = 0.0            # all is made up for
        while ahead > 0.0:
            if not self._serve(min(ahead, _IDLE_WAIT), ahead) and ahead <= _IDLE_WAIT:
                return                  # the time is up
            if simulator.paused or self._stopping():
                return
            if ahead > _IDLE_WAIT:
                self._on_turn()         # a slow schedule: housekeeping goes by the clock on the wall
            ahead = self._pacer.ahead(simulator.now_ns)

    def _choose(self):
        """Save work up until something looks at the world if there is little: most of what a short batch of steps costs
        is to fetch the engine into the processor's caches again.  Much work is done evenly, so that clocks are in time.
        """
        spent = time.thread_time()
        self._lazily, self._spent = 0.0 <= spent - self._spent < _SAMPLE * _LIGHT, spent

    def _serve(self, patience, budget=math.inf):
        """Answer requests in the order in which they came; returns whether any may have come.

        Waits up to ``patience`` seconds for the first.  No further one is begun once they have taken ``budget`` seconds
        on the wall: the rest keeps its place in the queue, behind the next steps.  So a step is never kept from the
        simulation for longer than the budget and one request.
        """
        if patience > 0.0:
            arrived = self._arrived.acquire(True, patience)
        else:
            arrived = self._arrived.acquire(False)      # before the queue is emptied: what comes later frees it again
        if not arrived:
            return False
        simulator = self._simulator
        simulator.settle()              # before a request is taken: where this fails, the request waits to be refused
        before_ns, end = simulator.now_ns, time.monotonic() + budget
        try:
            for _ in range(self._requests.qsize()):     # what comes meanwhile waits, or time might never pass again
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

    def _refuse_all(self):
        try:
            while True:
                self._requests.get_nowait().refuse()
        except queue.Empty:
            pass

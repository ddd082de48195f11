"""The node's loop: one thread owns the world, everybody else asks it."""
import queue
import threading
import time

_BATCH_NS = 10000000        # of simulated time between two looks at the request queue
_IDLE_WAIT = 0.1            # s, while paused
_MAX_LAG = 0.1              # s of wall time that may be caught up before the schedule is moved


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

    Parameters
    ----------
    simulator : Simulator
    factor : float
        Simulated seconds per second; 0 means as fast as it goes.
    stopping : callable
        Tells when to end.
    on_turn : callable
        Called about every 10 ms of simulated time, and while idle, for housekeeping; must be quick.
    lockstep : Lockstep, optional
        Lets time pass in the simulator's place, when it is open.
    """

    def __init__(self, simulator, factor, stopping, on_turn, lockstep=None):
        self._simulator, self._stopping, self._on_turn = simulator, stopping, on_turn
        self._lockstep, self._served = lockstep, False
        self._pacer = Pacer(factor)
        self._requests = queue.SimpleQueue()
        # waited for in the queue's place: a signal at the very end of a SimpleQueue's time-out makes that wait endless
        self._arrived = threading.Event()
        self._ended = False

    def set_factor(self, factor):
        """Go on with another real-time factor; to be called in the loop's thread."""
        self._pacer = Pacer(factor)

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

    def _put(self, request):
        self._requests.put(request)
        self._arrived.set()

    def wait_until(self, condition, seconds):
        """Serve requests until ``condition()`` holds, at most so many wall seconds; returns whether it does.

        Raises
        ------
        ShuttingDown
            If the loop is to end meanwhile.
        """
        deadline = time.monotonic() + seconds
        while not condition():
            if self._stopping():
                raise ShuttingDown("the simulation is shutting down")
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
                self._serve(0.0)
                if simulator.paused or not (self._lockstep is None or self._lockstep.open()):
                    self._pacer.restart()
                    self._serve(_IDLE_WAIT)
                else:
                    self._run_batch(simulator)
                self._on_turn()
        except ShuttingDown:
            pass
        finally:
            self._ended = True
            self._refuse_all()

    def _run_batch(self, simulator):
        advance = simulator.advance if self._lockstep is None else self._lockstep.advance
        # ends of batches lie on a grid, so that requests do not move moments that depend on them
        end_ns = max((simulator.now_ns // _BATCH_NS + 1) * _BATCH_NS, simulator.now_ns + simulator.step_ns)
        self._served = False
        while simulator.now_ns < end_ns and simulator.now_ns + simulator.step_ns <= end_ns:
            advance(end_ns)
            if self._served or self._requests.qsize():
                break
        ahead = self._pacer.ahead(simulator.now_ns)
        while ahead > 0.0 and not self._stopping():
            self._serve(min(ahead, _IDLE_WAIT))
            if simulator.paused:
                return
            ahead = self._pacer.ahead(simulator.now_ns)

    def _serve(self, patience):
        """Answer requests; wait up to ``patience`` seconds for the first."""
        if patience > 0.0:
            self._arrived.wait(patience)
        try:
            if self._arrived.is_set():
                self._arrived.clear()       # before the queue is emptied: what comes later sets it again
            request = self._requests.get_nowait()
            before_ns = self._simulator.now_ns
            while True:
                request.run()
                self._served = True
                if self._simulator.now_ns < before_ns:
                    self._pacer.restart()
                request = self._requests.get_nowait()
        except queue.Empty:
            pass

    def _refuse_all(self):
        try:
            while True:
                self._requests.get_nowait().refuse()
        except queue.Empty:
            pass

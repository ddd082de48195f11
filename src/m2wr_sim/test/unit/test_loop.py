# SPDX-License-Identifier: BSD-3-Clause
"""The node's loop: pacing against a clock, requests from other threads, pause and end."""
import signal
import threading
import time

import pytest

from m2wr_sim.errors import SimError
from m2wr_sim.ros.loop import _MAX_LAG, Loop, Pacer, ShuttingDown, _Request, batch_length

MS = 1000000


class Wall:
    """A wall clock that stands until it is moved."""

    def __init__(self):
        self.now = 1000.0

    def __call__(self):
        return self.now


# -- pacing -------------------------------------------------------------------------------------------------------

@pytest.mark.parametrize("factor, ahead", [(1.0, 0.010), (2.0, 0.005), (0.5, 0.020)])
def test_the_pacer_tells_how_far_ahead_simulated_time_is(factor, ahead):
    wall = Wall()
    pacer = Pacer(factor, wall)
    assert pacer.ahead(500 * MS) == 0.0             # the schedule starts here
    assert pacer.ahead(510 * MS) == pytest.approx(ahead)
    wall.now += 0.004
    assert pacer.ahead(510 * MS) == pytest.approx(ahead - 0.004)


def test_without_a_factor_nothing_waits():
    pacer = Pacer(0.0, Wall())
    assert pacer.ahead(0) == pacer.ahead(10 ** 12) == 0.0


def test_small_delays_are_made_up_for():
    wall = Wall()
    pacer = Pacer(1.0, wall)
    pacer.ahead(0)
    wall.now += 0.09
    assert pacer.ahead(10 * MS) == 0.0              # 80 ms behind
    assert pacer.ahead(100 * MS) == pytest.approx(0.010)


def test_long_delays_are_not():
    wall = Wall()
    pacer = Pacer(1.0, wall)
    pacer.ahead(0)
    wall.now += 5.0
    assert pacer.ahead(10 * MS) == 0.0              # five seconds behind: the schedule moves
    assert pacer.ahead(30 * MS) == pytest.approx(0.020)


def test_a_restarted_schedule_starts_at_the_next_look():
    wall = Wall()
    pacer = Pacer(1.0, wall)
    pacer.ahead(0)
    wall.now += 60.0
    pacer.restart()
    assert pacer.ahead(7 * MS) == 0.0 and pacer.ahead(9 * MS) == pytest.approx(0.002)


# -- the loop -----------------------------------------------------------------------------------------------------

class Running:
    """A loop in a thread of its own, as fast as it can unless told otherwise."""

    def __init__(self, simulator, factor=0.0):
        self._stop, self.turns = threading.Event(), 0
        self.simulator = simulator
        self.loop = Loop(simulator, factor, self._stop.is_set, self._turn)
        self.thread = threading.Thread(target=self.loop.run, daemon=True)

    def _turn(self):
        self.turns += 1

    def __enter__(self):
        self.thread.start()
        return self

    def stop(self):
        self._stop.set()
        self.thread.join(10.0)
        assert not self.thread.is_alive(), "the loop does not end"

    def __exit__(self, *_):
        self.stop()

    def wait(self, condition):
        """Wait until a condition, asked for in the loop's thread, holds."""
        for _ in range(100000):
            if self.loop.call(condition):
                return
        raise AssertionError("%s never came true" % condition)


@pytest.fixture
def simulator(make_rig, build):
    rig = make_rig()
    rig.simulator.spawn(build.box("crate", 0, 0, 0.25, static=False), build.at(z=0.25))
    return rig.simulator


def test_it_runs_and_takes_turns(simulator):
    with Running(simulator) as running:
        running.wait(lambda: simulator.now_ns >= 200 * MS)
    assert running.turns >= 10


def test_requests_are_answered_in_the_loops_thread(simulator):
    with Running(simulator) as running:
        assert running.loop.call(threading.current_thread) is running.thread
        assert running.loop.call(lambda: list(simulator.models)) == ["ground_plane", "crate"]


def test_an_error_goes_to_who_asked_and_the_loop_lives_on(simulator):
    with Running(simulator) as running:
        with pytest.raises(ZeroDivisionError):
            running.loop.call(lambda: 1 // 0)
        before_ns = running.loop.call(lambda: simulator.now_ns)
        running.wait(lambda: simulator.now_ns > before_ns)


def test_requests_are_served_while_paused_and_time_stands(simulator):
    simulator.paused = True
    with Running(simulator) as running:
        assert [running.loop.call(lambda: simulator.now_ns) for _ in range(5)] == [0] * 5

        def resume():
            simulator.paused = False
        running.loop.call(resume)
        running.wait(lambda: simulator.now_ns > 0)


def test_single_steps_pass_only_while_paused(simulator):
    simulator.paused = True
    with Running(simulator) as running:
        for number in (1, 2, 3):
            assert running.loop.call(running.loop.step) == "" and simulator.now_ns == number * simulator.step_ns
        assert simulator.paused

        def resume():
            simulator.paused = False
            return running.loop.step(), simulator.now_ns
        told, now_ns = running.loop.call(resume)
        assert "the simulation runs" in told and now_ns == 3 * simulator.step_ns


def test_a_request_does_not_wait_for_a_slow_schedule(simulator):
    """At a thousandth of real time a batch of 10 ms takes ten seconds; requests come in between."""
    with Running(simulator, factor=0.001) as running:
        for _ in range(20):
            assert running.loop.call(lambda: simulator.now_ns) <= 20 * MS


def test_housekeeping_does_not_wait_for_a_slow_schedule(simulator):
    """At a thousandth of real time a batch takes ten seconds; diagnostics are due once a second of wall time."""
    with Running(simulator, factor=0.001) as running:
        deadline = time.monotonic() + 9.0
        while running.turns < 3:
            assert time.monotonic() < deadline, "%d turns at %d ns" % (running.turns, simulator.now_ns)
            time.sleep(0.01)
    assert simulator.now_ns <= 20 * MS


@pytest.mark.parametrize("factor, step_ms, batch_ms", [
    (0.0, 1, 10), (1.0, 1, 10), (0.2, 1, 10), (0.1, 1, 5), (0.05, 1, 2), (0.05, 5, 5), (0.001, 1, 1), (0.1, 3, 3)])
def test_slow_time_comes_in_short_pieces(factor, step_ms, batch_ms):
    assert batch_length(factor, step_ms * MS) == batch_ms * MS


def test_at_a_twentieth_of_real_time_nothing_jumps(simulator, monkeypatch):
    """What falls due within a batch is sent when it begins: a long one would show 200 ms of the wall at once."""
    ends, advance = [], simulator.advance
    monkeypatch.setattr(simulator, "advance", lambda until_ns, *lazily: (ends.append(until_ns),
                                                                         advance(until_ns, *lazily))[1])
    with Running(simulator, factor=0.05) as running:
        running.wait(lambda: simulator.now_ns >= 12 * MS)
    ends = sorted(set(ends))
    assert len(ends) >= 6 and all(later - earlier <= 2 * MS for earlier, later in zip([0] + ends, ends))


def test_time_passes_however_many_requests_come(simulator):
    """Each request brings the next one, as clients do that ask again as soon as they have an answer."""
    asked = []
    with Running(simulator) as running:
        def again():
            asked.append(simulator.now_ns)
            if simulator.now_ns < 50 * MS and len(asked) < 100000:
                running.loop._put(_Request(again))
        running.loop.call(again)
        running.wait(lambda: simulator.now_ns >= 50 * MS)
    assert len(asked) < 1000


def test_many_threads_ask_at_once(simulator):
    answers = []
    with Running(simulator) as running:
        def ask(number):
            for _ in range(50):
                answers.append(running.loop.call(lambda: number))
        threads = [threading.Thread(target=ask, args=(number,)) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(20.0)
    assert sorted(answers) == sorted(list(range(4)) * 50)


def test_time_continues_from_zero_after_a_reset(simulator):
    with Running(simulator, factor=50.0) as running:
        running.wait(lambda: simulator.now_ns >= 300 * MS)
        running.loop.call(simulator.reset_simulation)
        running.wait(lambda: 0 < simulator.now_ns)
        running.wait(lambda: simulator.now_ns >= 100 * MS)


def test_after_the_end_requests_are_refused(simulator):
    with Running(simulator) as running:
        running.stop()
        with pytest.raises(ShuttingDown):
            running.loop.call(lambda: None)


def test_the_end_does_not_wait_for_a_batch_of_slow_steps(simulator, build):
    simulator.spawn(build.box("other", 0.4, 0, 0.25, static=False), build.at(0.4, 0.0, 0.25))
    engine, looks = simulator.engine, []

    def look():
        looks.append(engine._steps)
        loop.end_if_asked()

    loop = Loop(simulator, 0.0, lambda: len(looks) == 3, lambda: None)
    engine.iterative_above, engine.between = 0, look        # every step takes long then
    loop.run()
    assert looks == [1, 2, 3] and simulator.now_ns >= 10 * MS
    with pytest.raises(ShuttingDown):
        loop.call(lambda: None)


def test_a_request_that_waits_at_the_end_is_refused(simulator):
    """The loop is asked from inside its own last turn by another thread, which must not hang."""
    outcome = []
    stopping = threading.Event()

    def ask():
        try:
            outcome.append(loop.call(lambda: "answered"))
        except ShuttingDown:
            outcome.append("refused")

    asking = threading.Thread(target=ask)

    def last_turn():
        stopping.set()
        asking.start()

    loop = Loop(simulator, 0.0, stopping.is_set, last_turn)
    loop.run()
    asking.join(10.0)
    assert outcome == ["refused"]


def test_a_failing_simulator_ends_the_loop_and_waiting_calls(simulator, monkeypatch):
    def fail(_):
        raise RuntimeError("solver exploded")
    monkeypatch.setattr(simulator, "advance", fail)
    loop = Loop(simulator, 0.0, lambda: False, lambda: None)
    with pytest.raises(RuntimeError):
        loop.run()
    with pytest.raises(ShuttingDown):
        loop.call(lambda: None)


def test_a_call_ends_when_bodies_are_lost_while_it_waits(simulator, monkeypatch):
    """The engine was left behind; what it meets when a request makes it catch up ends the simulation."""
    def fail():
        raise SimError("a body is lost")
    monkeypatch.setattr(simulator, "settle", fail)
    outcome = []
    loop = Loop(simulator, 0.0, lambda: bool(outcome), lambda: None)
    loop._lazily = True

    def ask():
        try:
            loop.call(lambda: outcome.append("answered"))
        except ShuttingDown:
            outcome.append("refused")

    asking = threading.Thread(target=ask, daemon=True)
    asking.start()
    deadline = time.monotonic() + 10.0
    while not loop._requests.qsize():
        assert time.monotonic() < deadline, "the request does not come"
    with pytest.raises(SimError):
        loop.run()
    asking.join(10.0)
    assert outcome == ["refused"]


@pytest.mark.parametrize("step_ms", [1, 7, 25])
def test_any_step_size_is_taken(make_rig, step_ms):
    simulator = make_rig(step_ms=step_ms).simulator
    with Running(simulator) as running:
        running.wait(lambda: simulator.now_ns >= 100 * MS)
    assert simulator.now_ns == simulator.steps * step_ms * MS


def test_little_work_is_put_off_and_requests_find_it_done(simulator, monkeypatch):
    owed = []
    put_off = simulator.advance

    def advance(until_ns, lazily=False):
        put_off(until_ns, lazily)
        owed.append(simulator._pending)
        return simulator.now_ns

    monkeypatch.setattr(simulator, "advance", advance)
    with Running(simulator) as running:
        running.wait(lambda: any(owed))
        assert [running.loop.call(lambda: simulator._pending) for _ in range(20)] == [0] * 20


def test_much_work_is_done_evenly(simulator, monkeypatch):
    """Each look at the processor's clock finds that a batch has taken 1.5 ms; then 0.5 ms; then 1.5 ms again."""
    spent, owed = iter([0.024 * count for count in range(4)] + [0.072 + 0.008 * count for count in range(4)]
                       + [0.096 + 0.024 * count for count in range(1000)]), []
    monkeypatch.setattr("m2wr_sim.ros.loop.time.thread_time", lambda: next(spent))
    loop = Loop(simulator, 0.0, lambda: len(owed) >= 200, lambda: owed.append(simulator._pending))
    lazily = []
    batch = loop._run_batch
    monkeypatch.setattr(loop, "_run_batch", lambda *given: (batch(*given), lazily.append(loop._lazily)))
    loop.run()
    first = lazily.index(True)
    assert first in range(16 * 4, 16 * 7) and lazily[first:].count(True) in range(16, 16 * 5) and not lazily[-1]
    assert simulator._pending == 0


def test_signals_at_the_end_of_a_wait_do_not_make_it_endless():
    """Each handler outlasts what was left of the wait; the queue of Python's C library then waits for ever."""
    loop = Loop(None, 1.0, lambda: False, lambda: None)
    before = signal.signal(signal.SIGALRM, lambda *_: time.sleep(0.0005))
    signal.setitimer(signal.ITIMER_REAL, 0.0007, 0.0007)
    rescue = threading.Timer(20.0, loop.wake)       # so that a failure ends
    rescue.start()
    try:
        start = time.monotonic()
        for _ in range(200):
            loop._serve(0.001)
            assert time.monotonic() - start < 10.0
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
        rescue.cancel()


# -- requests and steps share the thread --------------------------------------------------------------------------

class Stepped:
    """A simulator that only counts: each advance is one step and takes so long on a wall clock of the test's."""

    def __init__(self, wall, cost):
        self.wall, self.cost = wall, cost
        self.now_ns, self.step_ns, self.paused, self.events = 0, MS, False, []

    def advance(self, until_ns, lazily=False):
        self.now_ns += self.step_ns
        self.wall.now += self.cost
        self.events.append("step")
        return self.now_ns

    def settle(self):
        pass


def flooded(monkeypatch, factor, step_cost, request_cost, requests, turns):
    """Return what a loop does in so many turns when all those requests wait at the start: ``step`` or their numbers."""
    wall = Wall()
    monkeypatch.setattr(time, "monotonic", wall)
    monkeypatch.setattr(time, "thread_time", wall)
    simulator, left = Stepped(wall, step_cost), [turns]

    def stopping():
        left[0] -= 1
        return left[0] < 0

    loop = Loop(simulator, factor, stopping, lambda: None)

    def request(number):
        wall.now += request_cost
        simulator.events.append(number)

    for number in range(requests):
        loop._put(_Request(lambda number=number: request(number)))
    loop.run()
    return simulator.events


@pytest.mark.parametrize("factor", [0.0, 1.0])
def test_requests_and_steps_share_time_behind_schedule(monkeypatch, factor):
    events = flooded(monkeypatch, factor, step_cost=0.02, request_cost=0.004, requests=2000, turns=12)
    answered = [event for event in events if event != "step"]
    assert answered == list(range(len(answered))), "not in the order in which they came"
    ahead = _MAX_LAG + 0.02             # what is given to them before they share, and one step of repayment
    assert 12 <= len(answered) < 2000
    assert 0.004 * len(answered) <= 0.02 * events.count("step") + ahead + 0.004 * 12        # and one request each turn
    runs = "".join("s" if event == "step" else "r" for event in events).split("s")
    assert max(map(len, runs)) * 0.004 <= 10 * 0.02 + 0.004     # as long as a batch, and one request more


def test_a_request_is_answered_after_the_next_step(monkeypatch):
    wall = Wall()
    monkeypatch.setattr(time, "monotonic", wall)
    monkeypatch.setattr(time, "thread_time", wall)
    simulator, left = Stepped(wall, 0.0005), [30]
    loop = Loop(simulator, 0.0, lambda: not left[0], lambda: None)

    def request():
        simulator.events.append("request")
        wall.now += 0.002

    def advance(until_ns, lazily=False):
        left[0] -= 1
        loop._put(_Request(request))        # comes during each step
        return Stepped.advance(simulator, until_ns, lazily)

    simulator.advance = advance
    loop.run()
    assert simulator.events[:58] == ["step", "request"] * 29


def test_one_long_request_at_a_time_holds_the_clock(monkeypatch):
    events = flooded(monkeypatch, 0.0, step_cost=0.0005, request_cost=0.5, requests=5, turns=20)
    answers = [index for index, event in enumerate(events) if event != "step"]
    assert len(answers) == 5 and all(later - earlier > 1 for earlier, later in zip(answers, answers[1:]))


def test_what_has_time_left_answers_all(monkeypatch):
    events = flooded(monkeypatch, 1.0, step_cost=0.00001, request_cost=0.0001, requests=300, turns=6)
    answered = [event for event in events if event != "step"]
    assert len(answered) >= 250         # 10 ms of simulated time cost 0.1 ms: nearly all of the wall's 10 ms is free


# -- waiting, as lockstep does ----------------------------------------------------------------------------------

class Still:
    """A simulator that is never asked to move."""

    now_ns, step_ns, paused = 0, 1000000, False

    def settle(self):
        """Nothing moves."""


def test_requests_are_served_while_the_loop_waits():
    loop = Loop(Still(), 0.0, lambda: False, lambda: None)
    answers = []
    asking = threading.Thread(target=lambda: answers.append(loop.call(lambda: "served")))
    asking.start()
    assert loop.wait_until(lambda: answers, 20.0)
    asking.join(20.0)
    assert answers == ["served"]


def test_waiting_ends_with_the_time():
    loop = Loop(Still(), 0.0, lambda: False, lambda: None)
    assert not loop.wait_until(lambda: False, 0.01)


def test_waiting_ends_with_the_node():
    with pytest.raises(ShuttingDown):
        Loop(Still(), 0.0, lambda: True, lambda: None).wait_until(lambda: False, 60.0)


def test_a_closed_lockstep_lets_no_time_pass():
    class Closed:
        asked = 0

        def open(self):
            self.asked += 1
            return False

    lockstep = Closed()
    Loop(Still(), 0.0, lambda: lockstep.asked > 2, lambda: None, lockstep).run()    # Still has no advance to call
    assert lockstep.asked == 3

# SPDX-License-Identifier: BSD-3-Clause
"""When rate-limited work is due: Gazebo's rule for model plugins and its rule for sensors."""
import pytest

from m2wr_sim.runtime.schedule import GapSchedule, SensorSchedule, StrictSchedule, first_step, period_of

MS = 1000000


def ticks_of(schedule, step_ms, until_ms, start_ms=0):
    """Return the times [ms] of ticks when every step is tried."""
    return [now for now in range(start_ms + step_ms, until_ms + 1, step_ms) if schedule.due(now * MS)]


@pytest.mark.parametrize("rate, period", [(20.0, 50 * MS), (30.0, 33333333), (1000.0, MS), (0.0, 0), (-5.0, 0),
                                          (1e-300, 10 ** 18)])
def test_period_of_a_rate(rate, period):
    assert period_of(rate) == period


@pytest.mark.parametrize("step_ms, ticks", [
    (1, [51, 101, 151, 201]), (2, [52, 102, 152, 202]), (5, [55, 105, 155, 205]), (10, [60, 110, 160, 210]),
    (3, [51, 102, 153, 201]), (7, [56, 105, 154, 203])])
def test_plugins_tick_after_more_than_a_period_without_drift(step_ms, ticks):
    assert ticks_of(StrictSchedule(20.0, 0), step_ms, 220)[:4] == ticks


def test_plugins_loaded_later_count_from_there():
    assert ticks_of(StrictSchedule(20.0, 1000 * MS), 1, 1160, start_ms=1000) == [1051, 1101, 1151]


@pytest.mark.parametrize("rate", [0.0, -1.0])
def test_plugins_without_a_rate_tick_with_every_step(rate):
    schedule = StrictSchedule(rate, 0)
    assert ticks_of(schedule, 4, 20) == [4, 8, 12, 16, 20]
    assert not schedule.due(20 * MS)


def test_a_late_plugin_catches_up_step_by_step():
    schedule = StrictSchedule(20.0, 0)
    assert ticks_of(schedule, 1, 205, start_ms=200) == [201, 202, 203, 204]     # 50, 100, 150 and 200 ms were due
    assert ticks_of(schedule, 1, 300, start_ms=205) == [251]


def test_a_restarted_plugin_waits_a_whole_period():
    schedule = StrictSchedule(20.0, 0)
    schedule.restart(500 * MS)
    assert ticks_of(schedule, 1, 620, start_ms=500) == [551, 601]


@pytest.mark.parametrize("rate", [20.0, 30.0, 7.3, 0.0])
@pytest.mark.parametrize("step_ms", [1, 2, 5])
@pytest.mark.parametrize("asleep_ms", [10, 50, 100, 330, 1000])
def test_skipped_ticks_leave_the_others_where_they_are(rate, step_ms, asleep_ms):
    awake, sleeper = StrictSchedule(rate, 0), StrictSchedule(rate, 0)
    sleeper.skip(asleep_ms * MS)
    late = [tick for tick in ticks_of(awake, step_ms, 1500) if tick > asleep_ms]
    assert ticks_of(sleeper, step_ms, 1500, start_ms=asleep_ms) == late


def test_a_plugin_continues_after_time_went_back():
    schedule = StrictSchedule(20.0, 0)
    ticks_of(schedule, 1, 5000)
    schedule.restart(0)
    assert ticks_of(schedule, 1, 120) == [51, 101]


@pytest.mark.parametrize("rate", [20.0, 30.0, 7.3, 400.0, 0.0])
@pytest.mark.parametrize("step_ms", [1, 2, 3, 5, 10])
def test_plugins_foretell_their_ticks(rate, step_ms):
    every, jumping, jumps, now_ns = StrictSchedule(rate, 0), StrictSchedule(rate, 0), [], 0
    while True:
        now_ns = max(now_ns + step_ms * MS, jumping.next_due(now_ns, step_ms * MS))
        if now_ns > 600 * MS:
            break
        assert jumping.due(now_ns)
        jumps.append(now_ns // MS)
    assert jumps == ticks_of(every, step_ms, 600)


def test_a_sensor_is_due_at_once_and_then_once_a_period():
    assert ticks_of(SensorSchedule(20.0), 1, 170) == [1, 51, 101, 151]
    assert ticks_of(SensorSchedule(20.0), 5, 170) == [5, 55, 105, 155]


def test_a_sensor_carries_over_what_the_step_made_it_late():
    ticks = ticks_of(SensorSchedule(30.0), 5, 10000)
    gaps = {after - before for before, after in zip(ticks, ticks[1:])}
    assert gaps == {30, 35} and len(ticks) == pytest.approx(300, abs=1)


def test_a_sensor_late_by_more_than_a_period_drops_it():
    schedule = SensorSchedule(20.0)
    assert schedule.due(1 * MS) and schedule.due(171 * MS)      # 120 ms late
    assert ticks_of(schedule, 1, 300, start_ms=171) == [221, 271]


def test_a_sensor_without_a_rate_measures_with_every_step():
    assert ticks_of(SensorSchedule(0.0), 2, 8) == [2, 4, 6, 8]


def test_a_restarted_sensor_is_due_at_once():
    schedule = SensorSchedule(20.0)
    ticks_of(schedule, 1, 130)
    schedule.restart()
    assert schedule.next_due(130 * MS, MS) == 131 * MS
    assert ticks_of(schedule, 1, 240, start_ms=130) == [131, 181, 231]


@pytest.mark.parametrize("rate", [20.0, 30.0, 7.3, 400.0, 0.0])
@pytest.mark.parametrize("step_ms", [1, 2, 3, 5, 10])
def test_sensors_foretell_their_measurements(rate, step_ms):
    every, jumping, jumps, now_ns = SensorSchedule(rate), SensorSchedule(rate), [], 0
    while True:
        now_ns = jumping.next_due(now_ns, step_ms * MS)
        if now_ns > 600 * MS:
            break
        assert jumping.due(now_ns)
        jumps.append(now_ns // MS)
    assert jumps == ticks_of(every, step_ms, 600)


@pytest.mark.parametrize("rate, strict, expected", [
    (20.0, False, [50, 100, 150]), (20.0, True, [51, 102, 153]), (30.0, False, [34, 68, 102]), (0.0, False, [1, 2, 3])])
def test_a_gap_counts_from_the_last_tick(rate, strict, expected):
    schedule, ticks, now_ns = GapSchedule(rate, 0, strict), [], 0
    while len(ticks) < 3:
        now_ns += 1000000
        due_ns = schedule.next_due(now_ns, 1000000)
        if schedule.due(now_ns):
            ticks.append(now_ns // 1000000)
            assert due_ns == now_ns
    assert ticks == expected


def test_a_late_gap_is_due_at_once_and_only_once():
    schedule = GapSchedule(20.0, 0)
    assert schedule.next_due(900000000, 1000000) < 900000000 and schedule.elapsed(900000000) == 900000000
    assert schedule.due(900000000) and not schedule.due(900000000)
    schedule.restart(0)
    assert schedule.next_due(0, 1000000) == 50000000


def test_steps_are_counted_from_the_last_one():
    """Times need not be multiples of the step: it was 1 ms up to 7 ms and has been 5 ms since."""
    assert [first_step(wanted, 7, 5) for wanted in (-4, -3, 2, 3, 7, 8, 12, 13)] == [-3, -3, 2, 7, 7, 12, 12, 17]


@pytest.mark.parametrize("make", [lambda rate: StrictSchedule(rate, 0), lambda rate: GapSchedule(rate, 0),
                                  lambda rate: GapSchedule(rate, 0, True), SensorSchedule])
@pytest.mark.parametrize("rate", [20.0, 30.0, 0.0])
def test_ticks_are_foretold_when_the_step_has_changed(make, rate):
    every, asked, due_ns, now_ns = make(rate), make(rate), [], 0
    for step_ns, count in ((MS, 7), (5 * MS, 60), (300000, 200), (7 * MS, 40)):
        for _ in range(count):
            foretold = max(asked.next_due(now_ns, step_ns), now_ns + step_ns)
            now_ns += step_ns
            assert asked.due(now_ns) == (foretold == now_ns) == every.due(now_ns)
            due_ns += [now_ns] if foretold == now_ns else []
    assert len(due_ns) >= 10

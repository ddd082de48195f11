# SPDX-License-Identifier: BSD-3-Clause
"""Times of a run in closed form."""
import pytest

from m2wr_gmapping.replay import run_statistics
from m2wr_gmapping.replay.run_statistics import Stopwatch, peak_memory_mib


def test_times_of_pieces_are_summed_up():
    watch = Stopwatch()
    watch.cpu = [5.0] + [0.001 * k for k in range(1, 21)]
    watch.wall = list(watch.cpu)
    found = watch.summary()["cpu"]
    assert found["total_s"] == pytest.approx(5.21)
    assert (found["mean_ms"], found["median_ms"]) == (10.5, 10.5)
    assert (found["first_ms"], found["last_ms"]) == (1.5, 19.5)


def test_a_single_piece_is_counted():
    watch = Stopwatch()
    with watch:
        sum(range(1000))
    watch.piece()
    found = watch.summary()
    assert found["count"] == 1 and found["wall"]["mean_ms"] > 0.0
    assert found["wall"]["first_ms"] == found["wall"]["last_ms"]


def test_longest_time_is_that_of_one_entry_after_the_first_piece(monkeypatch):
    times = iter([0.0, 9.0, 10.0, 10.02, 11.0, 11.01, 12.0, 20.0])
    monkeypatch.setattr(run_statistics.time, "perf_counter", lambda: next(times))
    watch = Stopwatch()
    for ends in (True, False, True, False):     # the last one ends no piece
        with watch:
            pass
        if ends:
            watch.piece()
    assert watch.summary()["wall"]["max_ms"] == pytest.approx(20.0)
    assert watch.wall == pytest.approx([9.0, 0.03])


def test_work_outside_pieces_is_in_the_total():
    watch = Stopwatch()
    with watch:
        sum(range(1000))
    assert watch.summary()["count"] == 0 and watch.summary()["wall"]["total_s"] > 0.0


def test_peak_memory_is_that_of_a_process():
    assert 5.0 < peak_memory_mib() < 100000.0

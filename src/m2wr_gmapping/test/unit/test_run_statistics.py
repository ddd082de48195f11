# SPDX-License-Identifier: BSD-3-Clause
"""Times of a run in closed form."""
import pytest

from m2wr_gmapping.replay.run_statistics import Stopwatch, peak_memory_mib


def test_times_of_pieces_are_summed_up():
    watch = Stopwatch()
    watch.cpu = [5.0] + [0.001 * k for k in range(1, 21)]
    watch.wall = list(watch.cpu)
    found = watch.summary()["cpu"]
    assert found["total_s"] == pytest.approx(5.21) and found["max_ms"] == 20.0
    assert (found["mean_ms"], found["median_ms"]) == (10.5, 10.5)
    assert (found["first_ms"], found["last_ms"]) == (1.5, 19.5)


def test_a_single_piece_is_counted():
    watch = Stopwatch()
    with watch:
        sum(range(1000))
    watch.piece()
    found = watch.summary()
    assert found["count"] == 1 and found["wall"]["mean_ms"] > 0.0
    assert found["wall"]["first_ms"] == found["wall"]["last_ms"] == found["wall"]["max_ms"]


def test_work_outside_pieces_is_in_the_total():
    watch = Stopwatch()
    with watch:
        sum(range(1000))
    assert watch.summary()["count"] == 0 and watch.summary()["wall"]["total_s"] > 0.0


def test_peak_memory_is_that_of_a_process():
    assert 5.0 < peak_memory_mib() < 100000.0

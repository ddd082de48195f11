# SPDX-License-Identifier: BSD-3-Clause
"""The figures of a report are those of its runs, and a world counts once."""
import math

import pytest

from m2wr_campaign.report.figures import (
    best_median_worst,
    by_worlds,
    compared,
    difficulties,
    edges_of,
    ranked,
    shares_by,
    variants,
)


def run(method="bug2", world="a", repeat=0, **more):
    success = more.get("success", 1)
    return dict({"key": "{} {} {}".format(method, world, repeat), "world": world, "robot": "m2wr", "method": method,
                 "parameters": "{}", "noise": None, "fault": "", "repeat": repeat,
                 "status": "done", "reason": "", "log": "",
                 "outcome": "reached" if success else "stuck", "success": 1, "ratio": 1.5, "time": 20.0,
                 "clearance": 0.2, "turning": 3.0, "cpu_ms": 0.3, "contacts": 0, "optimum": 10.0, "openness": 1.0,
                 "tortuosity": 1.2, "versions": "{}"}, **more)


def test_runs_with_and_without_a_fault_are_told_apart():
    assert list(variants([run(fault="scan_loss"), run()])) == ["bug2, scan_loss", "bug2, no fault"]


def test_runs_differ_by_parameters_robot_and_noise():
    assert list(variants([run(), run(parameters='{"b": 2, "a": 0.5}'), run()])) == ["bug2", "bug2 a=0.5 b=2"]
    assert list(variants([run(noise=0.1), run(robot="other"), run()])) == [
        "bug2, m2wr, noise 0.1 m", "bug2, other, noise as described", "bug2, m2wr, noise as described"]


def test_a_world_counts_once_however_many_runs_it_has():
    mean, low, high = by_worlds([("a", 1.0)] * 9 + [("b", 3.0)])
    assert mean == 2.0 and (low, high) == (1.0, 3.0)
    mean, low, high = by_worlds([("a", 1.0), ("a", 3.0)])
    assert mean == 2.0 and (low, high) == (1.0, 3.0)
    assert all(map(math.isnan, by_worlds([])))


def test_methods_are_ranked_by_successes_then_length():
    runs = [run("long", ratio=3.0), run("short", ratio=1.1), run("bad", success=0, ratio=1.0),
            run("bad", "b", ratio=2.0), run("bad", "c", contacts=1, success=0, outcome="reached")]
    first, second, last = ranked(variants(runs))
    assert [first.label, second.label, last.label] == ["short", "long", "bad"]
    assert (last.successes, last.runs) == (1, 3) and last.means["ratio"][0] == 2.0
    assert last.share == pytest.approx((1 / 3, 0.0615, 0.7923), abs=1e-3)
    assert last.outcomes == {"stuck": 1, "contact": 1}


def test_pairs_are_runs_in_the_same_world_with_the_same_seed():
    first = [run("a", "w", 0, ratio=1.5), run("a", "w", 1, ratio=1.7), run("a", "v", 0), run("a", "u", 0, ratio=2.0)]
    second = [run("b", "u", 0, ratio=1.0), run("b", "w", 1, success=0), run("b", "w", 0, ratio=1.0),
              run("b", "t", 0)]
    found = compared(first, second)
    assert (found.pairs, found.only_first, found.only_second) == (3, 1, 0)
    assert found.gain[0] == pytest.approx(0.25)             # a half in one world, nothing in the other
    assert found.ratio[0] == pytest.approx(0.75) and found.time[0] == 0.0
    back = compared(second, first)
    assert back.gain[0] == -found.gain[0] and back.only_second == 1


def test_bins_of_difficulty_hold_every_run_once():
    runs = [run(world=str(k), openness=0.1 * k, success=int(k > 4)) for k in range(12)]
    table = difficulties(runs + [run(world="12", openness=None)], "openness")
    edges = edges_of(list(table.values()))
    points = shares_by(runs, lambda one: table[one["world"], one["robot"]], edges)
    assert len(table) == 12 and [total for _, _, total in points] == [3, 3, 3, 3]
    assert [good for _, good, _ in points] == [0, 1, 3, 3]
    assert [value for value, _, _ in points] == pytest.approx([0.1, 0.4, 0.7, 1.0])
    assert edges_of([2.0, 2.0]) == [] and shares_by([run()], lambda one: math.nan, edges) == []


def test_the_median_run_lies_between_the_best_and_the_worst():
    runs = [run(repeat=0, ratio=2.0), run(repeat=1, success=0, ratio=1.0), run(repeat=2, ratio=1.2),
            run(repeat=3, success=0, ratio=None, status="failed"), run(repeat=4, ratio=3.0)]
    assert [(which, one["repeat"]) for which, one in best_median_worst(runs)] == [
        ("best", 2), ("median", 4), ("worst", 3)]
    assert {one["repeat"] for _, one in best_median_worst(runs[:1])} == {0}

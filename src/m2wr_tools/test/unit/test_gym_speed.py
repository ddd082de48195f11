# SPDX-License-Identifier: BSD-3-Clause
"""Steps per second are counted, compared with the reference, and what is missing is told."""
import pytest

pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")

from m2wr_tools.benchmark import gym_speed  # noqa: E402


def test_steps_are_counted_after_the_first_call():
    calls = []

    def step():
        calls.append(1)
        sum(range(20000))
        return 7

    rate = gym_speed.rate_of(step, 0.05)
    assert len(calls) >= 2 and 0.0 < rate < 7.0 * (len(calls) - 1) / 0.05 + 1.0


def test_ratios_are_to_the_reference_environment():
    text = gym_speed.table([gym_speed.Row("a", 500.0, 0.1), gym_speed.Row("m2wr/GoToGoalWorld02-v0", 1000.0, 0.1)])
    assert "| a | 500 | 50 | 0.50 |" in text and "| 1000 | 100 | 1.00 |" in text


def test_the_report_says_which_simulators_are_missing(monkeypatch):
    def absent():
        raise ImportError("No module named 'absent'")

    def broken():
        raise TypeError("has other calls")

    monkeypatch.setattr(gym_speed, "OTHERS", {"one": absent, "two": broken, "three": lambda: (lambda: 5, 0.01)})
    text = gym_speed.report(2, 0.001)
    for name in ("m2wr/GoToGoal-v0", "m2wr/Bug2World02-v0", "m2wr/Exploration-v0", "2 worlds in one process",
                 "| three |"):
        assert name in text
    assert "one: not installed (No module named 'absent')" in text
    assert "two: could not be measured (TypeError: has other calls)" in text

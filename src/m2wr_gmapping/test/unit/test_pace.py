# SPDX-License-Identifier: BSD-3-Clause
"""When the transform is due, by clocks of all kinds; no time passes here."""
import pytest

from m2wr_gmapping.ros.outputs import LONGEST_NAP, SHORTEST_NAP, Pace

PERIOD = 0.05


def run(clock, wall_end, wall=1000.0):
    """Let a pace look at a clock (function of the wall time passed) as long as it wants; return (times sent, looks)."""
    pace, passed, sent, looks = Pace(), 0.0, [], 0
    while passed < wall_end:
        now, looks = clock(passed), looks + 1
        if pace.due(now, PERIOD):
            sent.append(now)
        else:
            passed += pace.nap(now, wall + passed)
    return sent, looks


@pytest.mark.parametrize("factor", [0.1, 1.0, 4.0, 10.0])
def test_the_period_is_kept_at_any_speed(factor):
    sent, looks = run(lambda passed: 5.0 + 0.01 * int(100 * factor * passed), 10.0)        # a clock of 10 ms steps
    assert len(sent) == pytest.approx(10.0 * factor / PERIOD, rel=0.1)
    assert looks < 10 * len(sent) + 10.0 / LONGEST_NAP + 10


def test_a_clock_that_has_not_begun_and_one_that_stands_cost_little():
    for at in (0.0, 7.0):
        sent, looks = run(lambda _, at=at: at, 10.0)
        assert len(sent) == (1 if at else 0) and looks < 1.1 * 10.0 / LONGEST_NAP + 5


def test_a_clock_that_jumps_back_is_followed_at_once():
    sent, _ = run(lambda passed: 100.0 + passed if passed < 2.0 else passed, 4.0)
    after = [now for now in sent if now < 50.0]
    assert after[0] < 2.0 + 2 * PERIOD and len(after) == pytest.approx(2.0 / PERIOD, rel=0.1)


def test_what_was_missed_is_not_sent_all_at_once():
    sent, _ = run(lambda passed: 1.0 + passed if passed < 1.0 else 31.0 + passed, 2.0)
    assert len(sent) < 2.2 / PERIOD and min(b - a for a, b in zip(sent, sent[1:])) >= SHORTEST_NAP

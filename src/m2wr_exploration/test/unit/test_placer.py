# SPDX-License-Identifier: BSD-3-Clause
"""Maps are compared beside the loop of commands, and what is found is taken at a defined moment."""
import numpy as np
import pytest

from m2wr_exploration.ros.placer import Placer
from m2wr_exploration.team.placing import Placing


class Slow(Placing):
    """Joins both robots in its first update."""

    def update(self, maps):
        if self.whole:
            return []
        self.join(0, 1, np.array([1.0, 2.0, 0.0]))
        return ["found"]


def finished(placer, placing, maps):
    before = placer.turn(placing, maps)
    placer._thread.join(10.0)
    return before


def test_the_result_is_taken_with_the_next_turn():
    placer, placing = Placer(), Slow(["robot1", "robot2"])
    assert finished(placer, placing, {}) == (placing, []) and not placing.whole
    made, told = placer.turn(placing, {})
    assert made is not placing and made.whole and not placing.whole and told == ["found"]
    placer._thread.join(10.0)
    again, told = placer.turn(made, {})
    assert again.whole and told == []


def test_a_result_for_other_robots_is_dropped():
    placer = Placer()
    finished(placer, Slow(["robot1", "robot2"]), {})
    new = Placing(["robot1", "robot2"])
    assert finished(placer, new, {}) == (new, [])


@pytest.mark.parametrize("starts", [[np.zeros(3), np.zeros(3)]])
def test_known_starts_need_no_comparison(starts):
    placer, placing = Placer(), Placing(["robot1", "robot2"], starts)
    assert placer.turn(placing, {}) == (placing, []) and placer._thread is None

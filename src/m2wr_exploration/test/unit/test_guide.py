# SPDX-License-Identifier: BSD-3-Clause
"""A robot that is led through a known world."""
import numpy as np
import pytest

from exploration_grids import grid
from m2wr_exploration.explorer import DONE
from m2wr_exploration.study.guide import HEADINGS, Guide
from m2wr_exploration.study.offline import offline_tour
from m2wr_exploration.study.scenes import named

MAP = grid("....")
HERE = np.zeros(3)


def test_it_gives_each_place_with_all_headings_and_ends():
    guide, goals, result = Guide([(1.0, 2.0), (3.0, 4.0)]), [], ""
    for now in range(100):
        decision = guide.step(float(now), MAP, HERE, result)
        if decision.state == DONE:
            break
        goals.append(decision.goal.tolist())
        result = "succeeded"
    assert goals == [[x, y, heading] for x, y in ((1.0, 2.0), (3.0, 4.0)) for heading in HEADINGS]
    assert guide.state == DONE and guide.summary == "the tour has ended"


def test_a_goal_stays_until_it_has_a_result():
    guide = Guide([(1.0, 2.0)])
    assert guide.step(0.0, MAP, HERE).goal is not None
    assert all(guide.step(now, MAP, HERE).goal is None for now in (1.0, 2.0))


def test_a_place_that_cannot_be_reached_is_left_out_and_told():
    guide = Guide([(1.0, 2.0)])
    guide.step(0.0, MAP, HERE)
    decision = guide.step(1.0, MAP, HERE, "aborted", "no plan")
    assert decision.goal is not None and decision.messages == ("a place of the tour was left out: no plan",)


def test_the_offline_tour_begins_at_the_start():
    place = named("house", 1)
    length, points = offline_tour(place, 9.9)
    assert np.hypot(*(points[0] - place.start[:2])) < 0.1 and len(points) > 3
    assert np.hypot(*np.diff(points, axis=0).T).sum() <= length + 1e-3
    assert length == pytest.approx(offline_tour(place, 9.9)[0])

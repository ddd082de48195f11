# SPDX-License-Identifier: BSD-3-Clause
"""Criteria against closed forms."""
import math

import numpy as np
import pytest

from m2wr_navigation import registry
from m2wr_navigation.best_path.scoring import make_scorer
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import FARTHEST, ObstacleField, Track
from m2wr_navigation.costmap.cost_layout import LETHAL

SCORER = make_scorer({}, "~criteria")[0]


def track(poses, period=1.0):
    poses = np.array(poses, float)
    return Track(period * np.arange(len(poses)), poses, poses[-1, :2])


def field(*walls):
    survey = Survey(10.0, (0.0, 0.0))
    for x, y in walls:
        survey.costs.costs[survey.costs.cell(x, y)] = LETHAL
    return ObstacleField(survey.costs)


def test_a_square_has_its_length_turns_and_time():
    corners = [(0, 0, 0), (2, 0, 0), (2, 0, math.pi / 2), (2, 2, math.pi / 2), (2, 2, math.pi), (0, 2, math.pi)]
    amounts = SCORER.score(track(corners), field()).amounts
    assert amounts["length"] == pytest.approx(6.0) and amounts["turning"] == pytest.approx(math.pi)
    assert amounts["time"] == pytest.approx(5.0) and amounts["clearance"] == FARTHEST


def test_the_rest_to_the_goal_counts():
    short = Track(np.arange(2.0), np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]), np.array([1.0, 0.5]))
    assert SCORER.score(short, field()).amounts["length"] == pytest.approx(1.5)


@pytest.mark.parametrize("wall, expected", [((1.0, 0.0), 0.55), ((0.0, 0.5), 0.28), ((-1.0, 0.0), 0.8)])
def test_clearance_is_that_of_the_outline(wall, expected):
    # ahead the caster reaches 0.45 m before the axle, the wheels 0.22 m to the sides, the chassis 0.2 m behind
    amounts = SCORER.score(track([(0, 0, 0), (0, 0, 0)]), field(wall)).amounts
    assert amounts["clearance"] == pytest.approx(expected, abs=0.06)


def test_energy_is_rolling_resistance_and_kinetic_energy():
    straight = track([(0, 0, 0), (1, 0, 0), (2, 0, 0), (3, 0, 0)])
    assert SCORER.score(straight, field()).amounts["energy"] == pytest.approx(
        0.02 * 5.4 * 9.80665 * 3.0 + 0.5 * 5.4 * 1.0 ** 2)
    on_spot = track([(0, 0, 0), (0, 0, 1), (0, 0, 2)])
    assert SCORER.score(on_spot, field()).amounts["energy"] == pytest.approx(
        0.02 * 5.4 * 9.80665 * 0.2 * 2.0 + 0.5 * 0.12)


def test_the_score_is_the_weighted_sum_of_what_costs():
    given = {name: {"weight": 0.0} for name in registry.CRITERIA}
    given["clearance"] = {"weight": 10.0, "wanted": 1.0}
    scorer, warnings = make_scorer(given, "~criteria")
    assert not warnings
    assert scorer.score(track([(0, 0, 0), (0, 0, 0)]), field((0.0, 0.5))).total == pytest.approx(7.2, abs=0.5)
    assert scorer.score(track([(0, 0, 0), (0, 0, 0)]), field()).total == 0.0


def test_parameters_that_cannot_be_used_are_told():
    _, warnings = make_scorer({"length": 3, "time": {"weight": "x"}, "turning": {"wieght": 1.0}, "lenght": {}}, "~c")
    text = "\n".join(warnings)
    for part in ("~c/length is 3", "~c/time/weight is 'x'", "~c/turning/wieght has no effect; did you mean weight",
                 "~c/lenght has no effect; did you mean length"):
        assert part in text

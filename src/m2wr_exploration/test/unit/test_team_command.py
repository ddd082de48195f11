# SPDX-License-Identifier: BSD-3-Clause
"""The table and the figure of teams."""
import json
import math

import pytest

from m2wr_exploration.study.figure import draw_teams
from m2wr_exploration.study.team_command import Task, line, lost, placing_line, without_infinity
from m2wr_exploration.study.team_statistics import against, mean_time, times
from m2wr_navigation.compare.outputs import write_json


def row(place, robots, enough, contacts=0):
    return {"place": place, "robots": robots, "share": 1.0, "enough": enough, "time": 60.0, "contacts": contacts,
            "lengths": [10.0] * robots, "curve": [(0.0, 0.1), (50.0, 0.99)], "placed": 20.0, "misplaced": 0.05}


ROWS = [row(0, 1, 100.0), row(0, 2, 50.0, contacts=1)]


def test_a_line_has_the_time_against_one_robot():
    assert line(2, ROWS, 1).split() == ["2", "1", "of", "1", "1", "50", "(50", "to", "50)", "0.50", "(0.50", "to",
                                        "0.50)", "10.0"]


def test_a_run_that_was_lost_counts_as_not_complete():
    assert line(2, [row(0, 1, 100.0), lost(Task(0, 2), "timeout", "", 1.0)], 1).split() == ["2", "0", "of", "1", "0"]


def test_a_place_that_one_team_did_not_see_counts_for_none():
    rows = ROWS + [row(1, 1, 400.0), row(1, 2, math.inf)]
    assert times(rows, 1) == {0: 100.0} and times(rows, 2) == {0: 50.0}


def test_means_have_an_interval_about_them():
    rows = [row(place, robots, (100.0 + 10.0 * place) / robots) for place in range(6) for robots in (1, 2)]
    mean, low, high = mean_time(rows, 1)
    assert mean == pytest.approx(125.0) and 105.0 < low < mean < high < 145.0
    assert against(rows, 2, 1) == pytest.approx((0.5, 0.5, 0.5))


def test_half_and_twice_the_time_average_to_one():
    rows = [row(0, 1, 100.0), row(0, 2, 50.0), row(1, 1, 100.0), row(1, 2, 200.0)]
    mean, low, high = against(rows, 2, 1)
    assert mean == pytest.approx(1.0) and low == pytest.approx(0.5) and high == pytest.approx(2.0)


def test_a_team_that_never_saw_all_can_be_written(tmp_path):
    target = str(tmp_path / "teams.json")
    write_json(target, without_infinity(ROWS + [lost(Task(0, 2), "killed", "", 5.0)]))
    with open(target, encoding="utf-8") as stream:
        assert json.load(stream)[-1]["enough"] is None


def test_a_line_says_when_maps_were_placed():
    rows = [dict(row(0, 2, 50.0), misplaced=0.031), dict(row(1, 2, 60.0), placed=math.inf, misplaced=0.0)]
    assert placing_line(2, rows).split() == ["2", "1", "of", "2", "20", "3"]


@pytest.mark.parametrize("rows", [ROWS, [lost(Task(0, 1), "timeout", "", 1.0)]])
def test_the_figure_is_written(tmp_path, rows):
    draw_teams(rows, [1, 2], str(tmp_path / "teams.png"))
    assert (tmp_path / "teams.png").stat().st_size > 1000

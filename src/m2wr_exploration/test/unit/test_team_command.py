# SPDX-License-Identifier: BSD-3-Clause
"""The table and the figure of teams."""
import math

from m2wr_exploration.study.figure import draw_teams
from m2wr_exploration.study.team_command import Task, line, lost

ROWS = [{"place": 0, "robots": 2, "share": 1.0, "enough": 50.0, "time": 60.0, "contacts": 1, "lengths": [10.0, 12.0],
         "curve": [(0.0, 0.1), (50.0, 0.99)]}]


def test_a_line_has_the_time_against_one_robot():
    assert line(2, ROWS, {0: 100.0}).split() == ["2", "1", "of", "1", "1", "50", "0.50", "(0.50", "to", "0.50)", "11.0"]


def test_a_run_that_was_lost_counts_as_not_complete():
    row = lost(Task(0, 2), "timeout", "", 1.0)
    assert line(2, [row], {0: math.inf}).split() == ["2", "0", "of", "1", "0"]


def test_the_figure_is_written(tmp_path):
    draw_teams(ROWS, [2, 4], str(tmp_path / "teams.png"))
    assert (tmp_path / "teams.png").stat().st_size > 1000

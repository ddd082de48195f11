# SPDX-License-Identifier: BSD-3-Clause
"""The comparison of planners: its table, and arguments that are wrong."""
import csv

import pytest

from m2wr_elevation.study.command import main


def test_all_planners_reach_a_goal_on_level_ground(tmp_path, capsys):
    path = str(tmp_path / "planning.csv")
    level = [word for name in ("craters", "fractal", "rubble") for word in ("--" + name, "0")]
    assert main(["--grounds", "1", "--processes", "1", "--planners", "flat,elevation,back,slip", "--output", path,
                 *level]) == 0
    with open(path, encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["planner"], row["outcome"]) for row in rows] == [
        ("flat", "reached"), ("elevation", "reached"), ("back", "reached"), ("slip", "reached")]
    assert all(5.5 < float(row["length"]) < 6.2 for row in rows) and float(rows[1]["rms"]) < 0.01
    assert "elevation       1 of 1" in capsys.readouterr().out


@pytest.mark.parametrize("words, told", [
    (["--grounds", "0"], "--grounds 0"), (["--planners", "best"], 'no planner "best"'),
    (["--patches", "ice", "--share", "2"], "share of 2"), (["--craters", "-1"], "craters has the height -1")])
def test_wrong_arguments_are_told(tmp_path, capsys, words, told):
    assert main([*words, "--processes", "1", "--output", str(tmp_path / "a.csv")]) == 2
    assert told in capsys.readouterr().err

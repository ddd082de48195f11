# SPDX-License-Identifier: BSD-3-Clause
"""The study of roughness: its table, its figure, and arguments that are wrong."""
import csv

import pytest

from m2wr_campaign.rough.command import main
from m2wr_campaign.rough.figure import shares


def test_a_small_study_gives_a_table_and_a_figure(tmp_path, capsys):
    folder = str(tmp_path / "out")
    assert main(["m2wr", "--levels", "0", "--drives", "2", "--processes", "1", "--output", folder]) == 0
    with open(folder + "/rough.csv", encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["outcome"] for row in rows] == ["reached", "reached"]
    assert {row["seed"] for row in rows} == {"1000", "1001"}
    assert (tmp_path / "out" / "rough.png").stat().st_size > 5000
    assert "100" in capsys.readouterr().out


@pytest.mark.parametrize("words, told", [
    (["--levels", "-1"], "level of -1"), (["--drives", "0"], "--drives 0"), (["--friction", "nan"], "friction is nan"),
    (["nowhere.xacro", "--drives", "1", "--levels", "0", "--processes", "1"], "nowhere.xacro")])
def test_wrong_arguments_are_told(tmp_path, monkeypatch, capsys, words, told):
    monkeypatch.chdir(tmp_path)
    assert main(words) == 2
    assert told in capsys.readouterr().err


def test_shares_add_up_and_have_their_intervals():
    rows = [{"robot": "a", "level": 0.1, "outcome": name} for name in ("reached", "reached", "tipped", "stuck")]
    found = shares(rows, "a")
    assert [found[name][0][1] for name in ("reached", "tipped", "slipped", "stuck")] == [0.5, 0.25, 0.0, 0.25]
    assert all(low <= share <= high for [[_, share, low, high]] in found.values())

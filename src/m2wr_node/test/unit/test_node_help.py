# SPDX-License-Identifier: BSD-3-Clause
"""The option -h of nodes: a text and exit code 0, and nothing else changes."""
import pytest

from m2wr_node.node_help import answer_help

PARAMETERS = {"speed": "[m/s] (0.5)", "way_points": "list of [x, y] [m]"}


@pytest.mark.parametrize("word", ["-h", "--help"])
def test_help_names_purpose_and_parameters(word, capsys):
    with pytest.raises(SystemExit) as ended:
        answer_help("tour.py", "Drives along way points.", PARAMETERS, ["_speed:=1", word])
    shown = capsys.readouterr().out
    assert ended.value.code == 0 and "Drives along way points." in shown and "_way_points:=  list of" in shown


@pytest.mark.parametrize("words", [[], ["_speed:=1", "__name:=a", "cmd_vel:=/b"], ["_speed:=-1", "-x"]])
def test_other_arguments_are_left_alone(words, capsys):
    answer_help("tour.py", "Drives along way points.", PARAMETERS, words)
    assert capsys.readouterr() == ("", "")

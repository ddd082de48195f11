# SPDX-License-Identifier: BSD-3-Clause
"""The tables of options and parameters in docs/reference equal the programs."""
import os

from m2wr_gmapping.replay import replay_command as replay
from m2wr_gmapping.ros.node_parameters import NODE_PARAMETERS, NodeOptions
from m2wr_gmapping.ros.reconfigure import CHANGEABLE

PAGES = os.path.join(os.path.dirname(__file__), "..", "..", "..", "..", "docs", "reference")


def rows(page, heading):
    """Rows of the tables of a chapter that begin with a code word: {word: other cells}."""
    with open(os.path.join(PAGES, page), encoding="utf-8") as stream:
        part = stream.read().split("\n## " + heading + "\n")[1].split("\n## ")[0]
    return {cells[0].strip("`").split()[0]: cells[1:] for cells in (
        [cell.strip() for cell in line.strip("|").split("|")] for line in part.splitlines() if line.startswith("| `"))}


def options_of(parser):
    return {max(action.option_strings, key=len) for action in parser._actions
            if action.option_strings and "--help" not in action.option_strings}


def test_parameters_of_the_live_node():
    shown = rows("mapping_nodes.md", "Parameters")
    assert set(NODE_PARAMETERS) == set(shown)
    for name, meaning in NODE_PARAMETERS.items():
        default = getattr(NodeOptions, name)
        wanted = "" if default is None else repr(default).lower() if isinstance(default, bool) else repr(default)
        assert shown[name] == [wanted, meaning], name


def test_parameters_that_may_change_while_the_node_runs():
    shown = rows("mapping_nodes.md", "Topics and services")["~set_parameters"][1]
    assert shown.replace("`", "").split(", ") == list(CHANGEABLE)


def test_options_of_the_replay(monkeypatch):
    made = []
    parse = replay.argparse.ArgumentParser.parse_args
    monkeypatch.setattr(replay.argparse.ArgumentParser, "parse_args",
                        lambda self, words: made.append(self) or parse(self, words))
    replay.parse(["--bag_filename", "x"])
    assert set(rows("mapping_commands.md", "slam_gmapping_replay")) == options_of(made[0]) | {"_name:=value"}

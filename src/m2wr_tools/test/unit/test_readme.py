# SPDX-License-Identifier: BSD-3-Clause
"""The README's table of options equals the program's."""
import os
import re

from m2wr_tools.map_figure import command

README = os.path.join(os.path.dirname(__file__), "..", "..", "README.md")


def test_options_of_plot_map():
    with open(README, encoding="utf-8") as stream:
        shown = set(re.findall(r"^\| `(--[a-z]+)", stream.read(), re.M))
    options = {option for action in command.parser()._actions for option in action.option_strings}
    assert shown == options - {"-h", "--help"}

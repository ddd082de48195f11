# SPDX-License-Identifier: BSD-3-Clause
"""The README's tables of options equal the programs'."""
import os
import re

import pytest

from m2wr_tools.map_figure import command as map_figure
from m2wr_tools.slam_benchmark import benchmark_command, benchmark_table

FOLDER = os.path.dirname(os.path.abspath(__file__))
README = os.path.join(FOLDER, "..", "..", "README.md")
REFERENCE = os.path.join(FOLDER, "..", "..", "..", "..", "docs", "reference")


@pytest.mark.parametrize("page, heading, parser", [
    (README, "plot_map", map_figure.parser),
    (os.path.join(REFERENCE, "mapping_commands.md"), "benchmark", benchmark_command.parser)])
def test_options(page, heading, parser):
    with open(page, encoding="utf-8") as stream:
        part = stream.read().split("\n## " + heading + "\n")[1].split("\n## ")[0]
    shown = set(re.findall(r"^\| `(--[a-z-]+)", part, re.M))
    options = {max(action.option_strings, key=len) for action in parser()._actions if action.option_strings}
    assert shown == options - {"--help"}


def test_there_is_a_place_for_the_results():
    benchmark_table.check(os.path.join(REFERENCE, "mapping_evaluation.md"))

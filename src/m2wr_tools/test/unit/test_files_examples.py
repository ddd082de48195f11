# SPDX-License-Identifier: BSD-3-Clause
"""The example runs as it stands and prints what its first line promises."""
import importlib.util
import re
from pathlib import Path

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"


def test_bug2_seeds_prints_one_line_for_each_run(capsys):
    spec = importlib.util.spec_from_file_location("bug2_seeds", str(EXAMPLES / "bug2_seeds.py"))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.main("world01", 1)
    assert re.match(r"seed 0: goal_reached after 22\.\d s .* 0 contacts\n$", capsys.readouterr().out)

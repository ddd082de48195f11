# SPDX-License-Identifier: BSD-3-Clause
"""Every example runs as it stands and prints what its first line promises."""
import importlib.util
import re
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
# arguments that make the run short, and what its output must match from the beginning
EXPECTED = {
    "drive": ((), "t =  4.00 s .*contacts 0\nt =  7.14 s .*contacts 0\nt =  8.14 s .* 0.50 m/s .*contacts 0\n$"),
    "many_robots": ((3, 4.0), "(robot[012]   x, y = .*contacts 0\n){3}$"),
    "search_in_parallel_worlds": ((4, 2.0), "best of 4: 0\\.[3-9].* m with linear .*; 0 of them hit something\n$"),
    "go_to_goal": ((1,), "episode 0: return +1\\d\\.\\d\\d after .* s, goal\n$")}


def test_every_example_is_in_the_table():
    assert sorted(path.stem for path in EXAMPLES.glob("*.py")) == sorted(EXPECTED)


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_example_prints_what_it_promises(name, capsys):
    if name == "go_to_goal":
        pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")
    spec = importlib.util.spec_from_file_location("example_" + name, str(EXAMPLES / (name + ".py")))
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    arguments, pattern = EXPECTED[name]
    module.main(*arguments)
    printed = capsys.readouterr().out
    assert re.match(pattern, printed), printed

# SPDX-License-Identifier: BSD-3-Clause
"""Two minutes of the fuzzer, always the same cases; a failure prints the command that repeats its case."""
import os
import sys

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import command  # noqa: E402
import mutations  # noqa: E402
from registry import TARGETS, make_target  # noqa: E402

SEED = 2026
CASES = {"urdf": 1000, "sdf": 2000, "world": 2000, "spawn_text": 1000, "services": 700, "mesh": 700, "heights": 400,
         "map": 1500, "bag": 500, "tour": 5000, "scans": 1500, "state": 2000, "network": 100, "parameters": 20000}


@pytest.mark.parametrize("name", sorted(TARGETS))
def test_nothing_is_found(name, tmp_path, capsys):
    code = command.main(["--target", name, "--seed", str(SEED), "--cases", str(CASES[name]), "--no-minimise",
                         "--out", str(tmp_path)])
    said = capsys.readouterr().out
    assert code == 0, said
    assert int(said.splitlines()[1].split()[1]) == CASES[name], said


@pytest.mark.parametrize("name", sorted(set(TARGETS) - {"network"}))
def test_a_case_is_the_same_whenever_it_is_made(name):
    target = make_target(name)
    target.prepare()
    for number in (3, 4):
        one, other = (target.make(mutations.generator(SEED, name, number)) for _ in range(2))
        assert one == other or repr(one) == repr(other)
    assert repr(target.make(mutations.generator(SEED + 1, name, 3))) != repr(
        target.make(mutations.generator(SEED, name, 3)))

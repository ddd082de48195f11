# SPDX-License-Identifier: BSD-3-Clause
"""A minute of the fuzzer, always the same cases; a failure prints the command that repeats its case."""
import os
import sys

import pytest

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))

import command  # noqa: E402
import mutations  # noqa: E402
from registry import TARGETS, make_target  # noqa: E402

SEED = 2026
CASES = {"urdf": 350, "sdf": 600, "world": 600, "spawn_text": 400, "services": 180, "mesh": 250, "heights": 150,
         "map": 500, "bag": 170, "tour": 2000, "scans": 300, "state": 500, "network": 60, "parameters": 6000}


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

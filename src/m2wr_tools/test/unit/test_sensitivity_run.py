# SPDX-License-Identifier: BSD-3-Clause
"""One constant is changed in a process of its own, before the mapper reads it."""
import json
import subprocess
import sys

import pytest

from m2wr_gmapping import tuning
from m2wr_tools.slam_benchmark import sensitivity_run as run
from m2wr_tools.slam_benchmark.tuned_constants import constants


def test_values_are_scaled_and_integers_stay_integers():
    assert run.scaled(0.4, 0.5) == 0.2 and run.scaled((0.2, 0.3), 2.0) == (0.4, 0.6)
    assert run.scaled(8, 0.5) == 4 and run.scaled(1, 0.1) == 1 and isinstance(run.scaled(3, 0.5), int)


def test_only_the_named_constant_changes(monkeypatch):
    monkeypatch.setattr(tuning, "MATCHING", tuning.MATCHING)
    cells = tuning.SEARCH.cells
    before = {(one.group, one.name): one.value for one in constants()}
    run.change("MATCHING.narrow", 2.0)
    after = {(one.group, one.name): one.value for one in constants()}
    assert {key for key in before if before[key] != after[key]} == {("MATCHING", "narrow")}
    assert after["MATCHING", "narrow"] == pytest.approx(0.02)
    assert tuning.SEARCH.cells == pytest.approx([2.0**0.5 * cell for cell in cells])     # follows


def test_the_mapper_reads_the_changed_value():
    code = ("from m2wr_tools.slam_benchmark import sensitivity_run as run\nrun.change('MATCHING.narrow', 2.0)\n"
            "from m2wr_gmapping.frontend.matcher import NARROW\nprint(NARROW)\n")
    told = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True, timeout=300).stdout
    assert float(told) == 2.0 * tuning.MATCHING.narrow


def test_a_log_that_cannot_be_mapped_ends_the_process(tmp_path):
    task = dict(constant="", factor=1.0, memory=6 << 30, runs=[
        ["--bag_filename", str(tmp_path / "none.bag"), "--map", str(tmp_path / "plan")]])
    done = subprocess.run([sys.executable, "-m", "m2wr_tools.slam_benchmark.sensitivity_run"], timeout=300,
                          input=json.dumps(task).encode(), stderr=subprocess.PIPE)
    assert done.returncode != 0 and b"none.bag" in done.stderr

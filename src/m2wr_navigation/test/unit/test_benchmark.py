# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark measures what it says, on grids that have a path."""
import json

import numpy as np
import pytest

from m2wr_navigation.benchmark import command, grids, layers, localization


@pytest.mark.parametrize("name", ["open", "blocks", "rooms"])
def test_every_scene_has_a_path(name):
    costmap, start, goal = grids.scenes(400, 3)[name]
    row = command.plan_row(name, costmap, (start, goal), "AStar")
    assert row.remark.endswith(" m") and float(row.remark[:-2]) > 25.0 and row.cpu_ms > 0.0


def test_scenes_are_the_same_for_a_seed():
    first, again = (grids.scenes(300, 7)["blocks"][0].costs for _ in range(2))
    assert (first == again).all() and (first != grids.scenes(300, 8)["blocks"][0].costs).any()


def test_the_rows_are_printed_and_written(tmp_path, capsys, monkeypatch):
    rows = [command.Row("inflation", 0.05, 0.37), command.Row("plan", 1.0, None, "25.0 m")]
    monkeypatch.setattr(command, "rows_of", lambda seed, large: iter(rows))
    assert command.main(["--quick", "--json", str(tmp_path / "rows.json")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert "0.37" in printed[1] and "25.0 m" in printed[2]
    assert json.loads((tmp_path / "rows.json").read_text())[0]["original_ms"] == 0.37


def test_inflation_is_not_slower_than_the_original():
    row = command.inflation_row(grids.blocks(200, np.random.default_rng(0)), 11)
    assert row.original_ms == 0.37 and row.cpu_ms < row.original_ms


def test_dwa_takes_less_than_half_of_the_original():
    # a quarter on a machine that does nothing else; CPU times rise by half beside other work
    row = command.controller_row(0, "DWAPlannerROS", command._DWA, 6.6)
    assert int(row.task.split()[1]) >= 800 and row.cpu_ms < 0.5 * row.original_ms


def test_amcl_takes_less_than_a_fifth_of_the_original():
    # a tenth on a machine that does nothing else
    assert localization.field_time(3000, 60, 0) < 0.2 * localization.ORIGINAL_MS[3000, 60]


@pytest.mark.parametrize("name", ["ObstacleLayer", "VoxelLayer"])
def test_a_layer_takes_a_cloud_in_less_than_a_fifth_of_a_cycle(name):
    assert layers.layer_time(name, "cloud", 0) < 0.2 * 1e3 / 5.0, "of update_frequency 5 Hz"

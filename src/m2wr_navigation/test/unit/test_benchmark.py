# SPDX-License-Identifier: BSD-3-Clause
"""The benchmark measures what it says, on grids that have a path."""
import json

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
    rows = [command.Row("inflation", 0.1, 0.4), command.Row("plan", 1.0, None, "25.0 m")]
    monkeypatch.setattr(command, "rows_of", lambda seed, large: iter(rows))
    assert command.main(["--quick", "--json", str(tmp_path / "rows.json")]) == 0
    printed = capsys.readouterr().out.splitlines()
    assert printed[1].split()[1:] == ["0.100", "0.40", "0.25"] and printed[2].split()[1:] == ["1.000", "25.0", "m"]
    assert json.loads((tmp_path / "rows.json").read_text())[0]["original_ms"] == 0.4


def test_the_dwa_row_evaluates_as_many_samples_as_the_original():
    row = command.controller_row(0, "DWAPlannerROS", command._DWA, 6.6)
    assert int(row.task.split()[1]) >= 800 and row.cpu_ms > 0.0 and row.original_ms == 6.6


def test_the_times_of_amcl_and_of_a_layer_are_measured():
    assert localization.field_time(500, 60, 0) > 0.0
    for name in ("ObstacleLayer", "VoxelLayer"):
        assert layers.layer_time(name, "cloud", 0) > 0.0

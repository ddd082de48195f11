# SPDX-License-Identifier: BSD-3-Clause
"""The command varies constants over logs, one process for each variation, and keeps what is finished."""
import json
import math

import numpy as np
import pytest

from m2wr_gmapping import tuning
from m2wr_tools.slam_benchmark import laser_logs
from m2wr_tools.slam_benchmark import sensitivity_command as command
from m2wr_tools.slam_benchmark.tuned_constants import constants

ROOM = 4.0


@pytest.fixture
def log(tmp_path):
    """Return a CARMEN log of a short drive in a square room, with the true poses beside it."""
    along = np.abs((0.1 * np.arange(40) + 2.0) % 4.0 - 2.0)
    poses = np.column_stack([along, np.zeros(40), 0.3 * np.sin(0.2 * np.arange(40))])
    lines = []
    for k, pose in enumerate(poses):
        angles = pose[2] + np.linspace(-math.pi / 2, math.pi / 2, 181)
        with np.errstate(divide="ignore"):
            walls = [np.where(side * part > 1e-9, (ROOM - side * at) / (side * part), np.inf)
                     for part, at in ((np.cos(angles), pose[0]), (np.sin(angles), pose[1])) for side in (1.0, -1.0)]
        ranges = " ".join("%.3f" % value for value in np.minimum.reduce(walls))
        place = "{:.6f} {:.6f} {:.6f}".format(*pose)
        lines.append("FLASER 181 {0} {1} {1} {2} host {2}".format(ranges, place, k))
    (tmp_path / "room.clf").write_text("\n".join(lines) + "\n")
    (tmp_path / "room.ref").write_text("".join("{} {} {} {}\n".format(k, *pose) for k, pose in enumerate(poses)))
    return tmp_path / "room.clf"


def test_constants_are_chosen_by_name_and_by_group():
    assert len(command.chosen(None)) == len(list(constants()))
    assert [one.name for one in command.chosen(["MATCHING.rounds"])] == ["rounds"]
    assert {one.group for one in command.chosen(["SLIPS", "OCCLUSION"])} == {"SLIPS", "OCCLUSION"}
    with pytest.raises(ValueError, match="--only NONE: no such constant"):
        command.chosen(["NONE"])


def test_constants_in_compiled_kernels_are_known():
    compiled = command.compiled_constants()
    assert {"ODOMETRY.floor", "MATCHING.basin", "CALIBRATION.prior", "DRIFT.step"} <= compiled     # by TRACKING
    assert not {"MATCHING.good_share", "OCCLUSION.scans", "PARTICLES.drawn"} & compiled
    assert tuning.DRIFT == tuning.Drift()


def test_logs_are_files_or_folders_with_truth(log, tmp_path):
    assert [one.name for one in command.find_logs([str(log)])] == ["room"]
    assert [one.name for one in command.find_logs([str(tmp_path)])] == ["room"]
    (tmp_path / "room.ref").unlink()
    with pytest.raises(laser_logs.LogError, match="no log with ground truth"):
        command.find_logs([str(tmp_path)])


@pytest.mark.parametrize("words", [["--factor", "1"], ["--factor", "x"], ["--jobs", "0"], ["--only", "NONE"],
                                   ["--json", "/nowhere/at/all.json"]])
def test_wrong_options_are_usage_errors(words, capsys):
    with pytest.raises(SystemExit) as ended:
        command.main(words)
    assert ended.value.code == 2 and words[0] in capsys.readouterr().err


def test_a_constant_is_varied_over_a_log(log, tmp_path, capsys):
    out = tmp_path / "out.json"
    assert command.main([str(log), "--only", "MATCHING.good_share", "--particles", "2", "--json", str(out),
                         "--quiet"]) == 0
    told = json.loads(out.read_text())
    assert told["base"]["room"] < 0.02
    constant, = told["constants"]
    assert constant["constant"] == "MATCHING.good_share" and sorted(constant["errors"]) == ["0.5", "2.0"]
    assert all(errors["room"] is not None for errors in constant["errors"].values())
    assert "| MATCHING.good_share | 0.8 | 1 | 0.0" in capsys.readouterr().out


def test_an_interrupted_run_prints_what_is_finished(log, tmp_path, monkeypatch, capsys):
    ran = []

    def vary(self, name, factor):
        if len(ran) == 3:
            raise KeyboardInterrupt
        ran.append((name, factor))
        return {"room": 0.01}
    monkeypatch.setattr(command.Sensitivity, "_vary", vary)
    code = command.main([str(log), "--only", "OCCLUSION", "--json", str(tmp_path / "out.json"), "--quiet"])
    name = "OCCLUSION." + command.chosen(["OCCLUSION"])[0].name
    assert code == 130 and ran == [("", 1.0), (name, 0.5), (name, 2.0)]
    assert "| {} |".format(name) in capsys.readouterr().out
    assert len(json.loads((tmp_path / "out.json").read_text())["constants"]) == 1

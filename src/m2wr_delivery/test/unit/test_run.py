# SPDX-License-Identifier: BSD-3-Clause
"""A whole run in the simulator, the command, and the correction of a robot's position."""
import json
import os
import signal

import numpy as np
import pytest

from m2wr_delivery.position import GAIN, take_fix
from m2wr_delivery.study import command
from m2wr_delivery.study.command import main
from m2wr_elevation.dead_reckoning import DeadReckoning
from m2wr_elevation.elevation_map import ElevationMap, MapSettings


class Mapping:
    def __init__(self):
        self.map, self.reckoning = ElevationMap(MapSettings(), follow=False), DeadReckoning()
        self.map.height[:] = 0.0


def test_a_small_difference_is_noise_and_a_large_one_is_a_slide():
    robot = Mapping()
    assert not take_fix(robot, (0.1, 0.0))
    assert np.allclose(robot.reckoning.position, (0.1 * GAIN, 0.0, 0.0)) and np.all(robot.map.height == 0.0)
    assert take_fix(robot, (2.0, 1.0))
    assert np.allclose(robot.reckoning.position, (2.0, 1.0, 0.0)) and np.all(np.isnan(robot.map.height))


def test_a_robot_delivers_a_parcel_in_the_simulator(tmp_path, capsys):
    output = str(tmp_path / "run")
    code = main(["--robots", "1", "--parcels", "1", "--blocked", "0", "--size", "14", "--walls", "2", "--roughness",
                 "0.5", "--limit", "300", "--seed", "5", "--output", output])
    assert code == 0, capsys.readouterr().out
    assert "result: 1 of 1 parcels delivered" in capsys.readouterr().out
    with open(output + ".json", encoding="utf-8") as file:
        assert json.load(file)["parcels"][0]["robot"] == "robot1"


ROW = {"seed": 3, "time": 60.0, "parcels": [{"delivered": 50.0, "way_exists": True}],
       "robots": [{"end": "", "distance": 9.0, "energy": 80.0, "charged": 0.0}]}


def one_that_dies(task):
    if task.seed == 4:
        os.kill(os.getpid(), signal.SIGKILL)
    return dict(ROW, seed=task.seed)


def test_a_run_that_dies_is_told_and_the_others_are_counted(monkeypatch, capsys):
    monkeypatch.setattr(command, "_one", one_that_dies)
    assert main(["--runs", "3", "--seed", "3", "--processes", "2"]) == 1
    told = capsys.readouterr()
    assert "seed 4: no result: its worker died 2 times" in told.err
    assert "seed 3: 1 of 1" in told.out and "seed 5: 1 of 1" in told.out and "2 of 2 delivered" in told.out


def one_without_room(task):
    raise ValueError("no room for 3 robots")


def test_a_field_that_cannot_be_made_is_told_without_a_traceback(monkeypatch, capsys):
    monkeypatch.setattr(command, "_one", one_without_room)
    assert main(["--runs", "2"]) == 1
    told = capsys.readouterr()
    assert "seed 1: no result: no room for 3 robots" in told.err and "Traceback" not in told.err and not told.out


def test_ctrl_c_leaves_a_table_of_what_has_ended(monkeypatch, capsys):
    def rows(*_):
        yield ROW
        raise KeyboardInterrupt

    monkeypatch.setattr(command.Pool, "rows", rows)
    with pytest.raises(KeyboardInterrupt):
        main(["--runs", "2"])
    told = capsys.readouterr().out
    assert "stopped: 1 of 2 runs have ended" in told and "1 of 1 delivered" in told


def test_wrong_arguments_are_refused(capsys):
    assert main(["--robots", "0"]) == 2 and "robots is 0" in capsys.readouterr().err
    assert main(["--runs", "0"]) == 2 and "--runs 0" in capsys.readouterr().err

# SPDX-License-Identifier: BSD-3-Clause
"""A campaign stores each run when it ends, continues after kill -9, and gives the same rows on any worker."""
import os
import pickle
import signal
import time
import zlib
from dataclasses import replace

import numpy as np
import pytest
from rosbags.rosbag1 import Reader

from m2wr_campaign.runner import command, one_run
from m2wr_campaign.runner.last_seconds import TOPICS, message_types
from m2wr_campaign.runner.one_run import RunError, perform, watched
from m2wr_campaign.store.result_file import ResultFile
from m2wr_campaign.store.schema import RUN_COLUMNS
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.study_file import read_study
from m2wr_navigation import registry
from m2wr_navigation.methods.method import Decision

STUDY = """
study: small
repeats: 3
limit: 4
worlds: [{file: world02, start: [0, 8], goal: [0, 7]}]
methods: [bug0, potential_field]
"""
MEASURED = {"wall", "cpu", "cpu_ms", "finished"}
LIMIT = 60.0        # s


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(STUDY)
    return tmp_path / "small.yaml"


def stored(path="small.sqlite"):
    with ResultFile(path) as results:
        return {run["key"]: (run, results.path_of(run["key"]).tolist()) for run in results.runs()}


def test_rows_are_the_same_on_any_worker_and_in_any_order(study, capsys):
    assert command.main([str(study), "--workers", "2"]) == 0
    told = capsys.readouterr().out
    assert "6 of 6 runs, " in told and "0 failed" in told and "6 of 6 runs are in small.sqlite" in told
    rows = stored()
    for task in reversed(all_tasks(read_study(str(study)))):
        again, (run, path) = perform(task), rows[task.key]
        assert {name: run[name] for name in set(RUN_COLUMNS) - MEASURED - {"path"}} == {
            name: again.get(name) for name in set(RUN_COLUMNS) - MEASURED - {"path"}}
        assert run["outcome"] == "reached" and run["success"] == 1 and run["seed"] == task.seed and len(path) > 5
        assert run["ratio"] >= 0.99 and run["optimum"] == pytest.approx(1.0, abs=0.2) and run["cpu"] > 0.0
    assert len({run["seed"] for run, _ in rows.values()}) == 3        # both methods have the same three


def test_a_campaign_continues_after_kill_9(study, tmp_path, monkeypatch, capsys):
    begun = tmp_path / "begun"
    begun.mkdir()

    def slow(task):
        (begun / "{} {}".format(task.number, os.getpid())).write_text("")
        while task.number == 4 and not (tmp_path / "go").exists():
            time.sleep(0.01)
        return dict(task.factors(), key=task.key, status="done", outcome="reached", reason="", success=1, log="",
                    versions="{}")

    monkeypatch.setattr(command, "perform", slow)
    child = os.fork()
    if child == 0:
        try:
            command.main([str(study), "--workers", "1"])
        finally:
            os._exit(1)
    until = time.monotonic() + LIMIT
    while not any(name.startswith("4 ") for name in os.listdir(begun)) and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    assert len(stored()) == 3
    (tmp_path / "go").write_text("")
    assert command.main([str(study), "--workers", "2"]) == 0
    assert len(stored()) == 6 and "6 of 6 runs are in" in capsys.readouterr().out
    assert sorted(int(name.split()[0]) for name in os.listdir(begun)) == [0, 1, 2, 3, 4, 4, 5]
    monkeypatch.setattr(command, "Pool", lambda *given: pytest.fail("it ran again"))
    monkeypatch.setattr(command, "compile_kernels", lambda: pytest.fail("it compiled"))
    assert command.main([str(study)]) == 0


def test_a_stop_by_ctrl_c_keeps_what_was_run(study, monkeypatch, capsys):
    def rows(self, tasks, limit):
        yield dict(tasks[0].factors(), key=tasks[0].key, status="failed", outcome="failed", reason="it broke",
                   success=0, log="", versions="{}")
        raise KeyboardInterrupt

    monkeypatch.setattr(command.Pool, "rows", rows)
    assert command.main([str(study)]) == 130
    assert "stopped: 1 of 6 runs are in small.sqlite; the same command continues" in capsys.readouterr().out
    (run, _), = stored().values()
    assert run["status"] == "failed" and run["reason"] == "it broke"


def test_a_worker_without_the_files_of_a_world_can_do_the_run(study, tmp_path):
    """World and mesh travel with the task, as to a worker on another machine."""
    (tmp_path / "wall.obj").write_text(
        "v 1 -2 0\nv 1 2 0\nv 1 2 1\nv 1 -2 1\nv 1.2 0 0\nf 1 2 3\nf 1 3 4\nf 2 5 3\nf 5 1 4\nf 3 5 4\nf 1 5 2\n")
    (tmp_path / "walled.world").write_text(
        '<sdf version="1.6"><world name="w"><include><uri>model://ground_plane</uri></include><model name="wall">'
        '<static>1</static><link name="l"><collision name="c"><geometry><mesh><uri>wall.obj</uri></mesh></geometry>'
        '</collision></link></model></world></sdf>')
    walled = STUDY.replace("{file: world02, start: [0, 8], goal: [0, 7]}",
                           "{file: walled.world, start: [0, 0], goal: [2, 0]}")
    study.write_text(walled.replace("limit: 4", "limit: 60"))
    bug0 = pickle.dumps(all_tasks(read_study(str(study)))[0])
    for name in ("wall.obj", "walled.world", "small.yaml"):
        (tmp_path / name).unlink()
    row = perform(pickle.loads(bug0))
    assert row["status"] == "done" and row["optimum"] > 2.5 and row["outcome"] == "reached" and row["length"] > 2.5


def test_a_start_inside_of_an_obstacle_is_a_failed_run(study):
    task = all_tasks(read_study(str(study)))[0]
    row = perform(replace(task, world=replace(task.world, key="other", goal=(0.0, 4.73))))
    assert row["status"] == "failed" and "the goal (0.00, 4.73) is" in row["reason"] and row["success"] == 0


def test_a_command_that_is_not_finite_ends_the_run():
    class Result:
        time = 1.5

    with pytest.raises(RunError, match=r"at 1.50 s: command \(nan, 0.0\); expected finite numbers"):
        watched(lambda result: Decision(float("nan"), 0.0))(Result())
    assert watched(lambda result: Decision(0.1, 0.2))(Result()).linear == 0.1


class Broken:
    """A method of a user that fails after a second."""

    def __init__(self, parameters, body, command=None):
        self.command = command

    def begin(self, goal):
        pass

    def step(self, sensing):
        if sensing.stamp > 1.0 and self.command is None:
            raise ZeroDivisionError("no gap")
        return Decision(0.2, 0.0) if sensing.stamp <= 1.0 else self.command


@pytest.mark.parametrize("command, reason, log", [
    (None, "ZeroDivisionError: no gap", "in step\n    raise ZeroDivisionError"),
    (Decision(0.1, float("nan")), "command (0.1, nan); expected finite numbers", ""),
    (0.3, "AttributeError: 'float' object has no attribute 'linear'", "AttributeError")])
def test_a_run_that_fails_keeps_reason_log_and_path(study, monkeypatch, command, reason, log):
    task = all_tasks(read_study(str(study)))[0]
    broken = type("Made", (Broken,), {"PARAMETERS": {}, "__init__": lambda self, parameters, body: Broken.__init__(
        self, parameters, body, command)})
    find = registry.find
    monkeypatch.setattr(registry, "find", lambda table, name: broken if name == "bug0" else find(table, name))
    row = perform(task)
    assert row["status"] == "failed" and reason in row["reason"] and log in row["log"] and row["success"] == 0
    path = np.frombuffer(zlib.decompress(row["path"]), "<f4").reshape(-1, 2)
    assert len(path) > 1 and row["time"] == pytest.approx(1.05, abs=0.11)
    assert np.hypot(*(path[-1] - path[0])) == pytest.approx(0.2, abs=0.1)
    assert row["bag"]


def test_the_bag_of_a_failed_run_has_its_last_ten_seconds(study, monkeypatch, tmp_path):
    task = replace(all_tasks(read_study(str(study)))[0], limit=20.0)

    class Late(Broken):
        PARAMETERS = {}

        def __init__(self, parameters, body):
            Broken.__init__(self, parameters, body)

        def step(self, sensing):
            return Decision(0.0, 0.3 if sensing.stamp < 15.0 else float("nan"))

    find = registry.find
    monkeypatch.setattr(registry, "find", lambda table, name: Late if name == "bug0" else find(table, name))
    row = perform(task)
    path = tmp_path / "run.bag"
    path.write_bytes(row["bag"])
    types = message_types()
    found = {}
    with Reader(path) as reader:
        assert reader.duration == pytest.approx(9.95e9, abs=1e7) and reader.message_count == 200 * len(TOPICS)
        for connection, _, data in reader.messages():
            found.setdefault(connection.topic, []).append(types.deserialize_ros1(data, connection.msgtype))
    assert set(found) == set(TOPICS)
    commands, scans, odometry = found["/cmd_vel"], found["/m2wr/laser/scan"], found["/odom"]
    assert commands[0].angular.z == 0.3 and np.isnan(commands[-1].angular.z)
    assert len(scans[-1].ranges) == 720 and not np.array_equal(scans[0].ranges, scans[-1].ranges)
    assert odometry[-1].twist.twist.angular.z == pytest.approx(0.3, abs=0.02)
    place = found["/base_pose_ground_truth"][-1].pose.pose.position
    assert (place.x, place.y) == pytest.approx((0.0, 8.0), abs=0.1)


def test_a_stored_path_is_bounded(monkeypatch):
    monkeypatch.setattr(one_run, "MOST_POINTS", 50)
    whole = np.cumsum(np.full((5000, 2), 0.02), axis=0)
    kept = np.frombuffer(zlib.decompress(one_run._path_of(whole)), "<f4").reshape(-1, 2)
    assert 40 < len(kept) <= 50 and np.allclose(kept[[0, -1]], whole[[0, -1]])


@pytest.mark.parametrize("words, told", [(["none.yaml"], "none.yaml: No such file"),
                                         (["small.yaml", "--out", "no/folder.sqlite"], "No such file or directory")])
def test_what_cannot_be_run_is_told(study, capsys, words, told):
    assert command.main(words) == 1
    error = capsys.readouterr().err
    assert told in error and error.startswith("run: ") and error.count("\n") == 1


def test_a_dry_run_counts_and_writes_nothing(study, tmp_path, capsys):
    assert command.main([str(study), "--dry-run"]) == 0
    assert capsys.readouterr().out == "small: 6 runs in 1 worlds\n" and len(list(tmp_path.iterdir())) == 1

# SPDX-License-Identifier: BSD-3-Clause
"""A campaign on a cluster of Dask loses no finished run, and says in one sentence what is wrong with the cluster."""
import importlib.util
import sys
from collections import deque
from types import SimpleNamespace

import pytest

import cluster_kills
from m2wr_campaign.runner import cluster, command
from m2wr_campaign.runner.cluster import Cluster, ClusterError, batch

STUDY = "study: one\nlimit: 4\nworlds: [{file: world02, start: [0, 8], goal: [0, 7]}]\nmethods: [bug0]\n"
NO_DASK = importlib.util.find_spec("distributed") is None


@pytest.fixture
def study(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "one.yaml").write_text(STUDY)
    return str(tmp_path / "one.yaml")


@pytest.mark.skipif(NO_DASK, reason="the optional Python package distributed is not installed")
def test_kills_of_each_process_lose_no_finished_run(tmp_path):
    killer = cluster_kills.Killer(5, ["worker", "scheduler", "client"], 3, 0.3)
    with cluster_kills.Cluster(str(tmp_path)) as dask:
        number = 0
        while killer.left:
            number += 1
            study, path = cluster_kills.run_study(str(tmp_path), number, 8, killer, dask)
    assert [name.rstrip("01") for name, _ in killer.done] == ["worker", "scheduler", "client"]
    cluster_kills.assert_like_in_the_pool(study, path)


@pytest.mark.skipif(NO_DASK, reason="the optional Python package distributed is not installed")
def test_the_embedded_scheduler_gives_the_rows_of_the_pool(study, tmp_path):
    path = str(tmp_path / "local.sqlite")
    client = cluster_kills.Part("client", ["-c", cluster_kills.CLIENT, study, "--out", path, "--scheduler", "local",
                                           "--workers", "2"], str(tmp_path))
    client.start()
    try:
        assert client.process.wait(cluster_kills.LIMIT) == 0, client.log()
    finally:
        client.kill()
    assert len(cluster_kills.stored(path)) == 1 and "Traceback" not in client.log()
    cluster_kills.assert_like_in_the_pool(study, path)


@pytest.mark.skipif(NO_DASK, reason="the optional Python package distributed is not installed")
def test_a_scheduler_that_does_not_answer_is_told(study):
    port = cluster_kills.free_port()
    program = cluster_kills.CLIENT.replace("LARGEST_BATCH = 4", "FIRST_PATIENCE = 1")
    client = cluster_kills.Part("client", ["-c", program, study, "--scheduler", "tcp://127.0.0.1:%d" % port], ".")
    client.start()
    try:
        assert client.process.wait(cluster_kills.LIMIT) == 1
    finally:
        client.kill()
    assert "no scheduler of Dask answers at tcp://127.0.0.1:%d within 1 s" % port in client.log()
    assert "Traceback" not in client.log()


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "local"])
def test_without_dask_the_message_says_what_to_install(study, monkeypatch, capsys, address):
    monkeypatch.setitem(sys.modules, "distributed", None)
    assert command.main([study, "--scheduler", address]) == 1
    error = capsys.readouterr().err
    assert "pip install distributed" in error and error.count("\n") == 1


@pytest.mark.parametrize("address", ["host:8786", "tcp://host", "tcp://:", "file:///x"])
def test_an_address_of_another_form_is_refused(study, capsys, address):
    with pytest.raises(SystemExit):
        command.main([study, "--scheduler", address])
    assert "expected an address such as tcp://host:8786, or local" in capsys.readouterr().err


def task(key, world="w"):
    return SimpleNamespace(key=key, world=SimpleNamespace(key=world))


def test_a_batch_is_in_one_world():
    waiting = deque([task(1), task(2), task(3), task(4, "v")])
    assert [[one.key for one in batch(waiting, 2)] for _ in range(3)] == [[1, 2], [3], [4]] and not waiting


class Killed(Exception):
    """As Dask's KilledWorker."""


class Future:
    """A future of a client that answers at once."""

    def __init__(self, data, problem):
        self.data, self.problem, self.status = data, problem, "error" if problem else "finished"

    def add_done_callback(self, call):
        call(self)

    def exception(self, timeout):
        return self.problem

    def result(self, timeout):
        return [{"key": one.key, "wall": 0.001, "status": "done"} for one in self.data.tasks]


class Client:
    """A cluster in which some batches end with a problem."""

    status = "running"

    def __init__(self, problem_of):
        self.problem_of, self.batches = problem_of, []

    def nthreads(self):
        return {"one": 2}

    def submit(self, function, data, pure):
        keys = [one.key for one in data.tasks]
        self.batches.append(keys)
        return Future(data, self.problem_of(keys))

    def close(self, timeout):
        pass


def rows_of(monkeypatch, tasks, problem_of):
    client = Client(problem_of)
    monkeypatch.setattr(cluster, "distributed", lambda: SimpleNamespace(
        Client=lambda *given, **more: client, scheduler=SimpleNamespace(KilledWorker=Killed)))
    made = Cluster("tcp://one:1", lambda one, reason, log, wall: {"key": one.key, "wall": wall, "status": "failed",
                                                                  "reason": reason}, print)
    return {row["key"]: row for row in made.rows(tasks, 10.0)}, client.batches


def test_one_task_of_a_batch_that_kills_workers_has_failed(monkeypatch):
    rows, batches = rows_of(monkeypatch, [task(k) for k in range(40)], lambda keys: Killed("by 33") if 33 in keys
                            else None)
    assert len(rows) == 40 and [key for key, row in rows.items() if row["status"] == "failed"] == [33]
    assert "died each time: by 33" in rows[33]["reason"] and [33] in batches
    assert max(map(len, batches)) > 4 and batches[0] == [0]


def test_a_worker_without_the_workspace_ends_the_campaign(monkeypatch):
    with pytest.raises(ClusterError, match="cannot do the runs: ModuleNotFoundError: no m2wr; its workspace"):
        rows_of(monkeypatch, [task(1)], lambda keys: ModuleNotFoundError("no m2wr"))

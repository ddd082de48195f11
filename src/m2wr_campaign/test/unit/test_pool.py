# SPDX-License-Identifier: BSD-3-Clause
"""A worker that dies or hangs costs only its task, is replaced, and does not outlive the campaign."""
import os
import signal
import time
from unittest import mock

import pytest

from m2wr_campaign.runner import pool
from m2wr_campaign.runner.pool import Pool

LIMIT = 60.0        # s


def lost(task, reason, log, wall):
    return {"task": task, "status": "failed", "reason": reason, "log": log, "wall": wall}


def run(perform, tasks, workers=2, limit=LIMIT):
    return {row["task"]: row for row in Pool(perform, lost, workers).rows(tasks, limit)}


def test_all_tasks_are_done_by_several_processes(tmp_path):
    def perform(task):
        (tmp_path / str(os.getpid())).write_text("")
        while len(list(tmp_path.iterdir())) < 2:        # the other worker has begun
            time.sleep(0.01)
        return {"task": task, "square": task * task}

    rows = run(perform, list(range(20)))
    assert {task: row["square"] for task, row in rows.items()} == {k: k * k for k in range(20)}
    assert str(os.getpid()) not in os.listdir(tmp_path)


@pytest.mark.parametrize("how", [lambda: os.kill(os.getpid(), signal.SIGKILL), lambda: os._exit(3)],
                         ids=["kill", "exit"])
def test_a_task_that_kills_its_worker_twice_has_failed(tmp_path, how):
    def perform(task):
        if task == 3:
            (tmp_path / str(os.getpid())).write_text("")
            os.write(2, b"something terrible\n")
            how()
        return {"task": task}

    rows = run(perform, list(range(8)))
    assert len(rows) == 8 and rows[3]["status"] == "failed"
    assert "its worker died 2 times, at last by" in rows[3]["reason"] and rows[3]["log"] == "something terrible\n"
    assert len(os.listdir(tmp_path)) == 2 and "status" not in rows[4]


def test_a_task_whose_worker_died_once_is_done(tmp_path):
    def perform(task):
        if not (tmp_path / "once").exists():
            (tmp_path / "once").write_text("")
            os.kill(os.getpid(), signal.SIGKILL)
        return {"task": task}

    assert run(perform, [1, 2, 3], 1) == {k: {"task": k} for k in (1, 2, 3)}


def test_a_task_that_never_ends_is_ended():
    def perform(task):
        while task == 1:
            time.sleep(0.01)
        return {"task": task}

    rows = run(perform, [0, 1, 2], 1, 0.5)
    assert rows[1]["reason"] == "no result after 0.5 s" and {0, 1, 2} == set(rows)


def test_waiting_for_a_processor_does_not_count(monkeypatch):
    began = time.monotonic()
    monkeypatch.setattr(pool, "processor_wait", lambda pid: 0.9 * (time.monotonic() - began))
    row, = run(lambda task: time.sleep(60.0), [1], 1, 0.1).values()
    assert row["reason"] == "no result after 0.1 s" and row["wall"] >= 0.9      # to rounding 1.0


def test_a_stop_of_the_campaign_does_not_count(monkeypatch):
    """It is stopped for hours while it waits, before the tasks have ended."""
    later, wait = [0.0], pool.wait

    def stopped_once(pipes, timeout):
        if later[0]:
            return wait(pipes, timeout)
        later[0] = 10000.0
        return []

    monkeypatch.setattr(pool, "wait", stopped_once)
    monkeypatch.setattr(pool, "time", mock.Mock(monotonic=lambda: time.monotonic() + later[0]))
    assert run(lambda task: {"task": task}, [1, 2], 1) == {1: {"task": 1}, 2: {"task": 2}}


def test_the_time_without_a_processor_is_read():
    assert pool.processor_wait(os.getpid()) >= 0.0 == pool.processor_wait(2 ** 30)


def test_an_exception_of_the_program_is_in_the_log():
    def perform(task):
        raise ZeroDivisionError("by task %d" % task)

    row, = run(perform, [7], 1).values()
    assert row["reason"].endswith("exit code 1") and "ZeroDivisionError: by task 7" in row["log"]


def is_running(pid):
    try:
        with open("/proc/%d/stat" % pid) as file:
            return file.read().rsplit(")", 1)[1].split()[0] != "Z"
    except OSError:
        return False


def ends(pid):
    until = time.monotonic() + LIMIT
    while is_running(pid) and time.monotonic() < until:
        time.sleep(0.01)
    return not is_running(pid)


def test_closing_ends_the_workers():
    rows = Pool(lambda task: {"task": os.getpid()}, lost, 2).rows([1, 2, 3], LIMIT)
    pid = next(rows)["task"]
    assert pid != os.getpid() and is_running(pid)
    rows.close()
    assert not is_running(pid)


def test_workers_end_with_their_parent(tmp_path):
    child = os.fork()
    if child == 0:
        def perform(task):
            (tmp_path / str(os.getpid())).write_text("")
            while True:
                time.sleep(0.01)

        try:
            run(perform, [1, 2])
        finally:
            os._exit(0)
    until = time.monotonic() + LIMIT
    while len(os.listdir(tmp_path)) < 2 and time.monotonic() < until:
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    workers = [int(name) for name in os.listdir(tmp_path)]
    assert len(workers) == 2 and all(ends(pid) for pid in workers)

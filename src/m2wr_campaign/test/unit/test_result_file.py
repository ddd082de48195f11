# SPDX-License-Identifier: BSD-3-Clause
"""Results are kept run by run; a file that cannot be used is told in one sentence, and nothing in it is lost."""
import csv
import os
import signal
import sqlite3

import numpy as np
import pytest

from m2wr_campaign.store import command, result_file
from m2wr_campaign.store.result_file import ResultFile, StoreError, packed_path
from m2wr_campaign.store.schema import RUN_COLUMNS
from m2wr_campaign.store.table_export import COLUMNS
from m2wr_campaign.study.factors import StudyWorld
from m2wr_campaign.worlds.generators import generate


@pytest.fixture(scope="module")
def world():
    text, (start, goal) = generate("maze", {"cells": 2, "width": 1.8, "opened": 0.0}, 0, 0, 0.45)
    return StudyWorld("w", "maze 0", "maze", (("cells", 2),), 0, text, text, start, goal, "recipe")


def row(key, **more):
    return dict({"key": key, "world": "w", "robot": "m2wr", "method": "bug2", "parameters": "{}", "noise": None,
                 "repeat": 0, "seed": 7, "status": "done", "outcome": "reached", "reason": "", "success": 1,
                 "length": 2.5, "log": "", "versions": "{}", "finished": "2026-01-01"}, **more)


@pytest.fixture
def path(tmp_path, world):
    path = str(tmp_path / "results.sqlite")
    with ResultFile(path, writing=True) as results:
        results.add_worlds([world, world])
        results.begin("one", "study: one", ["a", "b", "c"])
        results.add(row("a", path=packed_path(np.array([(0.0, 0.5), (1.0, 2.0)]))))
        results.add(row("z"))               # of an earlier plan
    return path


def test_what_is_stored_is_read_again(path, world):
    with ResultFile(path) as results:
        assert results.study() == ("one", "study: one") and results.planned() == 3
        assert results.finished() == {"a", "z"} and [run["key"] for run in results.runs()] == ["a"]
        assert results.path_of("a").tolist() == [[0.0, 0.5], [1.0, 2.0]] and not len(results.path_of("b"))
        assert results.generated("recipe") == world and results.generated("other") is None
        found, = results.worlds()
        assert found["label"] == "maze 0" and len(found["outlines"]) >= 5 and found["goal_x"] == world.goal[0]
        run, = results.runs()
        assert set(run) == set(RUN_COLUMNS) - {"path"} and run["length"] == 2.5 and run["noise"] is None


def test_bags_of_failed_runs_are_kept_and_written(path, tmp_path, capsys):
    with ResultFile(path, writing=True) as results:
        results.add(row("b", status="failed", bag=b"first"))
        results.add(row("b", status="failed", bag=b"second"))      # run again
        results.add(row("c", bag=b""))
    with ResultFile(path) as results:
        assert list(results.bags()) == [("b", b"second")]
    assert command.main([path, str(tmp_path / "out.csv"), "--bags", str(tmp_path / "bags")]) == 0
    assert "1 bags in" in capsys.readouterr().out and (tmp_path / "bags" / "b.bag").read_bytes() == b"second"


def test_a_method_that_always_fails_keeps_some_bags(path):
    with ResultFile(path, writing=True) as results:
        for k in range(result_file.KEPT_BAGS + 5):
            results.add(row("%04d" % k, status="failed", bag=b"bag"))
        results.add(row("x", method="bug1", status="failed", bag=b"other"))
        assert [key for key, _ in results.bags()] == ["%04d" % k for k in range(result_file.KEPT_BAGS)] + ["x"]


def test_a_file_of_an_earlier_release_without_bags(path):
    with sqlite3.connect(path) as data:
        data.execute("DROP TABLE bags")
    with ResultFile(path) as results:
        assert not list(results.bags())
    with ResultFile(path, writing=True) as results:
        results.add(row("b", bag=b"it"))
        assert list(results.bags()) == [("b", b"it")]


def test_a_file_of_the_first_version_is_read_and_upgraded(path):
    names = ", ".join(name for name in RUN_COLUMNS if name != "fault")
    for statement in ("CREATE TABLE old AS SELECT {} FROM runs".format(names), "DROP TABLE runs",
                      "ALTER TABLE old RENAME TO runs", "PRAGMA user_version = 1"):
        change(path, statement)
    with ResultFile(path) as results:
        assert [run["fault"] for run in results.runs()] == [""]
    with ResultFile(path, writing=True) as results:
        results.add(row("b", fault="scan_loss"))
        assert [run["fault"] for run in results.runs()] == ["", "scan_loss"] and results.finished() == {"a", "b", "z"}
    with ResultFile(path) as results:
        assert [run["fault"] for run in results.runs()] == ["", "scan_loss"]


def test_what_was_committed_survives_kill_9(path):
    child = os.fork()
    if child == 0:
        results = ResultFile(path, writing=True)
        for k in range(20):
            results.add(row("run %d" % k))
        os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    with ResultFile(path, writing=True) as results:
        assert len(results.finished()) == 22


def test_a_write_that_a_kill_cut_off_is_undone_by_a_reader(path):
    child = os.fork()
    if child == 0:
        with ResultFile(path, writing=True) as results:
            results._data.execute("PRAGMA cache_size = 1")          # pages are written before the end
            results._data.execute("BEGIN IMMEDIATE")
            for key in range(50):
                results.add(row("more %d" % key, log="x" * 100_000))
            os.kill(os.getpid(), signal.SIGKILL)
    os.waitpid(child, 0)
    assert os.path.getsize(path + "-journal") > 0
    with ResultFile(path) as results:
        assert results.finished() == {"a", "z"}


def test_a_second_campaign_with_the_same_file_is_told(path):
    ready, go = os.pipe(), os.pipe()
    child = os.fork()
    if child == 0:
        with ResultFile(path, writing=True):
            os.write(ready[1], b"1")
            os.read(go[0], 1)
        os._exit(0)
    os.read(ready[0], 1)
    with pytest.raises(StoreError, match="process %d adds runs to it; wait for its end" % child):
        ResultFile(path, writing=True)
    with ResultFile(path) as results:           # reading is possible meanwhile
        assert results.finished() == {"a", "z"}
    os.write(go[1], b"1")
    os.waitpid(child, 0)


def test_a_file_locked_by_another_program_is_told(path, monkeypatch):
    monkeypatch.setattr(result_file, "PATIENCE", 0.1)
    with ResultFile(path, writing=True) as results:
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN EXCLUSIVE")
        with pytest.raises(StoreError, match="another program has locked it for 0 s; end that program"):
            results.add(row("b"))
        other.execute("ROLLBACK")
        results.add(row("b"))
        assert results.finished() == {"a", "b", "z"}


def test_a_full_disk_is_told_and_loses_nothing(path):
    with ResultFile(path, writing=True) as results:
        pages, = results._data.execute("PRAGMA page_count").fetchone()
        results._data.execute("PRAGMA max_page_count = %d" % pages)         # as if no byte were left
        with pytest.raises(StoreError, match="the disk is full; make room and run again: finished runs are kept"):
            results.add(row("b", log="x" * 100_000))
        results._data.execute("PRAGMA max_page_count = %d" % (pages + 100))
        results.add(row("b", log="x" * 100_000))
    with ResultFile(path) as results:
        assert results.finished() == {"a", "b", "z"}


def change(path, statement):
    data = sqlite3.connect(path)
    data.execute(statement)
    data.commit()
    data.close()


@pytest.mark.parametrize("writing", [False, True])
@pytest.mark.parametrize("spoil, told", [
    (lambda path: open(path, "wb").write(b"a poem with many lines\n" * 100), "damaged, or no results of a study"),
    (lambda path: os.truncate(path, 5000), "damaged, or no results of a study"),
    (lambda path: change(path, "PRAGMA user_version = 9"), "version 9 of the tables; expected at most version 2"),
    (lambda path: change(path, "PRAGMA application_id = 5"), "a database of another program"),
], ids=["text", "cut", "version", "program"])
def test_a_file_that_cannot_be_used_is_told_and_unchanged(path, writing, spoil, told):
    spoil(path)
    with open(path, "rb") as file:
        before = file.read()
    with pytest.raises(StoreError, match=told) as error:
        ResultFile(path, writing)
    assert str(error.value).startswith(path) and "\n" not in str(error.value)
    with open(path, "rb") as file:
        assert file.read() == before


def test_the_study_of_a_file_cannot_be_exchanged(path):
    with ResultFile(path, writing=True) as results:
        with pytest.raises(StoreError, match="results of the study 'one'; expected 'two', or a new file"):
            results.begin("two", "", ["x"])
        assert results.planned() == 3


def test_a_missing_file_or_folder_is_told(tmp_path):
    with pytest.raises(StoreError, match="there is no such file"):
        ResultFile(str(tmp_path / "none.sqlite"))
    with pytest.raises(StoreError, match="No such file or directory; expected a file that can be written"):
        ResultFile(str(tmp_path / "none" / "one.sqlite"), writing=True)
    assert not list(tmp_path.iterdir())


def test_the_runs_are_exported_as_csv(path, tmp_path, capsys):
    out = tmp_path / "runs.csv"
    assert command.main([path, str(out)]) == 0 and "1 runs are in" in capsys.readouterr().out
    with open(out, newline="") as file:
        found = list(csv.DictReader(file))
    assert list(found[0]) == list(COLUMNS) and found[0]["world_label"] == "maze 0" and found[0]["length"] == "2.5"


def test_parquet_needs_pyarrow_and_says_so(path, tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "pyarrow", None)
    assert command.main([path, str(tmp_path / "runs.parquet")]) == 1
    assert "pyarrow, which is not installed; write .csv" in capsys.readouterr().err
    assert command.main([path, str(tmp_path / "runs.txt")]) == 1
    assert "expected a name that ends in .csv, .csv.gz, .parquet" in capsys.readouterr().err

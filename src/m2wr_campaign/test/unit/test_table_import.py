# SPDX-License-Identifier: BSD-3-Clause
"""Runs that were done before are taken over from a table or results file, and what such a file holds is checked."""
import csv
import gzip

import pytest

from m2wr_campaign.runner import command
from m2wr_campaign.store import command as exporting
from m2wr_campaign.store.result_file import ResultFile, StoreError
from m2wr_campaign.store.table_import import known_rows
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.study_file import read_study

STUDY = """
study: small
repeats: {}
limit: 4
worlds: [{{file: world02, start: [0, 8], goal: [0, 7]}}]
methods: [bug0]
"""


@pytest.fixture
def done(tmp_path, monkeypatch):
    """Two runs in a results file, and the same as a table."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "small.yaml").write_text(STUDY.format(2))
    assert command.main(["small.yaml"]) == 0
    assert exporting.main(["small.sqlite", "small.csv"]) == 0
    return tmp_path


def stored(path):
    with ResultFile(path) as results:
        return {run["key"]: run for run in results.runs()}


@pytest.mark.parametrize("name, paths", [("small.csv", 0), ("small.csv.gz", 0), ("small.sqlite", 2)])
def test_runs_that_are_known_are_not_run_again(done, capsys, name, paths):
    assert exporting.main(["small.sqlite", "small.csv.gz"]) == 0
    (done / "small.yaml").write_text(STUDY.format(3))
    assert command.main(["small.yaml", "--out", "more.sqlite", "--known", name]) == 0
    assert "2 runs of this study are taken over from " + name in capsys.readouterr().out
    one, more = stored("small.sqlite"), stored("more.sqlite")
    assert len(more) == 3 and set(one) < set(more)
    for key, run in one.items():
        assert more[key] == pytest.approx(dict(run, wall=more[key]["wall"], cpu=more[key]["cpu"]))
        assert more[key]["wall"] == pytest.approx(run["wall"], abs=0.001)
    with ResultFile("more.sqlite") as results:
        assert sum(len(results.path_of(key)) > 0 for key in one) == paths


def test_runs_that_are_stored_keep_what_a_table_lacks(done, capsys):
    assert command.main(["small.yaml", "--known", "small.csv"]) == 0
    assert "0 runs of this study are taken over" in capsys.readouterr().out
    with ResultFile("small.sqlite") as results:
        assert all(len(results.path_of(run["key"])) for run in results.runs())


def test_only_measures_are_taken_from_a_table(done):
    spoil(done, "bug0", "bug9")
    tasks = {task.key: task for task in all_tasks(read_study("small.yaml"))}
    assert {row["method"] for row in known_rows("small.csv", tasks)} == {"bug0"}
    assert not list(known_rows("small.csv", {}))        # of another study


def spoil(folder, before, after, column=None):
    with open(folder / "small.csv", newline="") as file:
        records = list(csv.DictReader(file))
    with open(folder / "small.csv", "w", newline="") as file:
        writer = csv.DictWriter(file, list(records[0]))
        writer.writeheader()
        for number, record in enumerate(records):
            name = column or "method"
            writer.writerow(dict(record, **({name: after} if column is None or number else {})))


@pytest.mark.parametrize("column, value, told", [
    ("length", "far", "small.csv: line 3: length: read 'far'; expected a finite number"),
    ("length", "inf", "small.csv: line 3: length: read 'inf'; expected a finite number"),
    ("contacts", "1.5", "small.csv: line 3: contacts: read '1.5'; expected a finite whole number"),
    ("success", "2", "small.csv: line 3: success: read '2'; expected 0 or 1"),
    ("success", "", "small.csv: line 3: success: read ''; expected a finite whole number"),
    ("status", "good", "small.csv: line 3: status: read 'good'; expected done or failed"),
    ("reason", "x" * 9000, "small.csv: line 3: reason: 9000 characters; expected at most 8000 characters")])
def test_a_value_that_cannot_be_used_changes_nothing(done, capsys, column, value, told):
    spoil(done, None, value, column)
    assert command.main(["small.yaml", "--out", "more.sqlite", "--known", "small.csv"]) == 1
    assert told in capsys.readouterr().err and not stored("more.sqlite")


@pytest.mark.parametrize("name, data, told", [
    ("none.csv", None, "No such file or directory; expected a table"),
    ("some.txt", b"", "expected a name that ends in .csv, .csv.gz or .sqlite"),
    ("some.csv", b"", "no column key; expected a table that export wrote"),
    ("some.csv", b"key,status\n", "no column outcome; expected a table"),
    ("some.csv", b"\xff\xfe", "byte 0 is no UTF-8; expected a table"),
    ("some.csv.gz", b"not packed", "expected a table that export wrote"),
    ("some.csv.gz", gzip.compress(b"key,status")[:-9], "expected a table that export wrote"),
    ("some.sqlite", b"something else, and long enough", "expected the results of a study")])
def test_a_file_of_something_else_is_told(tmp_path, name, data, told):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(StoreError) as error:
        list(known_rows(str(tmp_path / name), {}))
    assert told in str(error.value) or name == "some.sqlite" and "damaged, or no results" in str(error.value)
    assert name in str(error.value) and "\n" not in str(error.value)


def test_a_table_that_is_too_large_is_refused(tmp_path, monkeypatch):
    (tmp_path / "large.csv.gz").write_bytes(gzip.compress(b"0" * 100))
    monkeypatch.setattr("m2wr_campaign.store.table_import.LARGEST_TABLE", 50)
    with pytest.raises(StoreError, match="a table of more than 50 bytes"):
        list(known_rows(str(tmp_path / "large.csv.gz"), {}))

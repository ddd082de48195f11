# SPDX-License-Identifier: BSD-3-Clause
"""Map and experience survive: what is written is read again, what is damaged is named and kept."""
import json
import logging
import os

import numpy as np
import pytest

from m2wr_navigation.best_path import memory as memory_module
from m2wr_navigation.best_path.memory import MOST_RUNS, Memory, Run, load
from m2wr_navigation.best_path.scoring import make_scorer
from m2wr_navigation.best_path.survey import Survey
from m2wr_navigation.best_path.track import ObstacleField, Track


def run(length=5.0, outcome="reached", total=None):
    poses = np.column_stack([np.linspace(0.0, length, 11), np.zeros(11), np.zeros(11)])
    track = Track(0.5 * np.arange(11), poses, np.array([length, 0.0]))
    return Run("Bug 2", outcome, "why", track, poses[::5], {"length": length}, length if total is None else total)


@pytest.fixture
def folder(tmp_path):
    memory = Memory(str(tmp_path / "deep" / "memory"), np.full((40, 50), -1, np.int8), 0.05, (-1.0, -1.0))
    memory.cells[10, 10:20], memory.cells[5:8, 5:8] = 100, 0
    memory.add(run())
    memory.add(run(4.0, "stuck"))
    memory.save_map()
    memory.save_runs()
    return memory.folder


def test_what_is_saved_is_loaded(folder):
    found, made = load(folder), run()
    assert found.cells[10, 15] == 100 and found.cells[6, 6] == 0 and found.cells[0, 0] == -1
    assert found.resolution == pytest.approx(0.05) and found.origin == pytest.approx((-1.0, -1.0))
    assert [one.outcome for one in found.runs] == ["reached", "stuck"] and found.runs[0].amounts == made.amounts
    np.testing.assert_allclose(found.runs[0].track.poses, made.track.poses)
    np.testing.assert_allclose(found.runs[0].plan, made.plan)


def test_an_empty_folder_knows_nothing(tmp_path, caplog):
    found = load(str(tmp_path / "none"))
    assert found.cells is None and found.runs == [] and not caplog.records


@pytest.mark.parametrize("change, reason", [
    (lambda data: "{", "it is no JSON"), (lambda data: "[" * 100000, "it is no JSON"),
    (lambda data: json.dumps(dict(data, version=2)), "its version is 2; expected 1"),
    (lambda data: json.dumps(dict(data, format="else")), "its format is not"),
    (lambda data: json.dumps(dict(data, runs={})), "runs is no list"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], track=[[0, 1, 2]])])), "track: expected rows"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], total=None)])), "run 1, amounts or total"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], track=[[1, 0, 0, 0]] * 2)])), "increasing times"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], total=10**400)])), "run 1, amounts or total"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], plan=[[1e300, 0, 0]])])), "run 1, plan"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], track=[[0, 2e6, 0, 0]])])), "coordinates up to"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], number=0)])), "run 1, number"),
    (lambda data: json.dumps(dict(data, runs=[dict(data["runs"][0], goal=[float("nan"), 0.0])])), "run 1, goal")])
def test_damaged_experience_is_named_and_kept(folder, change, reason, caplog):
    path = os.path.join(folder, "experience.json")
    with open(path, encoding="utf-8") as stream:
        text = change(json.load(stream))
    with open(path, "w", encoding="utf-8") as stream:
        stream.write(text)
    with caplog.at_level(logging.WARNING):
        assert load(folder, keep_damaged=False).runs == [] and os.path.exists(path) and not caplog.records
        found = load(folder)
    assert found.runs == [] and found.cells is not None
    assert reason in caplog.text and path in caplog.text
    with open(path + ".damaged", encoding="utf-8") as stream:
        assert stream.read() == text
    assert not os.path.exists(path)


def test_a_damaged_map_is_named_and_kept(folder, caplog):
    path = os.path.join(folder, "map.yaml")
    with open(path, "w", encoding="utf-8") as stream:
        stream.write("image: map.pgm\nresolution: -1\n")
    with caplog.at_level(logging.WARNING):
        found = load(folder)
    assert found.cells is None and len(found.runs) == 2 and "resolution" in caplog.text
    assert os.path.exists(path + ".damaged")


def test_the_best_run_is_one_that_reached_this_goal():
    memory = Memory("")
    for one in (run(total=7.0), run(total=3.0, outcome="stuck"), run(total=6.0), run(9.0, total=1.0)):
        memory.add(one)
    number, found = memory.best((0.1, 0.0), (5.1, 0.0))
    assert number == 3 and found.total == 6.0
    assert memory.best((0.7, 0.0), (5.0, 0.0)) is None and memory.best((0.0, 0.0), (5.3, 0.0)) is None


def test_an_older_damaged_file_is_kept(folder):
    path = os.path.join(folder, "experience.json")
    for text in ("first", "second"):
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(text)
        load(folder)
    for end, text in ((".damaged", "first"), (".damaged.2", "second")):
        with open(path + end, encoding="utf-8") as stream:
            assert stream.read() == text


def test_of_too_many_runs_the_useful_ones_are_kept(tmp_path):
    memory = Memory(str(tmp_path))
    for one in [run(), run(9.0, total=50.0), run(9.0, total=60.0)] + [run(1.0, "interrupted")] * (MOST_RUNS + 5):
        memory.add(one)
    memory.save_runs()
    found = load(str(tmp_path))
    # of each goal the best one, and the newest, with the numbers that they had
    newest = MOST_RUNS + 8
    assert [one.number for one in found.runs] == [1, 2] + list(range(newest - MOST_RUNS + 3, newest + 1))
    assert found.best((0.0, 0.0), (9.0, 0.0))[0] == 2 and found.add(run()).number == newest + 1
    assert os.path.exists(str(tmp_path / "run_{}.txt".format(newest)))


def test_what_is_written_is_small_enough_to_be_read(tmp_path, monkeypatch):
    monkeypatch.setattr(memory_module, "MOST_SAMPLES", 6)
    monkeypatch.setattr(memory_module, "LARGEST", 4000)
    memory = Memory(str(tmp_path))
    for _ in range(20):
        memory.add(run())
    memory.save_runs()
    found = load(str(tmp_path))
    assert 2 <= len(found.runs) < 20 and found.runs[-1].number == 20 and found.best((0.0, 0.0), (5.0, 0.0))[0] == 1
    assert len(found.runs[0].track.stamps) == 6 and os.path.getsize(str(tmp_path / "experience.json")) <= 4000


def test_other_weights_score_old_runs_again():
    memory = Memory("", runs=[run()])
    survey = Survey(20.0, (0.0, 0.0))
    memory.rescore(make_scorer({"length": {"weight": 2.0}, "time": {"weight": 0.0}, "energy": {"weight": 0.0}},
                               "~")[0], ObstacleField(survey.costs))
    assert memory.runs[0].total == pytest.approx(10.0) and memory.runs[0].amounts["time"] == pytest.approx(5.0)

# SPDX-License-Identifier: BSD-3-Clause
"""Fields of BARN have the published distribution, runs are judged by the truth, and the command continues."""
import json
import math
from collections import Counter

import numpy as np
import pytest

from m2wr_navigation.barn import command, runs
from m2wr_navigation.barn.fields import (
    FILLS,
    ROUNDS,
    SIDE,
    automaton,
    configuration_space,
    crossing,
    difficulty,
    fields,
    length_of,
)
from m2wr_navigation.barn.runs import driving_time, jackal
from m2wr_navigation.barn.score import score, summary
from m2wr_navigation.barn.worlds import CELL, cylinders_of, optimal_time, place_of, reference_length, scene_of
from m2wr_navigation.methods.method import Decision
from m2wr_sim.api import read_world
from m2wr_sim.model.outlines import obstacle_outlines


@pytest.fixture(scope="module")
def some():
    return list(fields(12, 3))


def test_all_kinds_of_fields_are_drawn_equally_often(some):
    assert Counter((field.fill, field.rounds) for field in some) == {(fill, s): 1 for fill in FILLS for s in ROUNDS}


def test_the_same_seed_gives_the_same_fields(some):
    again = next(fields(1, 3))
    assert (again.full == some[0].full).all() and again.path == some[0].path
    assert (next(fields(1, 4)).full != some[0].full).any()


def test_the_automaton_follows_its_rule():
    for fill in FILLS:
        first = automaton(np.random.default_rng(1), fill, 0)
        assert first[0].all() and first[-1].all() and abs(first[1:-1].mean() - fill) < 0.06
        then = automaton(np.random.default_rng(1), fill, 1)
        for row, column in np.ndindex(SIDE, SIDE):
            around = 0
            for r in (row - 1, row, row + 1):
                for c in (column - 1, column, column + 1):
                    if (r, c) != (row, column):
                        around += 1 if not 0 <= r < SIDE else int(0 <= c < SIDE and first[r, c])
            assert then[row, column] == (around >= 5 or (around > 1 and first[row, column])), (row, column)


def test_a_reference_path_is_free_and_turns_little(some):
    for field in some:
        path = np.array(field.path)
        assert not configuration_space(field.full)[tuple(path.T)].any()
        assert path[0, 1] == 0 and path[-1, 1] == SIDE - 1
        steps = np.diff(path, axis=0)
        assert np.abs(steps).max() == 1
        turns = np.diff(np.unwrap(np.arctan2(*steps.T)))
        assert np.abs(turns).max() < math.pi / 4 + 1e-9
        # every cylinder leaves the robot two cells
        gaps = np.hypot(*(path[:, None] - np.argwhere(field.full)[None]).transpose(2, 0, 1))
        assert gaps.min() >= 3.0


def test_lengths_are_those_of_the_published_worlds(some):
    lengths = [reference_length(field) for field in some]
    assert min(lengths) >= 10.0 and max(lengths) < 14.5 and 10.5 < float(np.mean(lengths)) < 12.0
    assert optimal_time(some[0]) == 0.5 * lengths[0]


def test_a_field_with_a_wall_across_cannot_be_crossed():
    full = np.zeros((SIDE, SIDE), bool)
    full[[0, -1]] = True
    assert len(crossing(full)) == SIDE
    full[:, 15] = True
    assert crossing(full) == []
    full[10:14, 15] = False             # a gap of four cells is too narrow for a square of five
    assert crossing(full) == []
    full[10:15, 15] = False
    assert crossing(full)


def test_difficulty_of_an_empty_field_is_that_of_its_walls():
    full = np.zeros((SIDE, SIDE), bool)
    full[[0, -1]] = True
    blocked = configuration_space(full)
    path = [(14, column) for column in range(SIDE)]
    found = difficulty(blocked, path)
    assert found["distance"] == 12.0 and found["dispersion"] == 0.0 and found["tortuosity"] == 1.0
    full[14, 12] = True                  # one cylinder in the way, left of the path that goes round it
    round_it = crossing(full)
    harder = difficulty(configuration_space(full), round_it)
    assert harder["tortuosity"] > 1.0 and harder["distance"] < 12.0 and harder["dispersion"] > 0.0
    assert harder["visibility"] < found["visibility"] and length_of(round_it) > SIDE - 1


def test_a_world_has_a_cylinder_for_each_full_cell_that_is_seen(some):
    field = some[4]
    outlines = obstacle_outlines(read_world(scene_of(field).world))
    assert len(outlines) == len(cylinders_of(field.full)) and {outline.radius for outline in outlines} == {0.075}
    places = {tuple(np.round(outline.vertices[0], 3)) for outline in outlines}
    wide = np.pad(field.full, 1)
    for row, column in np.argwhere(field.full).tolist():
        enclosed = wide[row:row + 3, column:column + 3].all()
        assert (tuple(np.round(place_of(row, column), 3)) in places) != enclosed
    assert place_of(0, 0) == pytest.approx((-4.575, 5.075)) and CELL == 0.15
    assert min(y for _, y in places) < 0.1


@pytest.mark.parametrize("success, time, expected", [(True, 1.0, 0.25), (True, 20.0, 0.25), (True, 30.0, 1.0 / 6.0),
                                                     (True, 99.0, 0.125), (False, 1.0, 0.0)])
def test_the_score_is_clipped_to_multiples_of_the_optimal_time(success, time, expected):
    assert score(success, time, 5.0) == pytest.approx(expected)


def test_a_summary_has_the_means_of_the_worlds():
    records = [{"name": "a", "scene": scene, "success": good, "outcome": "reached" if good else "collision",
                "time": 10.0, "cpu_ms": 1.0} for scene, good in (("x", True), ("x", True), ("x", True), ("y", False))]
    found = summary("a", records, {"x": 5.0, "y": 5.0})
    assert found["success"] == 0.5 and found["successes"] == 3 and found["collision"] == 1
    assert found["score"][0] == 0.125 and found["later_score"][0] == 0.25 and found["time"][0] == 10.0


def test_the_clock_begins_when_the_robot_moves():
    poses = np.zeros((100, 3))
    poses[:, 1] = np.maximum(0.0, 0.02 * (np.arange(100) - 40))
    assert driving_time(poses) == pytest.approx(0.05 * (99 - 45))


class Straight:
    def decide(self, result):
        return Decision(0.5, 0.0)


def test_a_run_ends_at_the_first_contact(some, monkeypatch):
    full = np.zeros((SIDE, SIDE), bool)
    full[:, 10] = True
    monkeypatch.setattr(runs, "MethodDriver", lambda *_: Straight())
    walled = scene_of(some[0].__class__(0, 0.3, 2, full, some[0].path, {}))
    found = runs.run(command.Job(walled, "mppi", jackal(1.0, 2.0), 100.0, 0))
    assert found["outcome"] == "collision" and not found["success"] and "cylinder" not in found["reason"]
    assert found["path"][-1][1] == pytest.approx(5.075 + 1.5 - 0.075 - 0.229, abs=0.05)


def test_a_run_ends_one_metre_from_the_goal(some, monkeypatch):
    full = np.zeros((SIDE, SIDE), bool)
    monkeypatch.setattr(runs, "MethodDriver", lambda *_: Straight())
    found = runs.run(command.Job(scene_of(some[0].__class__(0, 0.3, 2, full, some[0].path, {})), "mppi",
                                 jackal(1.0, 2.0), 100.0, 0))
    assert found["outcome"] == "reached" and found["path"][-1][1] == pytest.approx(12.0, abs=0.05)
    assert found["time"] == pytest.approx(8.9 / 0.5, abs=0.2)


def test_the_command_runs_each_once_and_continues(tmp_path, capsys):
    out, figures, saved = tmp_path / "barn.html", tmp_path / "barn.json", tmp_path / "worlds"
    words = ["--worlds", "2", "--methods", "mppi", "--seed", "3", "--jobs", "1", "--out", str(out)]
    assert command.main(words + ["--runs", "1", "--save", str(saved)]) == 0
    assert capsys.readouterr().out.count(" of 2 ") == 3
    assert len(obstacle_outlines(read_world(str(saved / "barn_1.world")))) > 100
    assert command.main(words + ["--runs", "1", "--json", str(figures)]) == 0
    told = capsys.readouterr().out
    assert told.count(" of 2 ") == 1                # the table only: nothing was driven again
    found = json.loads(figures.read_text())
    row, = found["methods"]
    assert row["runs"] == 2 and row["successes"] == 2 and row["time"][0] < 15.0, found["runs"]
    text = out.read_text()
    assert text.count("<figure>") == 2 and "http" not in text and "LiCS-KI" in text


def test_move_base_drives_by_laser_and_odometry(some):
    found = runs.run(command.Job(scene_of(some[0]), "move_base", jackal(1.6, 3.0), 6.0, 0))
    assert found["outcome"] == "time out" and 3.5 < found["path"][-1][1] < 6.5, found["reason"]


@pytest.mark.parametrize("given, code, reason", [(["--worlds", "0"], 2, "--worlds 0"),
                                                 (["--methods", "teleport"], 2, "there is no 'teleport'"),
                                                 (["--max-vel-x", "nan"], 2, "--max-vel-x nan"),
                                                 (["--out", "/no/such/place.html"], 1, "there is no such folder")])
def test_a_benchmark_that_cannot_be_run_is_told(capsys, given, code, reason):
    try:
        found = command.main(given)
    except SystemExit as ended:
        found = ended.code
    assert found == code and reason in capsys.readouterr().err

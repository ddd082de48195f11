# SPDX-License-Identifier: BSD-3-Clause
"""The comparison drives, measures and writes what it says."""
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest

from m2wr_navigation.compare import command
from m2wr_navigation.compare.comparison import Comparison
from m2wr_navigation.compare.page import page, thinned
from m2wr_navigation.compare.planned import costmap_of
from m2wr_navigation.costmap.cost_layout import LETHAL
from m2wr_navigation.methods.method import Decision
from m2wr_view.outlines import Outline, point_distances


@pytest.fixture(scope="module")
def made():
    comparison = Comparison("world03", (0.0, 8.0, 0.0), (-7.0, -4.0), limit=100.0)
    return comparison, {entry.name: entry for entry in comparison.entries(
        ["ThetaStar", "tangent_bug", "bug0", "potential_field"])}


def test_a_planned_path_and_a_method_come_near_to_the_optimum(made):
    comparison, entries = made
    for name, most in (("ThetaStar", 1.15), ("tangent_bug", 1.1)):
        entry = entries[name]
        assert entry.success and 1.0 <= entry.ratio < most and entry.contacts == 0, entry
        assert entry.ratio == pytest.approx(entry.length / comparison.optimum.length)
        assert np.hypot(*(entry.path[-1] - (-7.0, -4.0))) < 0.25 and 10.0 < entry.time < 60.0


@pytest.mark.parametrize("linear, angular, outcome, seconds", [
    (0.0, 0.0, "stuck", 10.0), (0.4, 1.0, "stuck", 10.0), (0.3, 0.0, "time out", 15.0)])
def test_a_robot_that_comes_nowhere_ends_its_drive(linear, angular, outcome, seconds):
    comparison = Comparison("world03", (0.0, 8.0, 0.0), (-7.0, -4.0), limit=15.0, patience=10.0)
    entry = comparison.decided("mine", lambda result: Decision(linear, angular), 1)
    assert entry.outcome == outcome and not entry.success
    assert entry.time == pytest.approx(seconds, abs=0.2)
    assert outcome != "stuck" or re.match(r"it moved less than 1 m from \(.*\) in 10 s", entry.reason), entry.reason


def test_the_clearance_is_that_of_the_robots_outline(made):
    comparison, entries = made
    for entry in entries.values():
        axle = min(point_distances(entry.path, outline).min() for outline in comparison.obstacles)
        assert 0.0 < entry.clearance <= axle - 0.19 and entry.cpu_ms > 0.0


def test_a_failure_is_in_the_page_with_its_reason(made):
    comparison, entries = made
    text = page(comparison, list(entries.values()))
    row = re.search(r"<tr class=bad><td>bug0</td>.*?</tr>", text).group()
    assert "3 times" in row and "unreachable" in row
    # those that reached the goal come first
    assert max(text.index("<td>ThetaStar"), text.index("<td>tangent_bug")) < text.index("<td>bug0")
    assert text.count("<figure>") == 4 and text.count("<polygon") > 100 and "http" not in text


def test_names_from_files_cannot_write_html(made):
    comparison, entries = made
    comparison.name, name = "<script>", comparison.name
    text = page(comparison, list(entries.values()))
    comparison.name = name
    assert "<script>" not in text and "&lt;script&gt;" in text


def test_the_command_writes_page_and_figures(tmp_path, capsys, made, monkeypatch):
    comparison, entries = made
    monkeypatch.setattr(command, "Comparison", lambda *given: comparison)
    monkeypatch.setattr(comparison, "entries", lambda names: iter([entries[name] for name in names]))
    out, figures = tmp_path / "page.html", tmp_path / "figures.json"
    assert command.main(["--methods", "tangent_bug,bug0", "--out", str(out), "--json", str(figures)]) == 0
    found = json.loads(figures.read_text())
    assert [entry["name"] for entry in found["entries"]] == ["tangent_bug", "bug0"]
    assert found["entries"][0]["success"] is True and len(found["entries"][0]["path"]) > 100
    assert "tangent_bug" in capsys.readouterr().out and "</html>" in out.read_text()


def test_after_an_interruption_what_was_driven_is_written(tmp_path, monkeypatch, made):
    comparison, entries = made

    def interrupted(names):
        yield entries["bug0"]
        raise KeyboardInterrupt

    monkeypatch.setattr(command, "Comparison", lambda *given: comparison)
    monkeypatch.setattr(comparison, "entries", interrupted)
    out, figures = tmp_path / "page.html", tmp_path / "figures.json"
    assert command.main(["--out", str(out), "--json", str(figures)]) == 130
    assert [entry["name"] for entry in json.loads(figures.read_text())["entries"]] == ["bug0"]
    assert "</html>" in out.read_text()


def test_a_clearance_without_obstacles_is_null_in_json(tmp_path, made):
    entry = replace(made[1]["bug0"], clearance=math.inf)
    assert entry.record()["clearance"] is None
    json.dumps(entry.record(), allow_nan=False)


def test_a_file_that_cannot_be_written_is_told_first(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(command, "Comparison", lambda *given: pytest.fail("it drove"))
    assert command.main(["--out", str(tmp_path / "no" / "page.html")]) == 1
    assert "there is no such folder" in capsys.readouterr().err
    assert command.main(["--out", str(tmp_path / "page.html"), "--json", str(tmp_path)]) == 1
    assert "this is a folder" in capsys.readouterr().err and not list(tmp_path.iterdir())


@pytest.mark.parametrize("given, code, reason", [
    (["--methods", "bug9"], 2, "there is no 'bug9'; known are all, NavfnROS"), (["--start", "nan", "1"], 2, "--start"),
    (["--start", "1"], 2, "--start has 1 numbers"),
    (["--limit", "0"], 2, "expected no negative seed and a positive"),
    (["--max-vel-x", "0"], 2, "expected positive numbers"), (["--robot", "no_such"], 1, "no_such"),
    (["--world", "no_such"], 1, "no_such"),
    (["--goal", "0", "4.73"], 1, "the goal (0.00, 4.73) is 0.00 m from barrier"),
])
def test_what_cannot_be_compared_is_told(tmp_path, capsys, given, code, reason):
    try:
        found = command.main(given + ["--out", str(tmp_path / "page.html")])
    except SystemExit as ended:
        found = ended.code
    assert found == code and reason in capsys.readouterr().err and not (tmp_path / "page.html").exists()


def test_the_true_costmap_has_the_obstacles_of_the_world():
    square = np.array([(-1.0, -1.0), (0.0, -1.0), (0.0, 0.0), (-1.0, 0.0)])
    shapes = [Outline(np.array([(2.0, 1.0)]), 0.5), Outline(square)]
    costmap = costmap_of(shapes, np.array([(0.0, 3.0)]), 0.45)
    rng = np.random.default_rng(0)
    for x, y in rng.uniform(-2.0, 3.5, (400, 2)):
        distance = min(point_distances(np.array([(x, y)]), shape)[0] for shape in shapes)
        if not 0.0 < distance < 0.1:
            assert (costmap.cost_at(x, y) == LETHAL) == (distance == 0.0), (x, y)
    with pytest.raises(ValueError, match="expected at most 200 m a side"):
        costmap_of(shapes, np.array([(300.0, 0.0)]), 0.45)


def test_a_thinned_path_keeps_its_ends_and_its_shape():
    path = np.column_stack([np.linspace(0.0, 1.0, 1001), np.zeros(1001)])
    kept = thinned(path)
    assert kept[0].tolist() == [0.0, 0.0] and kept[-1].tolist() == [1.0, 0.0] and 30 <= len(kept) <= 36

# SPDX-License-Identifier: BSD-3-Clause
"""A comparison in many worlds drives each once, keeps what was driven, and sums it up."""
import json

import pytest

from m2wr_navigation.compare import command, survey
from m2wr_navigation.compare.drive import M2WR_ROBOT
from m2wr_navigation.compare.scenes import Scene, generated
from m2wr_navigation.compare.survey import Job, drive_all, ranked, stored
from m2wr_navigation.compare.survey_page import survey_page


def record(name="bug2", scene="one", **more):
    return dict({"key": name + scene, "name": name, "kind": "method", "scene": scene, "success": True,
                 "outcome": "reached", "contacts": 0, "ratio": 1.5, "time": 20.0, "clearance": 0.2, "cpu_ms": 0.3,
                 "path": [[0.0, 0.0], [1.0, 1.0]]}, **more)


def test_the_command_drives_each_once_and_continues_after_a_stop(tmp_path, capsys):
    out, figures = tmp_path / "page.html", tmp_path / "figures.json"
    words = ["--worlds", "1", "--methods", "ThetaStar,tangent_bug", "--workers", "1", "--out", str(out)]
    assert command.main(words + ["--json", str(figures)]) == 0
    told = capsys.readouterr().out
    assert told.count(" of 2  rooms 0") == 2 and "the drives are kept in" in told
    kept = tmp_path / "page.runs.jsonl"
    whole = kept.read_text()
    first = whole.split("\n")[0]
    kept.write_text(first + '\n{"key": "cut o')           # as if the power had failed
    assert command.main(words) == 0
    assert capsys.readouterr().out.count(" of 2  rooms 0") == 1
    assert len(stored(str(kept))) == 2 and kept.read_text().startswith(first)
    found = json.loads(figures.read_text())
    assert {run["name"] for run in found["runs"]} == {"ThetaStar", "tangent_bug"} and len(found["methods"]) == 2
    text = out.read_text()
    assert text.count("<figure>") == 1 and "http" not in text and "ThetaStar" in text


def test_what_makes_another_drive_has_another_key():
    scene = Scene("a", "world02", (0.0, 8.0, 0.0), (0.0, -4.0))
    keys = {Job(scene, "bug2", M2WR_ROBOT, 600.0, 0).key, Job(scene, "bug1", M2WR_ROBOT, 600.0, 0).key,
            Job(scene, "bug2", M2WR_ROBOT, 500.0, 0).key, Job(scene, "bug2", M2WR_ROBOT, 600.0, 1).key}
    assert len(keys) == 4 and Job(scene, "bug2", M2WR_ROBOT, 600.0, 0).key in keys


def test_a_world_that_was_edited_is_another_one(tmp_path):
    path = tmp_path / "my.world"
    job = Job(Scene("my", str(path), (0.0, 8.0, 0.0), (0.0, -4.0)), "bug2", M2WR_ROBOT, 600.0, 0)
    keys = set()
    for text in ("<sdf/>", "<sdf />"):
        path.write_text(text)
        keys.add(job.key)
    assert len(keys) == 2


def test_figures_are_over_the_successes():
    records = [record(scene="one"), record(scene="two", ratio=2.5), record(scene="three", success=False, contacts=2),
               record("mppi", "one", clearance=None)]
    first, second = ranked(records)
    assert first["name"] == "mppi" and first["clearance"] == [None, None, None] and first["successes"] == 1
    assert second["worlds"] == 3 and second["successes"] == 2 and second["contacts"] == 2
    assert second["ratio"][0] == 2.0 and second["success_interval"] == pytest.approx([0.2077, 0.9385], abs=1e-3)


def test_the_page_names_failures_and_escapes_names():
    scene = next(generated(1, 0, 0.45))
    text = survey_page([scene], [record("<b>", scene.name), record("bug0", scene.name, success=False, outcome="stuck")],
                       M2WR_ROBOT)
    assert "<td><b>" not in text and "&lt;b&gt;" in text and "bug0 (stuck)" in text
    assert text.count("class=way") == 1


def test_a_file_of_something_else_is_refused(tmp_path):
    other = tmp_path / "page.runs.jsonl"
    other.write_text("a poem\nwith lines\n")
    with pytest.raises(ValueError, match="line 1: not JSON; expected a record of a drive"):
        stored(str(other))
    assert other.read_text().startswith("a poem")
    assert stored(str(tmp_path / "none")) == {}


def test_known_drives_need_no_process(tmp_path, monkeypatch):
    scene = Scene("a", "world02", (0.0, 8.0, 0.0), (0.0, -4.0))
    job, path = Job(scene, "bug2", M2WR_ROBOT, 600.0, 0), tmp_path / "runs.jsonl"
    path.write_text(json.dumps(record(key=job.key)) + "\n")
    monkeypatch.setattr(survey, "run", lambda job: pytest.fail("it drove"))
    assert [(found["key"], is_new) for found, is_new in drive_all([job], str(path), 1)] == [(job.key, False)]


@pytest.mark.parametrize("given, code, reason", [(["--worlds", "0"], 1, "from 1 to 1000"),
                                                 (["--worlds", "1", "--workers", "0"], 2, "--workers 0"),
                                                 (["--start", "0,8"], 2, "'0,8'; expected a finite number"),
                                                 (["--limit", "nan"], 2, "'nan'; expected a finite number"),
                                                 (["--worlds", "no_such"], 1, "no_such")])
def test_a_survey_that_cannot_be_made_is_told(tmp_path, capsys, given, code, reason):
    try:
        found = command.main(given + ["--out", str(tmp_path / "page.html")])
    except SystemExit as ended:
        found = ended.code
    assert found == code and reason in capsys.readouterr().err

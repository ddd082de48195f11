# SPDX-License-Identifier: BSD-3-Clause
"""The command ``speed`` takes runs from all of a study, and tells apart what a run's time is spent on."""
import pytest

from m2wr_campaign.runner import speed

STUDY = "study: one\nlimit: 3\nrepeats: 4\nworlds: [{file: world02, start: [0, 8], goal: [0, 7]}, " \
    "{file: world02, start: [0, 8], goal: [0, 6.5]}]\nmethods: [bug0, NavfnROS]\n"

TRIES = 3


@pytest.fixture
def study(tmp_path):
    path = tmp_path / "one.yaml"
    path.write_text(STUDY)
    return str(path)


def test_some_runs_are_spread_over_the_study(study):
    tasks = speed.tasks_of(study, 4)
    assert len(tasks) == 4 and len({task.world.key for task in tasks}) == 2
    assert len({task.number for task in tasks}) == 4
    assert len(speed.tasks_of(study, 100)) == 16


def test_a_run_takes_longer_than_its_parts(study):
    tasks = speed.tasks_of(study, 16)
    speed.share_of(tasks[0])
    for task in (tasks[0], tasks[1]):
        shares = [speed.share_of(task) for _ in range(TRIES)]
        whole = max(share.whole for share in shares)        # measured apart, so other programs may slow one of them
        assert min(share.method for share in shares) > 0.0
        assert 0.0 < min(share.simulation for share in shares) < whole
        assert 0.0 < min(speed.start_of(task) for _ in range(TRIES)) < whole


def test_the_report_has_all_three_tables(study):
    tasks = speed.tasks_of(study, 2)
    text = "\n".join(speed.report(tasks, 2, lambda task: speed.Share(1.2, 0.5, 0.5)))
    assert "| simulation | 1.00 | 50.0 % |" in text and "| all else | 0.40 | 20.0 % |" in text
    assert "| together | 2.40 | 3000 runs in an hour |" in text
    assert "processor time of 2 runs in 2 worlds" in text
    assert "\n| 1 | " in text and "\n| 2 | " in text and "100 % |" in text


@pytest.mark.parametrize("words, text", [
    (["--runs", "0"], "expected from 1 to 100000"), (["--workers", "0"], "expected from 1 to 1024")])
def test_numbers_out_of_range_are_refused(study, capsys, words, text):
    with pytest.raises(SystemExit):
        speed.main([study] + words)
    assert text in capsys.readouterr().err


def test_a_study_with_ros_programs_is_refused(tmp_path, capsys):
    (tmp_path / "bug.py").write_text("#!/usr/bin/env python3\n")
    path = tmp_path / "one.yaml"
    path.write_text(STUDY.replace("NavfnROS", "{launch: bug.py, name: mine}"))
    assert speed.main([str(path)]) == 1
    error = capsys.readouterr().err
    assert "mine is a ROS program" in error and error.count("\n") == 1


def test_a_missing_study_is_told(capsys):
    assert speed.main(["missing.yaml"]) == 1
    assert "speed: missing.yaml: No such file" in capsys.readouterr().err

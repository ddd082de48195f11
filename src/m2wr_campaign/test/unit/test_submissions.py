# SPDX-License-Identifier: BSD-3-Clause
"""The program of each submission is found, and one without a program has a reason."""
import pytest

from m2wr_campaign.grading.submissions import SubmissionsError, submissions


def made(folder, *paths):
    for path in paths:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text("")
    return {method.name: method.program for method in submissions(str(folder))}


def test_each_submission_has_its_program(tmp_path):
    found = made(tmp_path, "ann/launch/other.launch", "ann/scripts/bug2.py", "bob/scripts/bug2.py", "bob/scripts/a.py",
                 "eve/go.py", "eve/setup.py", "zoe/launch/bug2.launch", "zoe/launch/a.launch", ".git/x.py")
    assert {name: program.path[len(str(tmp_path)):] for name, program in found.items()} == {
        "ann": "/ann/launch/other.launch", "bob": "/bob/scripts/bug2.py", "eve": "/eve/go.py",
        "zoe": "/zoe/launch/bug2.launch"}
    assert not any(program.problem for program in found.values())


def test_a_submission_without_one_program_has_a_reason(tmp_path):
    found = made(tmp_path, "ann/a.launch", "ann/b.launch", "bob/readme.txt")
    assert found["ann"].problem == "there are 2 of launch file: a.launch, b.launch; expected one, or its name with " \
        "--program"
    assert found["bob"].problem == "there is no launch file and no script"


def test_a_name_may_be_given(tmp_path):
    made(tmp_path, "ann/a.launch", "ann/b.launch", "bob/c.launch")
    ann, bob = submissions(str(tmp_path), "b.launch")
    assert ann.program.path.endswith("ann/b.launch") and bob.program.problem == "there is no b.launch"


def test_links_are_not_followed(tmp_path):
    (tmp_path / "secret.py").write_text("")
    (tmp_path / "all" / "ann").mkdir(parents=True)
    (tmp_path / "all" / "ann" / "bug2.py").symlink_to(tmp_path / "secret.py")
    assert submissions(str(tmp_path / "all"))[0].program.problem


def test_a_folder_without_submissions_is_told(tmp_path):
    with pytest.raises(SubmissionsError, match="no folders"):
        submissions(str(tmp_path))
    with pytest.raises(SubmissionsError, match="no such folder"):
        submissions(str(tmp_path / "none"))

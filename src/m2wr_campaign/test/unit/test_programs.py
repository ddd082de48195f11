# SPDX-License-Identifier: BSD-3-Clause
"""A program under test is named by its file, and is another one when a file of its package changes."""
import pytest

from m2wr_campaign.study import programs
from m2wr_campaign.study.expansion import all_tasks
from m2wr_campaign.study.fields import StudyError
from m2wr_campaign.study.study_file import read_study

STUDY = "study: one\nworlds: [{{file: world02, start: [0, 8], goal: [0, 7]}}]\nmethods: [bug0, {}]\n"


@pytest.fixture
def package(tmp_path):
    (tmp_path / "mine" / "launch").mkdir(parents=True)
    (tmp_path / "mine" / "package.xml").write_text("<package><name>mine</name></package>")
    (tmp_path / "mine" / "launch" / "bug2.launch").write_text("<launch/>")
    return tmp_path / "mine"


def tasks(folder, entry):
    (folder / "s.yaml").write_text(STUDY.format(entry))
    return all_tasks(read_study(str(folder / "s.yaml")))


def test_a_launch_file_is_a_method_with_the_name_of_its_package(package, tmp_path):
    method = tasks(tmp_path, "{launch: mine/launch/bug2.launch}")[1].method
    assert method.name == "mine" and method.program.folder == str(package)


def test_lists_of_arguments_are_factors(package, tmp_path):
    found = tasks(tmp_path, "{launch: mine/launch/bug2.launch, name: other, "
                            "arguments: {speed: [0.2, 0.4], fast: true}}")
    assert [task.method.program.arguments for task in found[1:]] == [
        (("fast", "true"), ("speed", "0.2")), (("fast", "true"), ("speed", "0.4"))]
    assert len({task.key for task in found}) == 3


def test_a_changed_package_is_run_again(package, tmp_path):
    before = tasks(tmp_path, "{launch: mine/launch/bug2.launch}")
    (package / "readme.txt").write_text("new")
    after = tasks(tmp_path, "{launch: mine/launch/bug2.launch}")
    assert before[0].key == after[0].key and before[1].key != after[1].key


@pytest.mark.parametrize("entry, told", [
    ("{launch: mine/launch/no.launch}", "launch: read 'mine/launch/no.launch'; expected "),
    ("{launch: mine/launch/bug2.launch, name: dwa}", "a name that no planner or method of this workspace has"),
    ("{launch: mine/launch/bug2.launch, arguments: {speed: [[1]]}}", "texts, numbers, true or false"),
    ("{launch: mine/launch/bug2.launch, speed: 1}", "speed is not known"),
])
def test_what_cannot_be_run_is_told(package, tmp_path, entry, told):
    with pytest.raises(StudyError) as error:
        tasks(tmp_path, entry)
    assert told in str(error.value)


def test_a_package_has_limits(package, monkeypatch):
    monkeypatch.setattr(programs, "MOST_BYTES", 10)
    with pytest.raises(programs.ProgramError, match="expected a package"):
        programs.digest_of(str(package))

# SPDX-License-Identifier: BSD-3-Clause
"""A study file is read strictly: what is wrong is told with file, key, what was read and what was expected."""
import pytest

from m2wr_campaign.study.fields import LARGEST_FILE, StudyError
from m2wr_campaign.study.study_file import AS_DESCRIBED, read_study

WHOLE = """
study: one
worlds: [{generator: barn, count: 3, parameters: {fill: [0.1, 0.2], rounds: 2}}, {file: world02}]
methods: [bug2, {name: dwa, parameters: {max_vel_x: [0.3, 0.5], sim_time: 1.5}}]
repeats: 5
"""


def read(tmp_path, text):
    path = tmp_path / "s.yaml"
    path.write_text(text)
    return read_study(str(path))


def test_lists_of_values_become_combinations(tmp_path):
    study = read(tmp_path, WHOLE)
    assert [method.label for method in study.methods] == [
        "bug2", "dwa max_vel_x=0.3 sim_time=1.5", "dwa max_vel_x=0.5 sim_time=1.5"]
    assert [(entry.kind, entry.count) for entry in study.worlds] == [("barn", 3), ("barn", 3), ("file", 1)]
    assert [entry.parameters["fill"] for entry in study.worlds[:2]] == [0.1, 0.2]
    assert study.worlds[0].parameters == {"fill": 0.1, "rounds": 2, "cell": 0.0}
    assert study.noise == (AS_DESCRIBED,) and study.robots[0].file == "m2wr" and study.count == 7 * 3 * 5


@pytest.mark.parametrize("before, after, told", [
    ("study: one", "", "s.yaml: study is missing; expected a text"),
    ("repeats: 5", "repeats: five", "s.yaml: repeats: read 'five'; expected a whole number from 1 to 10000"),
    ("repeats: 5", "repeats: 0", "s.yaml: repeats: read 0; expected a whole number from 1 to 10000"),
    ("repeats: 5", "patience: .inf", "s.yaml: patience: read inf; expected a number from 1 to 100000 s"),
    ("repeats: 5", "repeat: 5", "s.yaml: repeat is not known, did you mean repeats?; known are"),
    ("count: 3", "count: true", "s.yaml: worlds[0].count: read True; expected a whole number"),
    ("fill: [0.1, 0.2]", "fill: 0.9", "s.yaml: worlds[0].parameters.fill: read 0.9; expected a number from 0 to 0.5"),
    ("rounds: 2", "rounds: 2.5", "s.yaml: worlds[0].parameters.rounds: read 2.5; expected a whole number"),
    ("rounds: 2", "round: 2", "s.yaml: worlds[0].parameters.round is not known; known are cell, fill, rounds"),
    ("generator: barn", "generator: bern", "read 'bern'; expected one of barn, maze, office, pillars, rooms; did you"),
    ("bug2,", "bug9,", "s.yaml: methods[0].name: read 'bug9'; expected one of NavfnROS"),
    ("bug2,", "bug2, bug2,", "s.yaml: methods: read 'bug2'; expected each method once"),
    ("sim_time: 1.5", "sim_time: .nan", "s.yaml: methods[1].parameters.sim_time: read nan; expected a number"),
    ("{file: world02}", "{file: world02, start: [0, 1]}", "worlds[1].goal: read None; expected both start and goal"),
    ("repeats: 5", "noise: [2]", "s.yaml: noise: read 2; expected numbers from 0 to 1 m"),
    ("repeats: 5", "repeats: 5\nrepeats: 6", "s.yaml: line 6: the key 'repeats' occurs twice; expected YAML"),
    ("repeats: 5", "seed: &a 1\nrepeats: *a", "an alias; expected values without aliases"),
    ("repeats: 5", "seed: !!python/object:os.system 1", "could not determine a constructor"),
    pytest.param("repeats: 5", "robots: " + "[" * 2000, "more than 20 lists and mappings in one another", id="deep"),
])
def test_what_cannot_be_used_is_told(tmp_path, before, after, told):
    with pytest.raises(StudyError) as error:
        read(tmp_path, WHOLE.replace(before, after))
    assert told in str(error.value) and "\n" not in str(error.value)


def test_a_python_program_gives_the_same_study(tmp_path):
    path = tmp_path / "s.py"
    path.write_text("import numpy as np\nSTUDY = dict(study='one', repeats=5, methods=('bug2', dict(name='dwa', "
                    "parameters=dict(max_vel_x=np.linspace(0.3, 0.5, 2), sim_time=1.5))), "
                    "worlds=[dict(generator='barn', count=3, parameters=dict(fill=[0.1, 0.2], rounds=np.int64(2))), "
                    "dict(file='world02')])\n")
    made, written = read_study(str(path)), read(tmp_path, WHOLE)
    assert made.methods == written.methods and made.worlds == written.worlds and made.count == written.count


@pytest.mark.parametrize("text, told", [
    ("STUDIES = {}", "s.py: it sets no STUDY; expected a mapping of that name"),
    ("\nSTUDY = {'study': nme}", "s.py: line 2: NameError: name 'nme' is not defined; expected a program"),
    ("STUDY = {", "s.py: line 1: SyntaxError: "),
    ("raise SystemExit(3)", "s.py: line 1: SystemExit: 3"),
    ("STUDY = 5", "s.py: read 5; expected a mapping with names as keys"),
    ("a = []\na.append(a)\nSTUDY = {'worlds': a}", "s.py: more than 20 lists and mappings in one another"),
])
def test_a_python_program_without_a_study_is_told(tmp_path, text, told):
    path = tmp_path / "s.py"
    path.write_text(text)
    with pytest.raises(StudyError) as error:
        read_study(str(path))
    assert told in str(error.value)


def test_too_many_runs_are_refused(tmp_path):
    with pytest.raises(StudyError, match="runs; expected at most 1000000"):
        read(tmp_path, WHOLE.replace("count: 3", "count: 10000").replace("repeats: 5", "repeats: 10000"))


@pytest.mark.parametrize("data, told", [(b"a poem", "read 'a poem'; expected a mapping"), (b"", "read None"),
                                        (b"\xff\xfe\xff", "expected YAML"), (b"{1: 2}", "names as keys"),
                                        pytest.param(b"#" * (LARGEST_FILE + 1), "more than 1000000 bytes", id="large")])
def test_a_file_of_something_else_is_refused(tmp_path, data, told):
    (tmp_path / "s.yaml").write_bytes(data)
    with pytest.raises(StudyError, match=told):
        read_study(str(tmp_path / "s.yaml"))


def test_a_file_that_is_not_there_is_told(tmp_path):
    with pytest.raises(StudyError, match="No such file or directory; expected a readable file"):
        read_study(str(tmp_path / "none.yaml"))

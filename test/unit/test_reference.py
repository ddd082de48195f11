# SPDX-License-Identifier: BSD-3-Clause
"""The reference agrees with the code and covers all launch files and programs."""
import os
import subprocess
import sys

import pytest

import workspace_tree as tree

sys.path.insert(0, os.path.join(tree.ROOT, "tools"))
import reference  # noqa: E402


def test_the_reference_is_up_to_date():
    done = subprocess.run(["/usr/bin/python3", os.path.join(tree.ROOT, "tools", "reference.py"), "--check"],
                          stdout=subprocess.PIPE, stderr=subprocess.STDOUT, universal_newlines=True)
    assert done.returncode == 0, done.stdout


def test_the_graph_holds_the_nodes_that_are_started():
    with open(reference.GRAPH, encoding="utf-8") as stream:
        graph = reference.yaml.safe_load(stream)
    assert set(graph) == reference.expected_nodes()
    assert graph["bug2"]["publishes"]["/bug2/state"] == "std_msgs/String"
    assert graph["gazebo"]["serves"]["/gazebo/spawn_urdf_model"] == "gazebo_msgs/SpawnModel"


def test_every_argument_of_a_launch_file_is_documented():
    for name, folder in reference.packages():
        for file, comment, arguments in reference.launch_files(folder):
            assert comment, "%s %s: no comment says what it does" % (name, file)
            for argument, _, meaning in arguments:
                assert meaning, "%s %s: argument %s has no doc" % (name, file, argument)


def test_every_program_has_a_docstring():
    for name, folder in reference.packages():
        for _, program, what in reference.programs(name, folder):
            assert what, "%s %s: no docstring" % (name, program)


def test_a_changed_default_is_found(tmp_path):
    launch = tmp_path / "launch"
    launch.mkdir()
    (launch / "a.launch").write_text('<!-- Does a. -->\n<launch>'
                                     '<arg name="x" default="$(find b)/c" doc="where | what"/>'
                                     '<arg name="y" doc="must"/><arg name="z" value="1"/></launch>')
    (file, comment, arguments), = reference.launch_files(str(tmp_path))
    assert (file, comment) == ("a.launch", "Does a")
    assert [(name, reference.readable_default(default), reference.cell(doc)) for name, default, doc in arguments] == [
        ("x", "`b/c`", "where \\| what"), ("y", "required", "must")]


def test_meanings_are_found_in_a_page_of_docs_too(tmp_path):
    (tmp_path / "a" / "src").mkdir(parents=True)
    (tmp_path / "a" / "src" / "a.py").write_text("rospy.get_param('~x', 3)")
    (tmp_path / "a.md").write_text("| `~x` | 3 | how far |\n")
    assert reference.read_parameters(str(tmp_path / "a"), str(tmp_path)) == [("~x", 3, "how far")]


@pytest.mark.parametrize("source, rows", [
    ("rospy.get_param('~x', 3)", [("~x", 3, "how far")]), ("rospy.get_param('goal')", [("goal", "required", "")]),
    ("_DEFAULTS = {'x': 1.5}", [("~x", 1.5, "how far")]),
    ("rospy.get_param(name, 1)", []), ("rospy.get_param('~', {})", [])])
def test_parameters_are_found_by_their_literal_names(tmp_path, source, rows):
    (tmp_path / "src").mkdir()
    (tmp_path / "src" / "a.py").write_text(source)
    (tmp_path / "README.md").write_text("| `~x` | 3 | how far |\n")
    assert reference.read_parameters(str(tmp_path)) == rows

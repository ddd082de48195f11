# SPDX-License-Identifier: BSD-3-Clause
"""How documents are read: blocks, the comments before them, and the commands in them."""
import os
import sys

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "nodes"))
import doc_commands  # noqa: E402
import workspace_tree as tree  # noqa: E402
from doc_blocks import DocumentError, blocks_of  # noqa: E402


def only(text):
    block, = blocks_of(text, "a.md")
    return block


def test_a_block_has_its_place_language_and_text():
    block = only("Words.\n\n```bash\nls   # all\n\nls b\n```\nmore\n")
    assert (block.place, block.language, block.text, block.how) == ("a.md:3", "bash", "ls   # all\n\nls b\n", None)
    assert block.runs


def test_only_shell_runs_without_a_comment():
    assert not only("```xml\n<a/>\n```\n").runs
    assert only("<!-- run: to the end -->\n```python\npass\n```\n").runs


def test_the_words_of_a_comment_are_read():
    how = only(
        '<!-- run: alone; background until "/odom"; expect "a"; expect "b"; at most 90 s -->\n```bash\nls\n```\n').how
    assert (how.alone, how.background, how.until, how.expect, how.limit, how.code) == (
        True, True, "/odom", ["a", "b"], 90, 0)


def test_a_block_that_is_only_checked_gives_its_reason():
    block = only("<!-- run: only checked: needs a display -->\n```bash\nls\n```\n")
    assert block.how.checked == "needs a display" and not block.runs


def test_a_file_is_written_and_not_run():
    block = only("<!-- run: file my_robot.xacro -->\n```xml\n<robot/>\n```\n")
    assert block.how.file == "my_robot.xacro" and not block.runs


@pytest.mark.parametrize("text, words", [
    ("<!-- run: sometimes -->\n```bash\nls\n```\n", ["a.md:1", "sometimes"]),
    ("<!-- run: to the end -->\n\n```bash\nls\n```\n", ["a.md:1", "not followed by a block"]),
    ("<!-- run: to the end -->\n", ["a.md:1", "not followed by a block"]),
    ("<!-- run to the end -->\n```bash\nls\n```\n", ["a.md:1", "expected <!-- run: HOW -->"]),
    ('<!-- run: keys "i" -->\n```bash\nls\n```\n', ["a.md:1", "add an until"]),
    ("```\nls\n```\n", ["a.md:1", "names no language"]),
    ("a\n```bash\nls\n", ["a.md:2", "is not closed"]),
    ("```bash title\nls\n```\n", ["a.md:1", "expected ```"]),
])
def test_unknown_words_are_named_with_their_line(text, words):
    with pytest.raises(DocumentError) as caught:
        blocks_of(text, "a.md")
    for word in words:
        assert word in str(caught.value)


def test_commands_are_split_into_words():
    text = "A=1 rosrun a b --c 'd e' \\\n  f   # more\nls | wc > out.txt && echo \"x;y\"\n"
    assert doc_commands.commands_of(text) == [
        ["rosrun", "a", "b", "--c", "d e", "f"], ["ls"], ["wc"], ["echo", "x;y"]]


@pytest.mark.parametrize("command, words", [
    ("roslaunch no_such_package bug2.launch", ["no_such_package", "no launch file"]),
    ("roslaunch m2wr_sim no_such.launch", ["no_such.launch"]),
    ("roslaunch m2wr_sim bug2.launch sped:=3", ["no argument sped", "seed"]),
    ("roslaunch motion_plan behaviors.launch", ["needs the argument des_x"]),
    ("rosrun m2wr_sim no_such_tool", ["m2wr_sim", "no program no_such_tool"]),
    ("rosrun no_such_package tool", ["no package no_such_package"]),
    ("rosrun m2wr_sim bag_report --no-such-option run.bag", ["no program has the option --no-such-option"]),
    ("rosrun m2wr_sim experiment --port 5 m2wr_sim bug2.launch sped:=3", ["no argument sped"]),
    ("make no-such-target", ["no target no-such-target"]),
    ("source devel/no_such.bash", ["no file devel/no_such.bash"]),
    ("no_such_program -x", ["no program no_such_program"]),
    ("python3 -m no_such_module", ["no Python module no_such_module"]),
])
def test_what_does_not_exist_is_found(command, words):
    problem, = doc_commands.problems_of("ls\n" + command + "\n", tree.ROOT)
    for word in words:
        assert word in problem


def test_a_launch_line_is_loaded_with_its_arguments():
    text = "ls\nrosrun m2wr_sim experiment --port 5 motion_plan bug2.launch des_x:=3\n"
    (path, arguments), = doc_commands.launches_of(text)
    assert os.path.basename(path) == "bug2.launch" and arguments == ("des_x:=3",)
    assert doc_commands.loading_problem(path, arguments) is None
    assert "far" in doc_commands.loading_problem(path, ("des_x:=far",))


@pytest.mark.parametrize("command", [
    "roslaunch m2wr_sim bug2.launch world:=world03 gui:=false",
    "roslaunch motion_plan behaviors.launch des_x:=1 des_y:=2",
    "roslaunch motion_plan behaviors.launch --ros-args", "roslaunch my.launch anything:=1",
    "rosrun m2wr_sim bag_report run.bag", "make help DEMO_ARGS='--seed 3'", "python3 -m m2wr_sim.warm_up",
    "rosrun m2wr_sim experiment --port 5 m2wr_sim bug2.launch seed:=3", "sudo make setup", "ls $(pwd) > a; echo b",
])
def test_what_exists_passes(command):
    assert doc_commands.problems_of(command, tree.ROOT) == []

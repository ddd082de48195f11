# SPDX-License-Identifier: BSD-3-Clause
"""Blocks are run as a reader runs them: in order, in one folder, each until the condition of its comment holds."""
import os
import sys

import pytest

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "nodes"))
from doc_blocks import blocks_of  # noqa: E402
from doc_terminals import run_document  # noqa: E402


def run(text, folder, keep=None):
    environment = dict(os.environ, ROS_MASTER_URI="http://127.0.0.1:9")
    return run_document(blocks_of(text, "a.md"), str(folder), environment, keep)


def test_commands_share_a_folder_and_run_in_order(tmp_path):
    text = ("<!-- run: file b.txt -->\n```text\nhello\n```\n```bash\ncat b.txt > c.txt\n```\n"
            '<!-- run: expect "hello" -->\n```bash\ncat c.txt\n```\n')
    assert [place for place, _ in run(text, tmp_path)] == ["a.md:5", "a.md:9"]


@pytest.mark.parametrize("text, words", [
    ("```bash\necho before; false; echo after\n```\n", ["a.md:1", "ended with code 1, expected 0", "before\n"]),
    ("<!-- run: code 3 -->\n```bash\nexit 2\n```\n", ["a.md:2", "ended with code 2, expected 3"]),
    ('<!-- run: expect "x" -->\n```bash\necho y\n```\n', ['"x" was expected', "y"]),
    ('<!-- run: until "never" -->\n```bash\necho y\n```\n', ['before "never"']),
    ('<!-- run: at most 1 s -->\n```bash\nsleep 30\n```\n', ["did not end within 1 s"]),
    ('<!-- run: picture a*.png as b.png -->\n```bash\ntrue\n```\n', ["a.md:2", "made no a*.png"]),
])
def test_a_failure_is_reported_with_the_output(tmp_path, text, words):
    with pytest.raises(AssertionError) as caught:
        run(text, tmp_path)
    for word in words:
        assert word in str(caught.value)


def test_a_block_in_the_background_ends_with_the_document(tmp_path):
    text = ("<!-- run: background until \"ready\" -->\n```bash\ntrap 'echo bye > end.txt; exit' INT\necho ready\n"
            "while true; do sleep 0.1; done\n```\n```bash\ntest ! -e end.txt\n```\n")
    run(text, tmp_path)
    assert (tmp_path / "end.txt").read_text() == "bye\n"


def test_alone_ends_the_running_blocks(tmp_path):
    text = ("<!-- run: background until \"ready\" -->\n```bash\ntrap 'echo > end.txt; exit' INT\necho ready\n"
            "while true; do sleep 0.1; done\n```\n<!-- run: alone -->\n```bash\ntest -e end.txt\n```\n")
    run(text, tmp_path)


def test_until_presses_ctrl_c(tmp_path):
    """The block gets SIGINT, once and after the text, and may end by itself; SIGKILL would leave no file."""
    run('<!-- run: until "one" -->\n```bash\ntrap \'echo interrupted >> end.txt; exit\' INT\nsleep 0.3\n'
        'test ! -e end.txt\necho > before.txt\necho one\nwhile true; do sleep 0.1; done\n```\n', tmp_path)
    assert (tmp_path / "before.txt").exists() and (tmp_path / "end.txt").read_text() == "interrupted\n"


def test_keys_reach_a_terminal(tmp_path):
    run('<!-- run: until "name"; keys "me\\n"; expect "hello me" -->\n```bash\necho "your name?"\nread name\n'
        'test -t 0\necho "hello $name"\n```\n', tmp_path)


def test_pictures_are_kept_and_later_blocks_are_skipped(tmp_path):
    text = ("<!-- run: only for the gallery; picture a*.png as b.png -->\n```bash\necho > a1.png; echo > a2.png\n```\n"
            "```bash\necho > later\n```\n")
    kept = {}
    run(text, tmp_path, kept.__setitem__)
    assert os.path.basename(kept["b.png"]) == "a2.png" and not (tmp_path / "later").exists()
    os.remove(str(tmp_path / "a1.png"))
    run(text, tmp_path)
    assert (tmp_path / "later").exists() and not (tmp_path / "a1.png").exists()


def test_only_checked_blocks_do_not_run(tmp_path):
    assert run("<!-- run: only checked: it would -->\n```bash\necho > x\n```\n", tmp_path) == []
    assert not (tmp_path / "x").exists()


def test_until_a_file_is_there(tmp_path):
    run('<!-- run: until "file made.*" -->\n```bash\nsleep 0.2; exec sh -c "echo > made.txt; exec sleep 60"\n```\n',
        tmp_path)
    with pytest.raises(AssertionError):
        run('<!-- run: at most 1 s; until "file never.*" -->\n```bash\nsleep 60\n```\n', tmp_path)

# SPDX-License-Identifier: BSD-3-Clause
"""tools/hooks/commit-msg: which commit messages it accepts."""
import os
import subprocess

import pytest

import workspace_tree as tree

HOOK = os.path.join(tree.ROOT, "tools", "hooks", "commit-msg")


def judge(tmp_path, message):
    """Return (exit code, output of the hook) for a message."""
    file = tmp_path / "COMMIT_EDITMSG"
    file.write_text(message, encoding="utf-8")
    result = subprocess.run([HOOK, str(file)], stderr=subprocess.PIPE, universal_newlines=True, timeout=20,
                            env=dict(os.environ, LC_ALL="C.UTF-8"))
    return result.returncode, result.stderr


@pytest.mark.parametrize("message", [
    "[m2wr_sim] laser: clip returns", "a" * 72, "subject\n\nbody that may be as long as it likes " + "b" * 100,
    "subject\n# a comment of git\n\nbody\n"])
def test_good_messages_are_accepted(tmp_path, message):
    assert judge(tmp_path, message) == (0, "")


@pytest.mark.parametrize("message, words", [
    ("a" * 73, "73 characters; expected at most 72"), ("", "empty"), ("# only a comment", "empty"),
    ("laser: clip returns.", "full stop"), ("subject\nbody", "expected an empty line")])
def test_other_messages_are_refused_with_the_reason(tmp_path, message, words):
    code, said = judge(tmp_path, message)
    assert code == 1 and words in said

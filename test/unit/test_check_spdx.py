# SPDX-License-Identifier: BSD-3-Clause
"""tools/check_spdx.py: where the licence line is expected, and that it is added only once."""
import os
import subprocess
import sys

import pytest

import workspace_tree as tree

TOOL = os.path.join(tree.ROOT, "tools", "check_spdx.py")
LINE = "# SPDX-License-Identifier: BSD-3-Clause\n"


def run(*words):
    """Return (exit code, what is printed on standard error)."""
    done = subprocess.run([sys.executable, TOOL] + [str(word) for word in words], stderr=subprocess.PIPE,
                          universal_newlines=True, timeout=60)
    return done.returncode, done.stderr


def test_licence_named_is_that_of_the_workspace():
    assert tree.read(os.path.join(tree.ROOT, "LICENSE")).startswith("BSD 3-Clause License")


@pytest.mark.parametrize("text, line", [("import os\n", 1), ("#!/bin/sh\nexit\n", 2), ("#!/bin/sh\n\n" + LINE, 2),
                                        ('"""Docstring."""\n' + LINE, 1)])
def test_missing_line_is_reported(tmp_path, text, line):
    file = tmp_path / "file"
    file.write_text(text)
    code, said = run(file)
    assert code == 1 and "in line %d" % line in said


@pytest.mark.parametrize("text", ["", LINE, LINE + "import os\n", "#!/bin/sh\n" + LINE])
def test_right_file_passes_and_stays(tmp_path, text):
    file = tmp_path / "file"
    file.write_text(text)
    assert run(file) == (0, "") and run("--add", file) == (0, "")
    assert file.read_text() == text


@pytest.mark.parametrize("text, expected", [
    ("import os\n", LINE + "import os\n"), ("#!/bin/sh\nexit\n", "#!/bin/sh\n" + LINE + "exit\n")])
def test_line_is_added_once(tmp_path, text, expected):
    file = tmp_path / "file"
    file.write_text(text)
    for _ in range(2):
        assert run("--add", file) == (0, "")
        assert file.read_text() == expected

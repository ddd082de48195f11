# SPDX-License-Identifier: BSD-3-Clause
"""Programs whose output is no longer read."""
import os
import subprocess
import sys

import pytest

PROGRAM = """
import sys
from m2wr_node.pipes import ignore_closed_pipes
ignore_closed_pipes(%s)
for number in range(20000):
    print("a line of words", number%s)
print("and another", file=sys.stderr)
open(sys.argv[1], "w").write("done")
sys.exit(3)
"""


def run_unread(tmp_path, then="None", more="", options=(), stderr=subprocess.PIPE):
    """Run a program whose output is closed after a line; returns its first line, its exit code, what it said."""
    words = list(options) + ["-c", PROGRAM % (then, more), str(tmp_path / "mark")]
    running = subprocess.Popen([sys.executable] + words, stdout=subprocess.PIPE, stderr=stderr)
    first = running.stdout.readline()
    running.stdout.close()
    said = running.stderr.read() if running.stderr else b""
    return first, running.wait(60), said


@pytest.mark.parametrize("options", [(), ("-u",)])
@pytest.mark.parametrize("more", ["", ", flush=True"])
def test_the_work_is_done_and_nothing_is_said(tmp_path, options, more):
    first, code, said = run_unread(tmp_path, more=more, options=options)
    assert first == b"a line of words 0\n" and code == 3 and said == b"and another\n"
    assert (tmp_path / "mark").read_text() == "done"


def test_errors_go_the_same_way(tmp_path):
    assert run_unread(tmp_path, stderr=subprocess.STDOUT)[1] == 3 and (tmp_path / "mark").exists()


def test_what_only_prints_may_end_at_once(tmp_path):
    _, code, said = run_unread(tmp_path, then="sys.exit")
    assert code == 0 and said == b"" and not (tmp_path / "mark").exists()


def test_a_reader_gets_everything_in_its_encoding(tmp_path):
    environment = dict(os.environ, PYTHONIOENCODING="latin-1:replace")
    text = "from m2wr_node.pipes import ignore_closed_pipes\nignore_closed_pipes()\nprint('\\u00e9 \\u20ac', end='')"
    assert subprocess.check_output([sys.executable, "-c", text], env=environment) == b"\xe9 ?"


def test_without_any_output_nothing_happens():
    text = ("import sys\nsys.stdout = None\n"
            "from m2wr_node.pipes import ignore_closed_pipes\nignore_closed_pipes()\nprint('x')")
    assert subprocess.call([sys.executable, "-c", text]) == 0

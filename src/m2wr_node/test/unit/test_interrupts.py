# SPDX-License-Identifier: BSD-3-Clause
"""Programs that are interrupted while they are imported, and after that."""
import signal
import subprocess
import sys

import pytest

PROGRAM = """
import %s
import signal, sys, time


def main(what):
    try:
        print("deep in", what, flush=True)
        time.sleep(60)
    except KeyboardInterrupt:
        if what == "codes":
            return 7
        raise
    finally:
        print("cleared away")
    return 0


class Imported:             # whose finaliser is where Ctrl-C comes: Python ignores exceptions there
    def __del__(self):
        main("finalisers")


if sys.argv[1] == "finalisers":
    Imported()
    print("continued after Ctrl-C")
    sys.exit(0)
if sys.argv[1] == "imports":
    main("imports")
sys.exit(m2wr_node.interrupts.interruptible(main, sys.argv[1]))
"""


def run_interrupted(word, first="m2wr_node.interrupts", ignored=False):
    """Run the program, interrupt it as soon as it is in the midst of it; returns its exit code and what it said."""
    program = subprocess.Popen(
        [sys.executable, "-c", PROGRAM % first, word], stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        universal_newlines=True, preexec_fn=lambda: signal.signal(signal.SIGINT, (
            signal.SIG_IGN if ignored else signal.default_int_handler)))
    try:
        said = program.stdout.readline()
        program.send_signal(signal.SIGINT)
        if ignored:
            program.send_signal(signal.SIGTERM)
        said += program.communicate(timeout=30)[0]
    finally:
        program.kill()
    return program.returncode, said


@pytest.mark.parametrize("where", ["imports", "finalisers"])
def test_imports_are_ended_without_a_word(where):
    assert run_interrupted(where) == (-signal.SIGINT, "deep in %s\n" % where)


def test_without_it_an_interruption_can_be_lost():
    code, said = run_interrupted("finalisers", "signal")
    assert code == 0 and "continued" in said and "KeyboardInterrupt" in said


def test_what_was_begun_is_cleared_away_without_a_traceback():
    assert run_interrupted("plain") == (130, "deep in plain\ncleared away\n")


def test_a_program_may_make_an_exit_code_of_it():
    assert run_interrupted("codes") == (7, "deep in codes\ncleared away\n")


@pytest.mark.parametrize("where", ["imports", "plain"])
def test_an_ignored_signal_stays_ignored(where):
    assert run_interrupted(where, ignored=True) == (-signal.SIGTERM, "deep in %s\n" % where)


def test_quit_prints_the_stack_of_a_program_that_hangs():
    program = subprocess.Popen([sys.executable, "-c", PROGRAM % "m2wr_node.interrupts", "plain"],
                               stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
    try:
        program.stdout.readline()
        program.send_signal(signal.SIGQUIT)
        said = program.communicate(timeout=30)[1]
    finally:
        program.kill()
    assert program.returncode == -signal.SIGQUIT
    assert "in main" in said and "most recent call first" in said

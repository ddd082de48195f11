# SPDX-License-Identifier: BSD-3-Clause
"""Single keys from a terminal or a pipe; the terminal is restored."""
import os
import pty
import signal
import termios

import pytest

from twist_keys.node import has_keyboard
from twist_keys.terminal import Keys


@pytest.fixture
def terminal():
    """A pseudo terminal: the end of the keyboard, the end of the program."""
    typing, program = pty.openpty()
    yield typing, program
    for descriptor in (typing, program):
        try:
            os.close(descriptor)
        except OSError:
            pass        # closed by the test


def echoes(descriptor):
    return bool(termios.tcgetattr(descriptor)[3] & termios.ECHO)


def test_single_keys_arrive_without_enter(terminal):
    typing, program = terminal
    with Keys(program) as keys:
        assert keys.is_terminal and not echoes(program)
        os.write(typing, b'i')
        assert keys.read(5.0) == 'i'
        os.write(typing, b'\xc3\xa9,')
        assert keys.read(5.0)[-1] == ','
        assert keys.read(0.0) == '' and not keys.ended


def test_the_terminal_is_restored_after_an_error(terminal):
    _, program = terminal
    before = termios.tcgetattr(program)
    with pytest.raises(ValueError):
        with Keys(program):
            assert termios.tcgetattr(program) != before
            raise ValueError
    assert termios.tcgetattr(program) == before


def test_single_keys_again_after_the_program_was_stopped(terminal):
    _, program = terminal
    before = termios.tcgetattr(program)
    with Keys(program):
        termios.tcsetattr(program, termios.TCSANOW, before)     # the shell, while it has the terminal
        os.kill(os.getpid(), signal.SIGCONT)
        assert not echoes(program)
    assert signal.getsignal(signal.SIGCONT) == signal.SIG_DFL


def test_a_closed_window_is_the_end(terminal):
    typing, program = terminal
    with Keys(program) as keys:
        os.close(typing)
        assert keys.read(5.0) == '' and keys.ended


def test_a_pipe_gives_its_keys_and_ends():
    reading, writing = os.pipe()
    os.write(writing, b'ik')
    os.close(writing)
    with Keys(reading) as keys:
        assert not keys.is_terminal
        assert keys.read(5.0) == 'ik' and not keys.ended
        assert keys.read(5.0) == '' and keys.ended
    os.close(reading)


def test_what_a_keyboard_is(terminal, tmp_path):
    with open(terminal[1], closefd=False) as stream:
        assert has_keyboard(stream)
    with open('/dev/null') as stream:
        assert not has_keyboard(stream)
    assert not has_keyboard(stream)         # closed
    assert not has_keyboard(None)
    path = tmp_path / 'keys'
    path.write_text('iii')
    with open(str(path)) as stream:
        assert has_keyboard(stream)

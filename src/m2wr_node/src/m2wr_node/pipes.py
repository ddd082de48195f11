# SPDX-License-Identifier: BSD-3-Clause
"""What a program says to a pipe that nobody reads any more is lost in peace: ``... | head``."""
import io
import os
import sys


class _Lenient(io.FileIO):
    """A file descriptor that leads nowhere from the moment its pipe is closed at the other end."""

    def __init__(self, descriptor, then):
        super().__init__(descriptor, "w", closefd=False)
        self._then = then

    def write(self, data):
        """Write; returns how many bytes count as written."""
        try:
            return super().write(data)
        except BrokenPipeError:
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self.fileno())
            os.close(nowhere)
            if self._then is not None:
                self._then()
            return memoryview(data).nbytes


def _lenient(stream, then=None):
    """Return a text stream to where ``stream`` leads, with its ways."""
    stream.flush()
    raw = _Lenient(stream.fileno(), then)
    unbuffered = isinstance(stream.buffer, io.RawIOBase)        # as python -u has it
    return io.TextIOWrapper(raw if unbuffered else io.BufferedWriter(raw), stream.encoding, stream.errors,
                            line_buffering=stream.line_buffering, write_through=unbuffered)


def go_on_unread(then=None):
    """Let standard output and standard error outlive their readers; for the start of a program.

    What was to be done is done to its end, with the exit code that belongs to it.

    Parameters
    ----------
    then : callable, optional
        Called once, in the midst of a write, when nobody reads standard output any more: of programs that do nothing
        but print.
    """
    for name, action in (("stdout", then), ("stderr", None)):
        try:
            setattr(sys, name, _lenient(getattr(sys, name), action))
        except (AttributeError, OSError, ValueError):
            pass                        # none at all, closed, or no file: nothing there can break

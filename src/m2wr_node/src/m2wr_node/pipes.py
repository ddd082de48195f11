# SPDX-License-Identifier: BSD-3-Clause
"""Output to a pipe whose reader has ended is discarded without an error: ``... | head``."""
from __future__ import annotations

import io
import os
import sys
from typing import Any, Callable, Optional, TextIO


class _Lenient(io.FileIO):
    """A file descriptor whose output is discarded as soon as its pipe is closed at the other end."""

    def __init__(self, descriptor: int, then: Optional[Callable[[], object]]) -> None:
        super().__init__(descriptor, "w", closefd=False)
        self._then = then

    def write(self, data: Any) -> int:
        """Write; returns how many bytes count as written."""
        try:
            return super().write(data)
        except BrokenPipeError:
            null = os.open(os.devnull, os.O_WRONLY)
            os.dup2(null, self.fileno())
            os.close(null)
            if self._then is not None:
                self._then()
            return memoryview(data).nbytes


def _lenient(stream: Any, then: Optional[Callable[[], object]] = None) -> TextIO:
    """Return a text stream to the file of ``stream``, with the same encoding and buffering."""
    stream.flush()
    raw = _Lenient(stream.fileno(), then)
    unbuffered = isinstance(stream.buffer, io.RawIOBase)        # as with python -u
    return io.TextIOWrapper(raw if unbuffered else io.BufferedWriter(raw), stream.encoding, stream.errors,
                            line_buffering=stream.line_buffering, write_through=unbuffered)


def ignore_closed_pipes(then: Optional[Callable[[], object]] = None) -> None:
    """Ignore closed pipes of standard output and standard error; call it at the start of a program.

    The program continues to its end and returns its usual exit code.

    Parameters
    ----------
    then : callable, optional
        Called once, during a write, when the pipe of standard output is closed: for programs that only print.
    """
    for name, action in (("stdout", then), ("stderr", None)):
        try:
            setattr(sys, name, _lenient(getattr(sys, name), action))
        except (AttributeError, OSError, ValueError):
            pass                        # no stream, closed, or not a file: no pipe can close

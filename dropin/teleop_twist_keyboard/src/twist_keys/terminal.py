# SPDX-License-Identifier: BSD-3-Clause
"""Single keys from a terminal, which is restored at the end, or from a pipe."""
from __future__ import annotations

import os
import select
import signal
import termios
import tty
from typing import Any


class Keys:
    """Reads single keys; use as a context manager.

    Parameters
    ----------
    descriptor : int
        File descriptor of the terminal or pipe.

    Attributes
    ----------
    is_terminal, ended : bool
        Whether the descriptor is a terminal; whether its end was reached.
    """

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.is_terminal = os.isatty(descriptor)
        self.ended = False
        self._before: Any = None            # the terminal's settings, as of termios
        self._old_handler: Any = None       # of SIGCONT

    def __enter__(self) -> Keys:
        if self.is_terminal:
            self._before = termios.tcgetattr(self._descriptor)
            self._old_handler = signal.signal(signal.SIGCONT, lambda *_: self._arrange())
            self._arrange()
        return self

    def _arrange(self) -> None:
        """Single keys without echo, Ctrl-C as a signal; again after Ctrl-Z and fg, where the shell changes it."""
        tty.setcbreak(self._descriptor, termios.TCSADRAIN)

    def __exit__(self, *_: object) -> None:
        if self._before is not None:
            signal.signal(signal.SIGCONT, self._old_handler or signal.SIG_DFL)
            try:
                termios.tcsetattr(self._descriptor, termios.TCSADRAIN, self._before)
            except termios.error:       # the window is closed
                pass

    def read(self, timeout: float) -> str:
        """Return the keys received within ``timeout`` seconds, '' for none; sets ``ended`` at the end of the input."""
        if not select.select([self._descriptor], [], [], timeout)[0]:
            return ''
        try:
            data = os.read(self._descriptor, 64)
        except OSError:                 # the window is closed
            data = b''
        self.ended = not data
        return data.decode('latin-1')

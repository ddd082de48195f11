# SPDX-License-Identifier: BSD-3-Clause
"""The stack of every thread of a running program, on a signal."""
from __future__ import annotations

import faulthandler
import os
import signal
import sys
import threading


def show_stacks_on(number: int) -> None:
    """Let a signal print the stack of every thread to stderr; the program continues.

    ``faulthandler.register()`` prints from within the signal, while the other threads run on and change what it reads:
    a program with busy threads soon crashes.  Here the signal only wakes a thread, which prints while it holds the
    interpreter lock, so that no other thread runs; a main thread inside a library does not delay it.

    Parameters
    ----------
    number : int
        The signal.  Handlers of other signals are not changed.
    """
    heard, wake = os.pipe()
    os.set_blocking(wake, False)

    def listen() -> None:
        while True:
            for number_heard in os.read(heard, 64):
                if number_heard == number and sys.__stderr__ is not None:       # None: started without stderr
                    faulthandler.dump_traceback(sys.__stderr__)

    threading.Thread(target=listen, name='stacks', daemon=True).start()
    signal.set_wakeup_fd(wake, warn_on_full_buffer=False)
    signal.signal(number, lambda *_: None)

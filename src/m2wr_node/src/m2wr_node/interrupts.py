# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C while a program is still being imported ends it at once and without a word.

The first import of every executable, and of nothing else, for importing it is what does it.  Python raises
KeyboardInterrupt wherever it happens to be: that prints the insides of whatever is being imported or, in a finaliser or
a callback there, is lost, and the program goes on as if nobody had pressed anything.
"""
from __future__ import annotations

import signal

TYPE_CHECKING = False       # as typing has it, whose import takes longer than all the rest
if TYPE_CHECKING:
    from typing import Any, Callable

INTERRUPTED = 128 + signal.SIGINT       # exit code


def _change(before: Any, after: Any) -> None:
    if signal.getsignal(signal.SIGINT) is before:           # else ignored, as a shell does for what ends with &
        signal.signal(signal.SIGINT, after)


def interruptible(main: Callable[..., Any], *words: Any) -> Any:
    """Return ``main(*words)``, in which Ctrl-C is an exception again; for programs that set no handler of their own.

    What ``main`` has begun is cleared away by its own ``finally`` and ``with``.  Unless it makes an exit code of the
    interruption, that is 130, as shells have it, without a traceback.
    """
    try:
        _change(signal.SIG_DFL, signal.default_int_handler)
        return main(*words)
    except KeyboardInterrupt:
        return INTERRUPTED
    finally:
        _change(signal.default_int_handler, signal.SIG_DFL)         # while Python ends: no traceback either


_change(signal.default_int_handler, signal.SIG_DFL)

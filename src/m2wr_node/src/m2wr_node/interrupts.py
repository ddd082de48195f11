# SPDX-License-Identifier: BSD-3-Clause
r"""Ctrl-C during the imports of a program ends it at once and without a traceback.

The first import of every executable, and of nothing else: the import itself changes how SIGINT is handled.  Python
raises KeyboardInterrupt at any place.  During imports this prints a long traceback; in a finaliser or a callback the
exception is lost, and the program continues as if Ctrl-C had not been pressed.

Ctrl-\ (SIGQUIT) ends a program that hangs; before that it prints the stack of every thread.
"""
from __future__ import annotations

import faulthandler
import signal

TYPE_CHECKING = False       # as in typing, whose import takes longer than the rest of this module
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


def _print_stacks_at_quit() -> None:
    if signal.getsignal(signal.SIGQUIT) != signal.SIG_IGN:
        try:
            faulthandler.register(signal.SIGQUIT, chain=True)
        except (AttributeError, RuntimeError, ValueError, OSError):     # no stderr with a file descriptor
            return


_change(signal.default_int_handler, signal.SIG_DFL)
_print_stacks_at_quit()

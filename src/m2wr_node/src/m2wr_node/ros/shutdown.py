# SPDX-License-Identifier: BSD-3-Clause
"""Shutdown hooks that are never lost."""
from __future__ import annotations

import threading
from typing import Callable

import rospy


def at_shutdown(hook: Callable[[], object]) -> None:
    """Call ``hook()`` once when the node shuts down, or at once if the shutdown has begun.

    ``rospy.on_shutdown`` forgets a hook that it receives after the shutdown was requested.

    Parameters
    ----------
    hook : callable
        Without arguments. It may run on another thread than the caller's.
    """
    once = threading.Lock()

    def call() -> None:
        if once.acquire(False):
            hook()

    rospy.on_shutdown(call)
    if rospy.core.is_shutdown_requested():
        call()

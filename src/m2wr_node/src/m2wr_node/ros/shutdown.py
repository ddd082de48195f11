# SPDX-License-Identifier: BSD-3-Clause
"""Shutdown hooks that are never lost, and topics that close while they are used."""
from __future__ import annotations

import threading
from contextlib import contextmanager
from typing import Callable, Iterator

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


@contextmanager
def until_shutdown() -> Iterator[None]:
    """Ignore that a topic has closed while the node shuts down; the rest of the block is left out.

    Topics close before ``rospy.is_shutdown()`` is true, so a loop that asks it can still publish to a closed one.

    Raises
    ------
    rospy.ROSException
        As the block, while the node does not shut down.
    """
    try:
        yield
    except rospy.ROSException:
        if not rospy.core.is_shutdown_requested():
            raise

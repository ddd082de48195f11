# SPDX-License-Identifier: BSD-3-Clause
"""Ending rospy's registration with the master as soon as the node has to end.

Need: while a master does not answer, rospy registers again and again until ``is_shutdown()``, and holds a lock that its
shutdown needs to get there.  Without the change of this file 1 of the 5 tests in ``test_starting.py`` of a master that
dies or has gone hangs.

Uses: the global ``is_shutdown`` of ``rospy.impl.registration``, which its loops call.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: a node that is interrupted while its master is gone may not end until it is killed; one line in the log.
"""
from __future__ import annotations

import logging
from typing import Callable

from rospy.impl import registration

log = logging.getLogger(__name__)


def stop_registering_when(is_ending: Callable[[], bool]) -> bool:
    """Make rospy stop registering with the master as soon as ``is_ending()``.

    Parameters
    ----------
    is_ending : callable
        Returns whether the node has to end.

    Returns
    -------
    bool
        False if this rospy does not ask ``is_shutdown``; then nothing is changed.
    """
    if not hasattr(registration, "is_shutdown"):
        log.warning("this rospy has no rospy.impl.registration.is_shutdown; without a master this node may not end")
        return False
    registration.is_shutdown = is_ending
    return True

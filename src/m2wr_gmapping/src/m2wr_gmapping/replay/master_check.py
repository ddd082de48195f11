# SPDX-License-Identifier: BSD-3-Clause
"""Check for a ROS master, without waiting for one."""
from __future__ import annotations

import socket

import rosgraph

PATIENCE = 2.0              # time limit for the answer of the master [s]


def master_answers() -> bool:
    """Return whether the master in ROS_MASTER_URI answers."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(PATIENCE)
    try:
        return bool(rosgraph.is_master_online())
    finally:
        socket.setdefaulttimeout(before)

# SPDX-License-Identifier: BSD-3-Clause
"""Whether there is a ROS master, without waiting for one."""
import socket

import rosgraph

PATIENCE = 2.0              # a master that is there answers within that time [s]


def master_answers():
    """Whether the master that the environment names is there."""
    before = socket.getdefaulttimeout()
    socket.setdefaulttimeout(PATIENCE)
    try:
        return rosgraph.is_master_online()
    finally:
        socket.setdefaulttimeout(before)

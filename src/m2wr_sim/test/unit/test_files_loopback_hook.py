# SPDX-License-Identifier: BSD-3-Clause
"""Sourcing the workspace binds ROS to the loopback address, unless the user's variables say otherwise."""
import os
import subprocess

import pytest

HOOK = os.path.join(os.path.dirname(__file__), "..", "..", "env-hooks", "50.m2wr_loopback.sh")


@pytest.mark.parametrize("shell", ["sh", "bash"])
@pytest.mark.parametrize("variables, expected", [
    ({}, "127.0.0.1"),
    ({"ROS_MASTER_URI": "http://localhost:11311"}, "127.0.0.1"),
    ({"ROS_MASTER_URI": "http://localhost"}, "127.0.0.1"),
    ({"ROS_MASTER_URI": "http://127.0.0.1:12345/"}, "127.0.0.1"),
    ({"ROS_MASTER_URI": "http://[::1]:11311"}, "127.0.0.1"),
    ({"ROS_MASTER_URI": "http://robot:11311"}, ""),
    ({"ROS_MASTER_URI": "http://localhost.example:11311"}, ""),
    ({"ROS_HOSTNAME": "laptop"}, ""),
    ({"ROS_IP": "10.0.0.9"}, "10.0.0.9"),
    ({"ROS_IP": "10.0.0.9", "ROS_MASTER_URI": "http://localhost:11311"}, "10.0.0.9"),
])
def test_address_that_nodes_are_given(shell, variables, expected):
    done = subprocess.run([shell, "-euc", '. "$1"; printf %s "${ROS_IP:-}"', shell, HOOK], check=True, timeout=30,
                          env=dict(variables, PATH=os.environ["PATH"]), stdout=subprocess.PIPE, universal_newlines=True)
    assert done.stdout == expected

# SPDX-License-Identifier: BSD-3-Clause
"""Which connections are missing before time may advance."""
from types import SimpleNamespace

import rospy

from m2wr_lockstep.server.participants import Listener
from m2wr_lockstep.server.ros.gate import Gate
from m2wr_node.internals.connections import Connection


def test_connections_of_a_listener_that_has_died_do_not_count(monkeypatch):
    def own(name):
        return [Connection("/gazebo", "/mapper", "/scan", ports) for ports in connected]

    connected = [(1, 2)]
    state = [[["/scan", ["/gazebo"]]], [["/scan", ["/mapper"]]], []]
    monkeypatch.setattr(rospy, "get_name", lambda: "/gazebo")
    gate = Gate([], [Listener("/mapper", ("/scan",), True)], [], lambda: True)
    gate._master = SimpleNamespace(getSystemState=lambda: state, lookupNode=lambda name: "")
    monkeypatch.setattr(gate, "_connections", lambda name: own(name) if name == "/gazebo" else [])
    found = gate.look()
    assert not found.missing
    gate.forget("/mapper", found.connections)
    assert gate.look().missing == ["/mapper to be connected to /gazebo on /scan"]
    connected.append((3, 2))
    assert not gate.look().missing

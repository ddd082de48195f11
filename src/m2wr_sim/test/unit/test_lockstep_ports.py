# SPDX-License-Identifier: BSD-3-Clause
"""The simulation's ports in lockstep."""
from types import SimpleNamespace

import pytest
import rospy
from sensor_msgs.msg import LaserScan

from m2wr_sim.ros import ports as plain_ports
from m2wr_sim.ros.lockstep_ports import LockstepPorts, lockstep_settings
from m2wr_sim.ros.params import read_config


@pytest.fixture
def ports(monkeypatch):
    """Ports of lockstep without a network, with /clock and /tf remapped."""
    port = SimpleNamespace(wanted=lambda: True, publish=lambda message: None, close=lambda: None)
    for name, replacement in (("__init__", lambda self: None), ("advertise", lambda self, *_: port),
                              ("clock", lambda self, now_ns: None), ("transform", lambda self, *_: None)):
        monkeypatch.setattr(plain_ports.RosPorts, name, replacement)
    monkeypatch.setattr(rospy, "resolve_name", lambda name: {"/clock": "/sim/clock", "/tf": "/sim/tf"}.get(name, name))
    return LockstepPorts()


def test_clock_and_transforms_are_counted_by_topic(ports):
    ports.clock(0)
    ports.transform(None, "odom", "base", (), ())
    assert ports.topics.counts.counts == {"/sim/clock": 1, "/sim/tf": 1}


def test_a_published_scan_is_counted_in_its_namespace(ports):
    ports.advertise("scan", LaserScan, 1, "/m2wr").publish(None)
    assert ports.topics.counts.counts == {"/m2wr/scan": 1} and ports.topics.tick_due


def test_settings_are_the_parameters():
    config, _ = read_config({"lockstep_controllers": ["/a"], "lockstep_replies": ["/b -> /c"],
                             "lockstep_listeners": ["/d"], "lockstep_on_silence": "go_on", "lockstep_patience": 3.0})
    assert lockstep_settings(config) == (["/a"], ["/b -> /c"], ["/d"], 3.0, True)
    assert not lockstep_settings(read_config({})[0]).continue_on_silence

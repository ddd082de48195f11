# SPDX-License-Identifier: BSD-3-Clause
"""What a map took is given back when it is dropped."""
import os
import threading
import weakref

import numpy as np
import rospy

from m2wr_gmapping.ros.outputs import MapOutput
from m2wr_maps.saved_map import SavedMap


def test_node_limits_the_heap_before_importing_numpy():
    program = os.path.join(os.path.dirname(__file__), "..", "..", "nodes", "slam_gmapping")
    with open(program, encoding="utf-8") as stream:
        text = stream.read()
    assert text.index("\nuse_one_heap()") < text.index("m2wr_gmapping.ros.slam_node")


class Recorder:
    """In the place of publishers and services."""

    def __init__(self, *_, **__):
        pass

    def publish(self, _):
        pass


class OneMapMapper:
    """A mapper with one scan."""

    entropy, given, stamps = 0.0, 0, [1.0]

    @staticmethod
    def map_request():
        return np.zeros((1, 3)), []

    @staticmethod
    def map_of(_, __):
        return SavedMap(np.zeros((32, 32), np.int8), 0.05, np.zeros(2))

    @staticmethod
    def base_poses(poses):
        return poses


def test_map_thread_releases_the_mapper(monkeypatch):
    for name in ("Publisher", "Service"):
        monkeypatch.setattr(rospy, name, Recorder)
    monkeypatch.setattr(rospy.Time, "now", lambda: rospy.Time(1))
    output, mapper = MapOutput("map"), OneMapMapper()
    gone = threading.Event()
    weakref.finalize(mapper, gone.set)
    output.ask(mapper)
    del mapper
    try:
        assert gone.wait(60.0)
        assert output.made == 1
    finally:
        output.close()

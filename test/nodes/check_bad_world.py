#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A world with bad parts runs without them; models that are large, or have bad parts, do not delay it."""
import os
import struct
import sys
import tempfile
import threading
import time
import unittest

import rospy
from rosgraph_msgs.msg import Clock, Log

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Recorder, Simulation, run_checks, wait_until  # noqa: E402

SPAWNED = "SpawnModel: Successfully spawned entity"
SIDE = 300              # cells along the mesh's edges: 180 000 triangles
MANY_LINKS = 10001
MESH = """<sdf version="1.6"><model name="m"><static>true</static><link name="link"><collision name="c"><geometry><mesh>
<uri>%s</uri></mesh></geometry></collision></link></model></sdf>"""
HALF_BAD = """<sdf version="1.6"><model name="m"><static>true</static><link name="link"><collision name="c"><geometry>
<pyramid/></geometry></collision></link><joint name="j" type="fixed"><parent>link</parent><child>gone</child></joint>
</model></sdf>"""
ALL_BAD = '<sdf version="1.6"><model name="m"><link name="l"><inertial><mass>-1</mass></inertial></link></model></sdf>'


def write_mesh(path):
    """Write a slope of many triangles as binary STL."""
    triangle = struct.Struct("<12fH")
    with open(path, "wb") as stream:
        stream.write(b"\0" * 80 + struct.pack("<I", 2 * SIDE * SIDE))
        for row in range(SIDE):
            for column in range(SIDE):
                a, b, c, d = [(x * 0.01, y * 0.01, x * 0.001) for x, y in (
                    (column, row), (column + 1, row), (column + 1, row + 1), (column, row + 1))]
                for corners in ((a, b, c), (a, c, d)):
                    stream.write(triangle.pack(0.0, 0.0, 0.0, *(value for corner in corners for value in corner), 0))


class BadWorld(unittest.TestCase):
    """The simulation runs in test/data/bad/bad_parts.world."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.log = Recorder("/rosout", Log).connected()

    def test_valid_parts_of_the_world_load_and_time_advances(self):
        names = wait_until(self.simulation.models, "models of the world")
        for name in ("ground_plane", "tomb", "wall", "arm", "good"):
            self.assertIn(name, names)
        self.assertNotIn("ghost", names)
        self.simulation.run_for(0.2)
        pose = self.simulation.call("get_model_state", "wall", "").pose.position
        self.assertEqual((pose.x, pose.y, pose.z), (4.0, 0.0, 0.5))

    def test_a_model_with_bad_parts_spawns_and_they_are_named(self):
        self.log.clear()
        answer = self.simulation.spawn("half_bad", HALF_BAD, kind="sdf")
        self.assertEqual((answer.success, answer.status_message), (True, SPAWNED))
        for words in ('unknown geometry "pyramid"', 'child "gone" is no link'):
            line, = self.log.wait(      # the world has such a model too, whose warning may arrive late
                lambda messages: [m for m in messages if words in m.msg and "half_bad" in m.msg], words)
            self.assertEqual(line.level, Log.WARN)
            self.assertIn("left out", line.msg)

    def test_a_model_without_valid_parts_is_refused_with_the_reason(self):
        answer = self.simulation.spawn("all_bad", ALL_BAD, kind="sdf")
        self.assertFalse(answer.success)
        for words in ("link[l]", "mass is -1", "expected a positive mass"):
            self.assertIn(words, answer.status_message)
        self.assertNotIn("all_bad", self.simulation.models())

    def test_a_model_with_too_many_parts_is_refused_with_the_limit(self):
        links = "".join('<link name="l%d"/>' % index for index in range(MANY_LINKS))
        text = '<sdf version="1.6"><model name="m"><static>true</static>%s</model></sdf>' % links
        answer = self.simulation.spawn("many_links", text, kind="sdf")
        self.assertFalse(answer.success)
        self.assertIn("at most 10000", answer.status_message)

    def test_time_advances_while_a_large_mesh_is_read(self):
        arrivals, answers = [], []
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "slope.stl")
            write_mesh(path)
            clock = rospy.Subscriber("/clock", Clock, lambda _: arrivals.append(time.monotonic()))
            wait_until(lambda: len(arrivals) > 2, "the clock")
            asking = threading.Thread(target=lambda: answers.append(
                self.simulation.spawn("slope", MESH % path, (30.0, 30.0, 0.0, 0.0), kind="sdf")), daemon=True)
            began = time.monotonic()
            asking.start()
            wait_until(lambda: answers, "the answer about the mesh")
            ended = time.monotonic()
            clock.unregister()
        self.assertTrue(answers[0].success, answers[0].status_message)
        meanwhile = [moment for moment in arrivals if began <= moment <= ended]
        moments = [began] + meanwhile + [ended]
        longest = max(later - sooner for sooner, later in zip(moments, moments[1:]))
        # the clock ticks every 10 ms; a loop that waited for the mesh would publish almost nothing meanwhile
        self.assertGreater(len(meanwhile), 5, "%.2f s" % (ended - began))
        self.assertLess(longest, max(0.5 * (ended - began), 0.3),
                        "%d ticks in %.2f s" % (len(meanwhile), ended - began))
        self.assertIn("slope", self.simulation.models())


if __name__ == "__main__":
    rospy.init_node("check_bad_world", disable_rostime=True)
    run_checks("bad_world", BadWorld)

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""However a recording ends: the bag can be read, one line reports it, and the supervisor stays until the run ends."""
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import unittest

import rosbag
import rospy
from std_msgs.msg import String

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import Running, program, run_checks, run_program, wait_until  # noqa: E402

TOPIC = "/record_talk"
RATE = 0.01             # s of wall time between two messages
CHUNK = 256 << 10       # bytes, of the recorder


class Talker:
    """Publishes numbered messages that do not compress."""

    def __init__(self):
        self._publisher = rospy.Publisher(TOPIC, String, queue_size=1000)
        self._ended = threading.Event()
        self.sent = 0
        threading.Thread(target=self._run, daemon=True).start()

    def _run(self):
        while not self._ended.wait(RATE):
            self._publisher.publish(String(data="%d %s" % (self.sent, os.urandom(5000).hex())))
            self.sent += 1

    def listeners(self):
        return self._publisher.get_num_connections()

    def end(self):
        self._ended.set()


class RecordRun(unittest.TestCase):

    @classmethod
    def setUpClass(cls):
        cls.talker = Talker()
        cls.addClassCleanup(cls.talker.end)

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.bag = os.path.join(self.folder, "run.bag")
        wait_until(lambda: self.talker.listeners() == 0, "an earlier recorder to end")

    def supervisor(self, *words, limit=None):
        """Start the supervisor of a recorder; ``limit`` is the largest size of its files [bytes]."""
        command = [program("m2wr_sim", "record_run")] + list(words) + [TOPIC, "__name:=record"]
        if limit is not None:
            command = [shutil.which("prlimit"), "--fsize=%d:%d" % (limit, limit)] + command
        return Running(command)

    def recorded(self):
        """Wait until some chunks are written."""
        wait_until(lambda: os.path.exists(self.bag + ".active") and os.path.getsize(self.bag + ".active") > 4 * CHUNK,
                   "a megabyte of bag")

    def numbers(self):
        """The numbers of the messages in the bag."""
        with rosbag.Bag(self.bag) as bag:
            return [int(message.data.split()[0]) for _, message, _ in bag.read_messages()]

    def assert_in_a_row(self, numbers):
        self.assertGreater(len(numbers), 50)
        self.assertEqual(numbers, list(range(numbers[0], numbers[0] + len(numbers))))

    def recorder_of(self, running):
        """The process id of the recorder that a supervisor has started."""
        with open("/proc/%d/task/%d/children" % (running.process.pid, running.process.pid)) as stream:
            return int(stream.read().split()[0])

    def test_ctrl_c_closes_the_bag(self):
        with self.supervisor("-O", self.bag) as running:
            self.recorded()
            self.assertEqual(running.end(signal.SIGINT)[0], 0, running.text)
        self.assert_in_a_row(self.numbers())

    def test_the_ending_mcap_makes_an_mcap_file(self):
        path = os.path.join(self.folder, "run.mcap")
        with self.supervisor("-O", path) as run:
            self.recorded()
            self.assertEqual(run.end(signal.SIGINT)[0], 0, run.text)
        self.assertEqual(os.listdir(self.folder), ["run.mcap"])
        self.assertEqual(run_program([program("m2wr_sim", "convert_recording"), path]).returncode, 0)
        numbers = self.numbers()
        self.assertEqual(numbers, list(range(numbers[0], numbers[-1] + 1)))

    def test_a_killed_supervisor_leaves_a_closed_bag(self):
        with self.supervisor("-O", self.bag) as running:
            self.recorded()
            running.process.send_signal(signal.SIGKILL)
            wait_until(lambda: os.path.exists(self.bag), "the recorder to close its bag")
        self.assert_in_a_row(self.numbers())

    def test_a_killed_recorder_is_reported_and_its_bag_repaired(self):
        with self.supervisor("-O", self.bag) as running:
            self.recorded()
            os.kill(self.recorder_of(running), signal.SIGKILL)
            running.wait_for_text("without a recording.")
            self.assertIsNone(running.process.poll())
            told = int(re.search(r"(\d+) messages up to there are in", running.text).group(1))
            self.assertEqual(running.end(signal.SIGINT)[0], 1)
        numbers = self.numbers()
        self.assertEqual(len(numbers), told)
        self.assert_in_a_row(numbers)

    def test_without_disk_space_the_run_continues_without_loss(self):
        with self.supervisor("-O", self.bag, limit=6 * CHUNK) as running:
            running.wait_for_text("without a recording.")
            self.assertIn("is the disk full", running.text)
            self.assertIn("rosbag reindex %s.active" % self.bag, running.text)
            self.assertIsNone(running.process.poll())
            running.end(signal.SIGTERM)
        self.assertEqual(os.path.getsize(self.bag + ".active"), 6 * CHUNK)
        subprocess.check_call([shutil.which("rosbag"), "reindex", "-q", self.bag + ".active"],
                              stdout=subprocess.DEVNULL)
        os.rename(self.bag + ".active", self.bag)
        self.assert_in_a_row(self.numbers())

    def test_a_subscriber_replaces_a_recorder_that_cannot_write(self):
        with self.supervisor("--lockstep", "true", "-O", os.path.join(self.folder, "nowhere", "run.bag")) as running:
            running.wait_for_text("there is no folder")
            wait_until(lambda: self.talker.listeners() == 1, "a subscriber in place of the recorder")
            self.assertEqual(running.end(signal.SIGINT)[0], 1)


if __name__ == "__main__":
    rospy.init_node("check_record_run")
    run_checks("record_run", RecordRun)

#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""A subscriber that does not read loses only its own messages: the simulation and all other nodes continue."""
import os
import shutil
import signal
import socket
import struct
import sys
import tempfile
import time
import unittest
from io import BytesIO
from xmlrpc.client import ServerProxy

import rosbag
import rosgraph
import rosgraph.network
import rospy
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Log
from sensor_msgs.msg import LaserScan
from visualization_msgs.msg import Marker, MarkerArray

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import PATIENCE, Recorder, Running, Simulation, run_checks, run_program, wait_until  # noqa: E402

SCAN, NODE = "/m2wr/laser/scan", "/gazebo"
PERIOD_NS = 50000000


def simulation_node():
    """The slave API of the node."""
    return ServerProxy(rosgraph.Master(rospy.get_name()).lookupNode(NODE))


def subscribers(topic):
    """Names of the nodes to which the simulation is connected on a topic."""
    return {entry[1] for entry in simulation_node().getBusInfo("/check")[2]
            if entry[2] == "o" and entry[4] == topic and entry[5]}


class Stuck:
    """A subscriber that sends its header and then never reads, like a host that lost its network."""

    def __init__(self, name, topic, kind):
        _, _, (_, address, port) = simulation_node().requestTopic(name, topic, [["TCPROS"]])
        self.socket = socket.create_connection((address, port), PATIENCE)
        rosgraph.network.write_ros_handshake_header(self.socket, {
            "callerid": name, "topic": topic, "type": kind._type, "md5sum": kind._md5sum,
            "message_definition": kind._full_text, "tcp_nodelay": "1"})
        # byte by byte: right after the header comes the first message
        self.header = rosgraph.network.read_ros_handshake_header(self.socket, BytesIO(), 1)


class SlowSubscriber(unittest.TestCase):

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.diagnostics = self.listen("/diagnostics", DiagnosticArray)
        self.log = self.listen("/rosout", Log)
        Simulation().wait_for_model("m2wr")
        self.scans = self.listen(SCAN, LaserScan)
        self.scans.next()

    def listen(self, topic, kind):
        recorder = Recorder(topic, kind).connected()
        self.addCleanup(recorder.close)
        return recorder

    def start(self, *command):
        program = Running(list(command))
        self.addCleanup(program.__exit__)
        return program

    def dropped(self, peer):
        """The newest number of messages dropped for a peer."""
        if not self.diagnostics.messages:
            return 0
        values = {value.key: value.value for value in self.diagnostics.messages[-1].status[0].values}
        return int(values.get("dropped on %s for %s" % (SCAN, peer), 0))

    def wait_for_losses(self, peer):
        wait_until(lambda: self.dropped(peer) > 0, "losses of %s in /diagnostics" % peer)
        wait_until(lambda: any(peer + " does not read " + SCAN in entry.msg for entry in list(self.log.messages)),
                   "a line about %s in the log" % peer)

    def assert_nothing_was_missed_here(self, scans):
        self.assertGreater(len(scans), 100)
        self.assertEqual({later.header.seq - earlier.header.seq for earlier, later in zip(scans, scans[1:])}, {1})
        stamps = [scan.header.stamp.to_nsec() for scan in scans]
        self.assertEqual({later - earlier for earlier, later in zip(stamps, stamps[1:])}, {PERIOD_NS})

    def start_recorder(self):
        """Start rosbag and wait until it writes scans; returns it, its name and the bag's path."""
        before, bag = subscribers(SCAN), os.path.join(self.folder, "scans.bag")
        recorder = self.start(shutil.which("rosbag"), "record", "-O", bag, "--buffsize=0", SCAN)
        wait_until(lambda: subscribers(SCAN) - before, "rosbag to be connected")
        name, = subscribers(SCAN) - before
        wait_until(lambda: os.path.isfile(bag + ".active") and os.path.getsize(bag + ".active") > 8192,
                   "the bag to be begun")
        return recorder, name, bag

    def record_process(self, recorder):
        """The id of the recording program, which rosbag starts as its child."""
        with open("/proc/%d/task/%d/children" % (recorder.process.pid, recorder.process.pid)) as stream:
            children = stream.read().split()
        return int(children[0]) if children else recorder.process.pid

    def test_a_late_subscriber_that_does_not_read_blocks_nothing(self):
        late = [Stuck("/late_viewer_%d" % number, "/gazebo/world_markers", MarkerArray) for number in range(2)]
        for viewer in late:
            self.addCleanup(viewer.socket.close)
            self.assertEqual(viewer.header["latching"], "1")
        late[0].socket.settimeout(PATIENCE)
        stream = late[0].socket.makefile("rb")
        self.addCleanup(stream.close)
        size, = struct.unpack("<I", stream.read(4))
        shown = MarkerArray().deserialize(stream.read(size)).markers
        self.assertGreater(len(shown), 1)
        self.assertEqual(shown[0].action, Marker.DELETEALL)
        self.scans.clear()
        self.scans.next()

    def test_only_the_stopped_process_loses_messages(self):
        recorder, name, bag = self.start_recorder()
        process = self.record_process(recorder)
        self.scans.clear()
        os.kill(process, signal.SIGSTOP)
        self.wait_for_losses(name)
        wait_until(lambda: any(entry.status[0].level == 1 and "read too slowly" in entry.status[0].message
                               for entry in list(self.diagnostics.messages)), "a warning in /diagnostics")
        scans = list(self.scans.messages)
        self.assert_nothing_was_missed_here(scans)
        os.kill(process, signal.SIGCONT)
        begun = self.dropped(name)
        last = self.scans.next()[-1].header.seq
        self.assertGreater(begun, 0)
        size = os.path.getsize(bag + ".active")
        wait_until(lambda: os.path.getsize(bag + ".active") > size + 5000000, "the recorder to read again")
        self.scans.next(100)
        os.kill(process, signal.SIGINT)
        self.assertEqual(recorder.wait(), 0, recorder.text)
        with rosbag.Bag(bag) as written:
            seqs = [message.header.seq for _, message, _ in written.read_messages()]
        self.assertEqual(seqs, sorted(set(seqs)))       # whole messages in order; some are missing
        self.assertLess(len(seqs), seqs[-1] - seqs[0] + 1)
        self.assertGreater(seqs[-1], last - 5000)
        self.assertEqual(len([entry for entry in list(self.log.messages)
                              if name + " does not read " + SCAN in entry.msg]), 1)

    def test_a_stopped_process_that_is_killed_is_forgotten(self):
        recorder, name, _ = self.start_recorder()
        process = self.record_process(recorder)
        os.kill(process, signal.SIGSTOP)
        self.wait_for_losses(name)
        os.kill(process, signal.SIGKILL)
        wait_until(lambda: name not in subscribers(SCAN), "the connection to %s to go" % name)
        wait_until(lambda: self.dropped("those that have left") > 0, "its losses among those that have left")
        self.assert_nothing_was_missed_here(self.scans.next(200))

    def test_an_unreachable_peer_blocks_no_other(self):
        stuck = Stuck("/vanished", SCAN, LaserScan)
        self.addCleanup(stuck.socket.close)
        self.assertEqual(stuck.header["callerid"], NODE)
        wait_until(lambda: "/vanished" in subscribers(SCAN), "the connection to be known")
        self.scans.clear()
        self.wait_for_losses("/vanished")
        self.assert_nothing_was_missed_here(list(self.scans.messages))
        stuck.socket.close()
        wait_until(lambda: "/vanished" not in subscribers(SCAN), "the closed connection to go")
        self.assert_nothing_was_missed_here(self.scans.next(200))

    def test_a_silent_peer_blocks_no_other_connection(self):
        """rospy would wait for it for a minute, in the only thread that accepts connections."""
        _, _, (_, address, port) = simulation_node().requestTopic("/silent", SCAN, [["TCPROS"]])
        for begun in (b"", b"\xff\xff", struct.pack("<I", 1000) + b"callerid="):
            silent = socket.create_connection((address, port), PATIENCE)
            self.addCleanup(silent.close)
            silent.sendall(begun)
        started = time.monotonic()
        other = Stuck("/behind_silent", SCAN, LaserScan)
        self.addCleanup(other.socket.close)
        self.assertEqual(other.header["topic"], SCAN)
        self.assertLess(time.monotonic() - started, 20.0)

    def test_connections_of_healthy_subscribers_stay_and_are_counted(self):
        before = time.monotonic()
        scans = self.scans.next(200)
        self.assertLess(time.monotonic() - before, PATIENCE)
        self.assert_nothing_was_missed_here(scans)
        published = {entry[0]: entry for entry in simulation_node().getBusStats("/check")[2][0]}
        _, sent, connections = published[SCAN]
        self.assertGreater(sent, 200 * 4 * 720)
        self.assertTrue(any(count >= 200 and size >= 200 * 4 * 720 and connected
                            for _, size, count, connected in connections), connections)

    def test_the_tools_of_ros_work_on_its_topics(self):
        done = run_program([shutil.which("rostopic"), "info", SCAN])
        self.assertIn(" * %s (" % NODE, done.stdout)
        self.assertIn(rospy.get_name(), done.stdout)
        self.start(shutil.which("rostopic"), "hz", "--wall-time", SCAN).wait_for_text("average rate")
        self.start(shutil.which("rostopic"), "bw", SCAN).wait_for_text("average:")
        done = run_program([shutil.which("rostopic"), "echo", "-n1", "/clock"])
        self.assertIn("secs", done.stdout)


if __name__ == "__main__":
    rospy.init_node("check_slow_subscriber", disable_rostime=True)
    run_checks("slow_subscriber", SlowSubscriber)

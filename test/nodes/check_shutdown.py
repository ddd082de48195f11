#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Ctrl-C ends a whole run within five seconds and leaves nothing behind; signals end the node cleanly."""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import unittest
from xmlrpc.client import ServerProxy

import rosbag
import rosgraph
import rospy
from rosgraph_msgs.msg import Clock

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import Recorder, Running, Simulation, marked, program, run_checks, run_program, wait_until  # noqa: E402

RECORDED = {"/clock", "/odom", "/tf", "/m2wr/laser/scan", "/cmd_vel"}
PROGRESS = "distance to line"
WITHIN = 5.0        # s, from Ctrl-C to the end of everything


def limit():
    """WITHIN where a processor is free, more in proportion to the load of the machine."""
    return WITHIN * max(1.0, os.getloadavg()[0] / os.cpu_count())


def recorded(master):
    """Topics for which the node /record is connected to a publisher."""
    try:
        _, _, connections = ServerProxy(master.lookupNode("/record")).getBusInfo("/check")
    except (rosgraph.MasterException, OSError):     # not there yet
        return set()
    return {connection[4] for connection in connections if connection[2] == "i" and connection[5]}


class Shutdown(unittest.TestCase):
    """Every run has a master of its own; nodes started alone use that of the test."""

    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)

    def start_run(self, *command):
        """Start bug2.launch with a bag; returns the running program and the bag's path."""
        port = free_port()
        bag = os.path.join(self.folder, "run.bag")
        run = Running(list(command) + [str(port), "m2wr_sim", "bug2.launch", "gui:=false", "record:=" + bag],
                      {"ROS_MASTER_URI": "http://127.0.0.1:%d" % port})
        self.addCleanup(run.__exit__)
        run.wait_for_text("state changed: Go to point")
        wait_until(lambda: os.path.isfile(bag + ".active"), "the bag to be begun")
        master = rosgraph.Master(rospy.get_name(), master_uri="http://127.0.0.1:%d" % port)
        wait_until(lambda: RECORDED <= recorded(master), "rosbag to be connected to %s" % sorted(RECORDED))
        lines = run.text.count(PROGRESS)
        # the first may be logged at the start itself, the second follows two seconds later
        wait_until(lambda: run.text.count(PROGRESS) >= lines + 2, "the robot to report its progress twice more")
        return run, bag

    def assert_clean_end(self, run, bag):
        code, seconds = run.end(signal.SIGINT)
        self.assertEqual(code, 0, run.text)
        self.assertLess(seconds, limit(), run.text)
        self.assertEqual(marked(run.mark), {})
        self.assertEqual(sorted(os.listdir(self.folder)), ["run.bag"])
        with rosbag.Bag(bag) as written:
            topics = written.get_type_and_topic_info()[1]
        for topic in sorted(RECORDED):
            self.assertIn(topic, topics)
            self.assertGreater(topics[topic].message_count, 0, topic)
        for words in ("Traceback", "escalating", "core dumped"):
            self.assertNotIn(words, run.text)

    def test_interrupt_ends_roslaunch_and_closes_the_bag(self):
        self.assert_clean_end(*self.start_run(shutil.which("roslaunch"), "-p"))

    def test_interrupt_ends_experiment_and_closes_the_bag(self):
        self.assert_clean_end(*self.start_run(program("m2wr_sim", "experiment"), "--port"))

    def test_interrupt_ends_an_experiment_during_its_start(self):
        for words in ("started roslaunch server", "auto-starting new master", "process[gazebo-"):
            run = Running([program("m2wr_sim", "experiment"), "--port", str(free_port()), "m2wr_sim", "sim.launch"])
            self.addCleanup(run.__exit__)
            run.wait_for_text(words)
            code, seconds = run.end(signal.SIGINT)
            self.assertIn(code, (0, 130), run.text)         # 0: the start had ended when the signal arrived
            self.assertLess(seconds, limit(), run.text)
            self.assertEqual(marked(run.mark), {})
            self.assertNotIn("m2wr_tools/runs/experiment.py", run.text)        # no traceback

    def test_a_second_interrupt_ends_an_experiment_whose_start_hangs(self):
        path, command = os.path.join(self.folder, "hangs.launch"), "sleep 600"
        with open(path, "w") as stream:
            stream.write('<launch><param name="never" command="%s"/></launch>' % command)
        run = Running([program("m2wr_sim", "experiment"), "--port", str(free_port()), "m2wr_sim", path])
        self.addCleanup(run.__exit__)
        wait_until(lambda: any(command in line for line in marked(run.mark).values()), "the launch file's command")
        run.process.send_signal(signal.SIGINT)
        with self.assertRaises(subprocess.TimeoutExpired):      # it waits for the end of its start
            run.process.wait(6.0)
        for _ in range(5):                                      # a busy machine may have handled the first one late
            run.process.send_signal(signal.SIGINT)
            try:
                run.process.wait(3.0)
                break
            except subprocess.TimeoutExpired:
                continue
        self.assertEqual(run.process.returncode, 130, run.text)
        self.assertNotIn("Traceback", run.text)

    def start_node(self, *arguments):
        """Start the simulation alone and wait until it is ready."""
        node = Running([program("m2wr_sim", "m2wr_sim_node")] + list(arguments))
        self.addCleanup(node.__exit__)
        node.wait_for_text("is ready")
        return node

    def test_signals_end_the_node_cleanly(self):
        for number in (signal.SIGINT, signal.SIGTERM):
            for arguments in ([], ["_paused:=true"], ["_real_time_factor:=0"]):
                if rospy.has_param("/gazebo"):
                    rospy.delete_param("/gazebo")       # of the previous node
                node = self.start_node(*arguments)
                Simulation().models()
                code, seconds = node.end(number)
                self.assertEqual(code, 0, "%s %s: %s" % (number, arguments, node.text))
                self.assertLess(seconds, limit())
                for words in ("Traceback", "Exception", "ERROR", "FATAL"):
                    self.assertNotIn(words, node.text)

    def test_rosnode_kill_ends_the_node_cleanly(self):
        node = self.start_node("_real_time_factor:=5", "_pub_clock_frequency:=0")
        clock = Recorder("/clock", Clock).connected()
        clock.next(10)
        done = run_program([shutil.which("rosnode"), "kill", "/gazebo"])
        self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(node.wait(), 0, node.text)
        for words in ("Traceback", "Exception", "ERROR", "FATAL"):
            self.assertNotIn(words, node.text)
        clock.close()

    def test_a_second_simulation_is_refused_and_the_first_continues(self):
        first = self.start_node()
        simulation = Simulation()
        done = run_program([program("m2wr_sim", "m2wr_sim_node")])
        self.assertEqual(done.returncode, 1, done.stderr)
        for words in ("a simulation runs already", "/gazebo", "rosnode kill"):
            self.assertIn(words, done.stderr)
        self.assertNotIn("Traceback", done.stdout + done.stderr)
        simulation.run_for(0.2)
        self.assertEqual(first.end(signal.SIGTERM)[0], 0, first.text)

    def test_a_killed_simulation_does_not_block_the_next(self):
        first = self.start_node()
        first.end(signal.SIGKILL)
        second = self.start_node()
        Simulation().run_for(0.2)
        self.assertEqual(second.end(signal.SIGTERM)[0], 0, second.text)


if __name__ == "__main__":
    rospy.init_node("check_shutdown", disable_rostime=True)
    run_checks("shutdown", Shutdown)

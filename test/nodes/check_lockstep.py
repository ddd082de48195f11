#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Lockstep: which nodes time waits for; nodes that are silent, die, return or end the run; resets of time."""
import os
import shutil
import signal
import sys
import tempfile
import unittest

import rosbag
import rospy

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import PATIENCE, Running, Simulation, marked, program, run_checks, wait_until  # noqa: E402

NODE = ("m2wr_sim", "m2wr_sim_node")
PUPPET = ("m2wr_test", "lockstep_puppet.py")


class Lockstep(unittest.TestCase):
    """Every case has a simulation and puppets of its own, at full speed."""

    def start(self, *parameters, patience=5.0):
        """Start a simulation and spawn the robot; returns the running node."""
        if rospy.has_param("/gazebo"):
            rospy.delete_param("/gazebo")           # of the previous case
        node = Running([program(*NODE), "_lockstep:=true", "_real_time_factor:=0", "_lockstep_patience:=%g" % patience,
                        "_wheel_convention:=kinetic"] + list(parameters))
        self.addCleanup(node.__exit__)
        node.wait_for_text("is ready")
        self.simulation = Simulation()
        self.assertTrue(self.simulation.spawn("m2wr", rospy.get_param("/robot_description")).success)
        return node

    def puppet(self, *arguments):
        """Start a puppet."""
        puppet = Running([program(*PUPPET)] + list(arguments))
        self.addCleanup(puppet.__exit__)
        return puppet

    def assert_ends_with_error(self, node, *words):
        self.assertEqual(node.wait(), 1, node.text)
        for word in words:
            self.assertIn(word, node.text)
        self.assertNotIn("Traceback", node.text)

    def end(self, node):
        """End a node that works."""
        code, _ = node.end(signal.SIGINT)
        self.assertEqual(code, 0, node.text)
        self.assertNotIn("Traceback", node.text)

    # ---- the rule ----------------------------------------------------------------------------------------------

    def test_every_scan_is_a_tick_and_the_end_of_the_run_stops_time(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        puppet = self.puppet("puppet", "end", "41")
        self.assertEqual(puppet.wait(), 0, puppet.text)
        # scans at 1, 51, 101 ... ms, odometry from 51 ms on
        self.assertIn("puppet: 41 turns, 41 scans, 40 odometries, 2.001 s", puppet.text)
        node.wait_for_text("/puppet ended the run at 2.001 s (tick 41)")
        self.assertEqual({round(self.simulation.time(), 9) for _ in range(20)}, {2.001})
        self.assertAlmostEqual(self.simulation.call("get_model_state", "m2wr", "").pose.position.x, 0.58, delta=0.03)
        self.end(node)

    def test_time_waits_for_all_nodes_and_missing_ones_are_named(self):
        node = self.start("_lockstep_controllers:=[early, late]", "_lockstep_listeners:=['/ear: /odom']")
        self.puppet("early", "drive")
        node.wait_for_text("at 0.000 s until there is")
        wait_until(lambda: "until there is /late to serve /late/lockstep_turn; /ear to subscribe to /odom"
                   in node.text, "the node to name the missing nodes")
        self.puppet("late", "drive")
        wait_until(lambda: "until there is /ear to subscribe to /odom" in node.text, "only one missing node")
        self.assertEqual(self.simulation.time(), 0.0)
        ear = Running([shutil.which("rostopic"), "echo", "/odom/header", "__name:=ear"])
        self.addCleanup(ear.__exit__)
        self.simulation.wait_for_time(0.5)
        ear.wait_for_text("seq: 1\n")              # no message was lost
        self.end(node)

    def test_two_controllers_share_the_ticks(self):
        node = self.start("_lockstep_controllers:=[first, second]")
        first, second = self.puppet("first", "end", "30"), self.puppet("second", "drive")
        self.assertEqual(first.wait(), 0, first.text)
        node.wait_for_text("all nodes are connected at 0.000 s: /first, /second")
        node.wait_for_text("/first ended the run at 1.451 s (tick 30)")
        self.assertIsNone(second.process.poll())
        self.end(node)

    def test_a_pause_is_no_timeout_and_a_time_reset_is_reported(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        puppet = self.puppet("puppet", "drive")
        self.simulation.wait_for_time(1.0)
        self.simulation.call("pause_physics")
        paused = self.simulation.time()
        rospy.rostime.wallsleep(5.5)                # longer than the timeout: the test needs this time
        self.assertEqual(self.simulation.time(), paused)
        self.simulation.call("reset_simulation")
        self.simulation.call("unpause_physics")
        puppet.wait_for_text("puppet: time reset after")
        self.simulation.wait_for_time(0.5)
        self.end(node)

    def test_a_command_sent_before_the_first_tick_is_harmless(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        puppet = self.puppet("puppet", "early", "21")
        self.assertEqual(puppet.wait(), 0, puppet.text)
        node.wait_for_text("/puppet ended the run at 1.001 s (tick 21)")
        self.end(node)

    def test_a_connection_that_fails_at_first_is_made_again(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        puppet = self.puppet("puppet", "shy", "21")
        puppet.wait_for_text("puppet: refused /gazebo")
        self.assertEqual(puppet.wait(), 0, puppet.text)
        self.assertEqual(node.text.count("/gazebo has not connected to /puppet on /cmd_vel within 2 s"), 1, node.text)
        node.wait_for_text("/puppet ended the run at 1.001 s (tick 21)")
        self.end(node)

    def test_time_stops_without_a_robot(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        self.puppet("puppet", "drive")
        self.simulation.wait_for_time(0.5)
        self.assertTrue(self.simulation.call("delete_model", "m2wr").success)
        stood = self.simulation.time()
        node.wait_for_text("at %.3f s until there is a robot with a sensor that makes ticks" % stood)
        self.assertEqual(self.simulation.time(), stood)         # seconds later
        self.assertTrue(self.simulation.spawn("m2wr", rospy.get_param("/robot_description")).success)
        self.simulation.wait_for_time(stood + 0.5)
        self.end(node)

    def test_a_controller_that_gets_no_request_warns(self):
        puppet = self.puppet("puppet", "drive")
        puppet.wait_for_text("/puppet: waiting for the simulator's first lockstep request (5 s)")

    def test_the_node_ends_while_a_subscriber_does_not_read(self):
        node = self.start("_lockstep_controllers:=[puppet]", "_lockstep_listeners:=['/deaf: /odom']", patience=300.0)
        self.puppet("puppet", "drive")
        ear = Running([shutil.which("rostopic"), "echo", "/odom/header", "__name:=deaf"])
        self.addCleanup(ear.__exit__)
        self.simulation.wait_for_time(0.5)
        ear.process.send_signal(signal.SIGSTOP)
        self.addCleanup(ear.process.send_signal, signal.SIGCONT)
        before = [None]

        def stands():
            """Return whether time has not advanced since the previous call; asks the node that waits."""
            before.append(self.simulation.time())
            rospy.rostime.wallsleep(0.5)
            return before[-1] == before[-2]

        wait_until(stands, "time to stop for the subscriber")
        self.end(node)

    def test_a_reply_topic_is_enough_for_unmodified_code(self):
        node = self.start("_lockstep_replies:=['/m2wr/laser/scan -> /cmd_vel by /script']")
        self.puppet("script", "answer")
        self.simulation.wait_for_time(2.0)
        node.wait_for_text("all nodes are connected at 0.000 s: /m2wr/laser/scan -> /cmd_vel by /script")
        self.assertGreater(self.simulation.call("get_model_state", "m2wr", "").pose.position.x, 0.4)
        self.end(node)

    # ---- controllers that do not answer ------------------------------------------------------------------------

    def test_an_unresponsive_controller_is_named_with_its_answer(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        self.puppet("puppet", "block", "21")
        self.assert_ends_with_error(
            node, "lockstep: controller /puppet has not answered tick 21 at 1.001 s within 5 s of wall time; "
            "its last answer was to tick 20 at 0.951 s, saying \"driving\"")

    def test_a_failing_controller_is_named_with_its_error(self):
        node = self.start("_lockstep_controllers:=[puppet]")
        puppet = self.puppet("puppet", "fail", "21")
        self.assert_ends_with_error(node, "controller /puppet failed in tick 21 at 1.001 s",
                                    "the puppet failed", "its last answer was to tick 20")
        self.assertEqual(puppet.wait(), 1)

    def test_a_controller_that_dies_is_named(self):
        node = self.start("_lockstep_controllers:=[puppet]", patience=60.0)
        puppet = self.puppet("puppet", "die", "21")
        self.assertEqual(puppet.wait(), 3)
        self.assert_ends_with_error(node, "controller /puppet failed in tick 21 at 1.001 s")

    def test_a_missing_reply_is_named(self):
        node = self.start("_lockstep_replies:=['/m2wr/laser/scan -> /cmd_vel']")
        script = self.puppet("script", "answer")
        self.simulation.wait_for_time(1.0)
        script.process.send_signal(signal.SIGSTOP)
        try:
            self.assert_ends_with_error(node, "/m2wr/laser/scan -> /cmd_vel: no answer on /cmd_vel to /m2wr/laser/scan")
        finally:
            script.process.send_signal(signal.SIGCONT)

    def test_time_advances_without_a_dead_controller(self):
        node = self.start("_lockstep_controllers:=[first, second]", "_lockstep_on_silence:=go_on")
        first, _ = self.puppet("first", "drive"), self.puppet("second", "drive")
        self.simulation.wait_for_time(0.5)
        first.end(signal.SIGKILL)
        node.wait_for_text("without it.")
        self.assertIn("controller /first failed in tick", node.text)
        self.simulation.run_for(1.0)
        self.assertNotIn("/first takes part from", node.text)       # a dead one does not
        again = self.puppet("first", "drive")
        again.wait_for_text("puppet: first turn")
        self.assertEqual(node.text.count("/first takes part from"), 1)
        self.simulation.run_for(1.0)
        self.end(node)

    def test_an_empty_list_of_controllers_is_refused(self):
        if rospy.has_param("/gazebo"):
            rospy.delete_param("/gazebo")
        with Running([program(*NODE), "_lockstep:=true"]) as node:
            self.assert_ends_with_error(node, "~lockstep is true", "~lockstep_controllers", "expected the names")

    # ---- a whole run -------------------------------------------------------------------------------------------

    def test_a_run_with_an_unresponsive_node_ends_and_closes_its_bag(self):
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        bag, port = os.path.join(folder, "run.bag"), free_port()
        run = Running([program("m2wr_sim", "experiment"), "--port", str(port), "m2wr_sim", "bug2.launch", "gui:=false",
                       "real_time_factor:=0", "record:=" + bag], {"ROS_MASTER_URI": "http://127.0.0.1:%d" % port})
        self.addCleanup(run.__exit__)
        run.wait_for_text("state changed: Go to point")
        follower, = [pid for pid, command in marked(run.mark).items() if "wall_follower.py" in command]
        os.kill(follower, signal.SIGSTOP)
        self.assertEqual(run.wait(PATIENCE), 1, run.text)
        # bug2 is named instead if it was waiting for a switch of wall_follower
        self.assertRegex(run.text, "controller /(wall_follower|bug2) has not answered tick")
        self.assertIn("node gazebo", run.text)
        self.assertEqual(os.listdir(folder), ["run.bag"])
        with rosbag.Bag(bag) as written:
            self.assertGreater(written.get_message_count("/odom"), 0)


if __name__ == "__main__":
    rospy.init_node("check_lockstep", disable_rostime=True)
    run_checks("lockstep", Lockstep)

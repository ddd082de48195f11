#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The package gazebo_ros: launch files and their arguments, commands, Python module."""
import os
import signal
import sys
import unittest
from concurrent.futures import ThreadPoolExecutor

import rosgraph
import rospy
from geometry_msgs.msg import Pose
from rosgraph_msgs.msg import Clock

from gazebo_ros import gazebo_interface

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import QUIET, Launched, foreign_environment, names_of_nodes  # noqa: E402
from sim_probe import (  # noqa: E402
    Recorder,
    Running,
    Simulation,
    data_path,
    data_text,
    make_pose,
    program,
    run_checks,
    run_program,
    wait_until,
)

WORLDS = (      # launch file, models that must be there
    ("shapes_world.launch", ["static_box", "static_cylinder", "static_sphere"]),
    ("elevator_world.launch", ["shaft", "elevator"]), ("range_world.launch", ["range_finders", "obstacle"]),
)
SERVER = [program("gazebo_ros", "gzserver")]
STOPPING = 20.0     # s of wall time for a program to end on a slow machine


def services():
    """Return the names of all services."""
    return {name for name, _ in rosgraph.Master(rospy.get_name()).getSystemState()[2]}


class GazeboRosLaunch(unittest.TestCase):
    """Each case starts a simulation on the master of this test and ends it again."""

    def setUp(self):
        self.simulation = Simulation()

    def tearDown(self):
        if "/gazebo" in names_of_nodes():       # a case that failed has killed it
            run_program(["rosnode", "cleanup"], "y\n")

    def run_server(self, *words, command=None, **environment):
        """Start gzserver by hand; returns it when its world is ready."""
        wait_until(lambda: "/gazebo" not in names_of_nodes(), "the end of an earlier simulation")
        return Running((command or SERVER) + list(words), dict(QUIET, **environment))

    def models_of(self, run):
        """Return the models of a simulation, or fail with its output if it has ended."""
        def ready():
            if run.process.poll() is not None:
                raise AssertionError("%s ended with %s:\n%s" % (run.arguments, run.process.poll(), run.text))
            return "/gazebo/get_world_properties" in services()
        wait_until(ready, "the services of %s" % run.arguments)
        return self.simulation.models()

    def end(self, run):
        """End a program with SIGINT, wait until its node is gone, and return the exit code."""
        code, _ = run.end(signal.SIGINT, STOPPING)
        wait_until(lambda: "/gazebo" not in names_of_nodes(),
                   "/gazebo to leave the master; %s ended with %s, its output:\n%s" % (run.arguments, code, run.text))
        return code

    # ---- launch files ------------------------------------------------------------------------------------------

    def test_worlds_of_gazebos_launch_files(self):
        for name, models in WORLDS:
            with Launched(["gazebo_ros", name, "gui:=false"]) as run:
                self.assertEqual(run.wait_for_models(*models)[0], "ground_plane")
                self.assertNotIn("cannot be read", run.text)

    def test_paused_and_no_simulated_time(self):
        rospy.set_param("/use_sim_time", True)
        with Launched(["gazebo_ros", "empty_world.launch", "paused:=true", "use_sim_time:=false", "headless:=true",
                       "recording:=true", "physics:=bullet", "extra_gazebo_args:=--sparkle --seed 3"]) as run:
            run.wait_for_models()
            self.assertIs(rospy.get_param("/use_sim_time"), False)
            self.assertEqual(rospy.get_param("/gazebo/seed"), 3)
            for words in ("option -r has no effect", '"bullet" is not available', "--sparkle is not known",
                          "there is no display"):
                run.wait_for_text(words)
            self.assertEqual(self.simulation.time(), 0.0)
            self.simulation.call("unpause_physics")
            self.simulation.wait_for_time(0.1)

    def test_rate_of_the_clock(self):
        with Launched(["gazebo_ros", "empty_world.launch", "gui:=false", "use_clock_frequency:=true",
                       "pub_clock_frequency:=50"]) as run:
            run.wait_for_models()
            clock = Recorder("/clock", Clock).connected()
            stamps = [message.clock.to_nsec() for message in clock.next(12)]
            clock.close()
            self.assertEqual({later - sooner for sooner, later in zip(stamps, stamps[1:])}, {20000000})
        rospy.delete_param("/gazebo/pub_clock_frequency")

    def test_without_the_network_there_is_only_the_clock(self):
        with Launched(["gazebo_ros", "empty_world.launch", "gui:=false", "enable_ros_network:=false"]):
            clock = Recorder("/clock", Clock).connected()
            clock.next(3)
            clock.close()
            self.assertEqual([name for name in services() if name.endswith(("_state", "_model", "_physics"))], [])
            self.assertNotIn("/gazebo/model_states", dict(rospy.get_published_topics()))

    def test_a_required_window_that_cannot_open_is_ignored(self):
        with Launched(["gazebo_ros", "empty_world.launch", "gui_required:=true"]) as run:
            run.wait_for_text("waiting for the end")
            self.simulation.wait_for_time(0.5)
            self.assertIsNone(run.process.poll())

    # ---- worlds ------------------------------------------------------------------------------------------------

    def test_a_world_on_the_resource_path_and_a_model_from_an_export(self):
        environment = foreign_environment(GAZEBO_RESOURCE_PATH="/no/such/folder:" + data_path())
        for words, model in (("drum.world", "drum"), ("worlds/old.world", "corner")):
            with self.run_server(words, **environment) as run:
                self.assertIn(model, self.models_of(run))
                self.assertEqual(self.end(run), 0, run.text)

    def test_a_missing_or_broken_world_gives_the_empty_one(self):
        for world, words in (("/no/such/place.world", "Could not open file[/no/such/place.world]"),
                             (data_path("bad", "malformed.world"), "malformed.world:5")):
            with self.run_server(world) as run:
                self.assertEqual(self.models_of(run), ["ground_plane"])
                run.wait_for_text(words)
                run.wait_for_text('empty.world" is ready')      # and no such line about the other world
                self.assertEqual(self.end(run), 0, run.text)

    # ---- commands ----------------------------------------------------------------------------------------------

    def test_debug_and_perf_start_the_same_simulation(self):
        for name, words in (("debug", "kill -USR1"), ("perf", "the whole profile is in")):
            with self.run_server("-u", command=[program("gazebo_ros", name)]) as run:
                self.assertEqual(self.models_of(run), ["ground_plane"])
                if name == "debug":
                    for _ in range(20):     # while the thread that served this request still runs
                        self.simulation.models()
                        run.process.send_signal(signal.SIGUSR1)
                    run.wait_for_text("most recent call first")
                self.assertEqual(self.end(run), 0, run.text)
                self.assertIn(words, run.text)

    def test_gazebo_starts_and_ends_server_and_client(self):
        with self.run_server("-u", "worlds/mud.world", command=[program("gazebo_ros", "gazebo")]) as run:
            self.assertIn("mud_box", self.models_of(run))
            run.wait_for_text("there is no display")
            self.assertEqual(self.end(run), 0, run.text)

    def test_misuse_and_help_need_no_master(self):
        nowhere = {"ROS_MASTER_URI": "http://127.0.0.1:1"}
        cases = (("gzserver", ["--seed", "many"], 255, "whole number"), ("gzserver", ["-h"], 0, "usage: gzserver"),
                 ("gazebo", ["--version"], 0, "m2wr_sim"), ("gzclient", ["-h"], 0, "usage: gzclient"),
                 ("gzclient", [], 0, "there is no display"), ("spawn_model", ["-urdf"], 2, "usage: spawn_model"))
        with ThreadPoolExecutor(2) as pool:
            results = pool.map(lambda case: run_program([program("gazebo_ros", case[0])] + case[1],
                                                        environment=dict(QUIET, **nowhere)), cases)
            for (name, words, code, said), done in zip(cases, results):
                self.assertEqual(done.returncode, code, "%s %s: %s" % (name, words, done.stderr))
                self.assertIn(said, done.stdout + done.stderr)

    # ---- gazebo_interface --------------------------------------------------------------------------------------

    def test_the_python_module(self):
        xml = data_text("foreign", "old_robot", "urdf", "old.urdf.xacro")
        with self.run_server("-u") as run:
            self.assertEqual(self.models_of(run), ["ground_plane"])
            self.assertIs(gazebo_interface.spawn_urdf_model_client("a", xml, "/", make_pose(1.0), "", "/gazebo"), True)
            self.assertIs(gazebo_interface.spawn_urdf_model_client("a", xml, "/", Pose(), "", "/gazebo"), False)
            self.assertIsNone(gazebo_interface.spawn_urdf_model_client("b", "<sdf/>", "/", Pose(), "", "/gazebo"))
            sdf = data_text("crate.sdf")        # its own pose is 0.5 m ahead
            self.assertIs(gazebo_interface.spawn_sdf_model_client("c", sdf, "", make_pose(2.0), "a", "/gazebo"), True)
            self.assertAlmostEqual(self.simulation.call("get_model_state", "c", "").pose.position.x, 3.5, delta=0.01)
            self.assertIs(gazebo_interface.set_model_configuration_client("a", "", [], [], "/gazebo"), True)
            self.assertIs(gazebo_interface.set_model_configuration_client("gone", "", [], [], "/gazebo"), False)
            self.assertEqual(self.end(run), 0, run.text)


if __name__ == "__main__":
    rospy.init_node("check_gazebo_ros_launch", disable_rostime=True)
    run_checks("gazebo_ros_launch", GazeboRosLaunch)

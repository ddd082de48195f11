#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures of rviz show robot, scan, world, map and Bug 2's markers; clicked goals and poses are accepted."""
import contextlib
import glob
import math
import os
import shutil
import signal
import sys
import tempfile
import unittest
from xmlrpc.client import ServerProxy

import numpy as np
import rosgraph
import rospy
from geometry_msgs.msg import PoseStamped, PoseWithCovarianceStamped
from nav_msgs.msg import OccupancyGrid, Odometry, Path
from PIL import Image
from rosgraph_msgs.msg import Log
from std_msgs.msg import String
from std_srvs.srv import Trigger

from gazebo_msgs.msg import ModelState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from sim_probe import (  # noqa: E402
    Recorder,
    Running,
    Simulation,
    make_pose,
    program,
    run_checks,
    run_program,
    wait_until,
    xyz,
)

#: Colours as rendered: those of unlit markers are exact, free and unknown cells of a map have rviz's own colours.
SCAN, LINE, WALL_TEXT, PATH = (214, 30, 30), (79, 79, 79), (214, 94, 0), (0, 114, 178)
FREE, OCCUPIED, UNKNOWN = (255, 255, 255), (0, 0, 0), (112, 137, 134)
WIDTH, HEIGHT = 1280, 720
CRATE = """<sdf version="1.6"><model name="crate"><static>1</static><link name="link"><collision name="c"><geometry>
<box><size>1 1 1</size></box></geometry></collision><visual name="v"><geometry><box><size>1 1 1</size></box></geometry>
<material><diffuse>0.9 0.0 0.9 1</diffuse></material></visual></link></model></sdf>"""


def near(pixels, colour, tolerance=10):
    """Return where a picture (rows, columns, 3) has a colour."""
    return np.abs(pixels - np.array(colour)).max(axis=2) <= tolerance


def chassis(pixels):
    """Return where the chassis is: a dark blue of its own."""
    red, green, blue = pixels[:, :, 0], pixels[:, :, 1], pixels[:, :, 2]
    return (blue > red + 8) & (blue > green + 3) & (blue < 110) & (red < 80)


def purple(pixels):
    """Return where the crate is, under any light."""
    red, green, blue = pixels[:, :, 0], pixels[:, :, 1], pixels[:, :, 2]
    return (np.minimum(red, blue) > green + 60) & (np.abs(red - blue) < 25)


def middle(mask):
    """Return column and row of the middle of a mask."""
    rows, columns = np.nonzero(mask)
    return columns.mean(), rows.mean()


def grown(mask, pixels):
    """Return a mask grown by this number of pixels."""
    found = mask.copy()
    for step in range(1, pixels + 1):
        found[step:] |= mask[:-step]
        found[:-step] |= mask[step:]
    mask = found.copy()
    for step in range(1, pixels + 1):
        found[:, step:] |= mask[:, :-step]
        found[:, :-step] |= mask[:, step:]
    return found


def on_walls(pixels):
    """Return the share of the drawn scan that lies on the drawn walls of the map; 0 without a scan."""
    scan = near(pixels, SCAN)
    return (scan & grown(near(pixels, OCCUPIED), 5)).sum() / scan.sum() if scan.sum() > 100 else 0.0


class Rviz(unittest.TestCase):
    """One run with two virtual displays; the cases run in the order of their numbers: the robot keeps driving."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.log, cls.odometry = Recorder("/rosout", Log), Recorder("/odom", Odometry)
        cls.states, cls.line = Recorder("/bug2/state", String), Recorder("/bug2/m_line", Path)
        cls.goals = rospy.Publisher("/move_base_simple/goal", PoseStamped, queue_size=1)
        cls.poses = rospy.Publisher("/initialpose", PoseWithCovarianceStamped, queue_size=1)
        for needed in ("Xvfb", "rviz"):
            if shutil.which(needed) is None:
                raise AssertionError("there is no program %s; apt install %s" % (needed, needed.lower()))
        cls.simulation.wait_for_model("m2wr")

    def shot(self, display):
        """Return the pixels of a new picture."""
        rospy.wait_for_service("/%s/screenshot" % display, 60.0)
        answer = rospy.ServiceProxy("/%s/screenshot" % display, Trigger)()
        self.assertTrue(answer.success, answer.message)
        with Image.open(answer.message) as picture:
            self.assertEqual(picture.size, (WIDTH, HEIGHT))
            return np.asarray(picture.convert("RGB")).astype(int)

    def shot_with(self, display, condition, what):
        """Return the first picture for which a condition holds: rviz needs some time to draw new data."""
        found = []

        def fits():
            found[:] = [self.shot(display)]
            return condition(found[0])

        wait_until(fits, "%s in a picture of %s" % (what, display), 30.0)
        return found[0]

    def wait_for_log(self, text):
        """Wait until a node has logged a text."""
        self.log.wait(lambda messages: any(text in message.msg for message in messages), "\"%s\"" % text, 30.0)

    def position(self):
        return xyz(self.odometry.wait(lambda messages: messages[-1], "odometry").pose.pose.position)

    def robot_in_the_middle(self, pixels, least):
        mask = chassis(pixels)
        self.assertGreater(mask[260:460, 540:740].sum(), least)
        column, row = middle(mask[260:460, 540:740])
        self.assertLess(math.hypot(column - 100, row - 100), 40.0)

    def test_1_the_picture_shows_bug2(self):
        self.states.wait(lambda messages: messages[-1].data == "wall_following", "the first wall")
        pixels = self.shot_with("bug2_display", lambda picture: near(picture, WALL_TEXT, 6).sum() > 150
                                and near(picture, SCAN).sum() > 300 and chassis(picture)[260:460, 540:740].sum() > 300,
                                "the state, the scan and the robot")
        self.robot_in_the_middle(pixels, 300)
        text = near(pixels, WALL_TEXT, 6)[230:360, 500:780]
        self.assertGreater(text.sum(), 100, "the state, written above the robot")
        rows, columns = np.nonzero(near(pixels, SCAN))
        self.assertGreater(max(np.ptp(rows), np.ptp(columns)), 150, "the scan lies along walls")
        # the camera looks along x, so the m-line, along y, lies across the picture
        self.assertGreater(near(pixels, LINE, 14).sum(axis=1).max(), 150, "the m-line")
        self.assertGreater(near(pixels, (150, 144, 135), 25).sum(), 5000, "the walls")
        path = os.path.join(rospy.get_param("/bug2_display/out"), "*_start.png")
        self.assertEqual(len(glob.glob(path)), 1, path)

    def test_2_the_picture_shows_the_map(self):
        grid = Recorder("/map", OccupancyGrid)
        grid.wait(lambda messages: np.count_nonzero(np.array(messages[-1].data) == 100) > 100, "walls in the map")
        grid.close()
        # the map follows the scan by seconds: while the robot turns towards new walls, the scan has none to lie on
        pixels = self.shot_with("virtual_display", lambda picture: near(picture, OCCUPIED).sum() > 200
                                and near(picture, PATH, 25).sum() > 30 and on_walls(picture) > 0.3,
                                "the best path and a scan on the map's walls")
        robot = chassis(pixels)
        self.assertGreater(robot.sum(), 60, "the robot, in a view of the whole course")
        column, row = map(int, middle(robot))
        self.assertGreater(near(pixels, FREE).sum(), 20000)
        self.assertGreater(near(pixels, UNKNOWN, 4).sum(), 50000)
        around = near(pixels, FREE)[row - 20:row + 20, column - 25:column + 25]
        self.assertGreater(around.mean(), 0.2, "beside the robot, which follows a wall, there is free space")

    def test_3_the_picture_follows_added_moved_and_deleted_models(self):
        self.simulation.call("pause_physics")
        self.addCleanup(self.simulation.call, "unpause_physics")
        x, y, _ = self.position()
        self.assertLess(purple(self.shot("bug2_display")).sum(), 20)
        self.simulation.spawn("crate", CRATE, (x, y + 3.0, 1.5, 0.0), kind="sdf")
        pixels = self.shot_with("bug2_display", lambda picture: purple(picture).sum() > 1000, "a crate")
        self.assertLess(middle(purple(pixels))[0], 0.45 * WIDTH, "left of the robot is left")
        self.simulation.call("set_model_state", ModelState(model_name="crate", pose=make_pose(x, y - 3.0, 1.5)))
        self.shot_with("bug2_display", lambda picture: purple(picture).sum() > 1000
                       and middle(purple(picture))[0] > 0.55 * WIDTH, "the crate on the other side")
        self.simulation.call("delete_model", "crate")
        self.shot_with("bug2_display", lambda picture: purple(picture).sum() < 20, "no crate")

    def test_4_goals_are_taken_from_any_frame_or_refused(self):
        for pose, frame, said in ((make_pose(1.0, 1.0), "moon", "known frames: link_chassis, link_left_wheel"),
                                  (make_pose(math.nan, 1.0), "odom", "expected finite numbers")):
            self.log.clear()
            self.goals.publish(self.goal(pose, frame))
            self.wait_for_log(said)
        self.assertEqual(xyz(self.line.messages[-1].poses[1].pose.position)[:2], (0.0, -4.0))
        self.goals.publish(self.goal(make_pose(0.5, -4.0), "map"))
        # the map's frame is nearly that of the odometry
        self.line.wait(lambda messages: 0.0 < math.dist(xyz(messages[-1].poses[1].pose.position)[:2], (0.5, -4.0))
                       < 0.5, "an m-line to the goal", 20.0)

    def test_5_the_robot_is_placed_at_the_clicked_pose(self):
        wait_until(lambda: self.poses.get_num_connections() > 0, "place_robot")
        message = PoseWithCovarianceStamped()
        message.header.frame_id, message.pose.pose = "odom", make_pose(-3.0, 7.5, 5.0, 1.0)
        self.states.clear()
        self.poses.publish(message)
        self.odometry.wait(lambda messages: math.dist(xyz(messages[-1].pose.pose.position)[:2], (-3.0, 7.5)) < 0.15,
                           "the robot at its new place", 20.0)
        self.assertAlmostEqual(self.position()[2], 0.1, delta=0.05)       # on the floor, for any z of the request
        self.wait_for_log("state changed: Go to point (the robot was put elsewhere)")
        self.states.wait(lambda messages: messages[0].data == "go_to_point", "the state")
        line = self.line.wait(lambda messages: math.dist(xyz(messages[-1].poses[0].pose.position)[:2], (-3.0, 7.5))
                              < 0.3 and messages[-1], "an m-line from there", 20.0)
        self.assertLess(math.dist(xyz(line.poses[1].pose.position)[:2], (0.5, -4.0)), 0.5)

    @staticmethod
    def goal(pose, frame):
        message = PoseStamped(pose=pose)
        message.header.frame_id = frame
        return message

    def test_6_the_robot_drives_to_the_clicked_goal(self):
        x, y, _ = self.position()
        where = (x + 1.5 * math.copysign(1.0, -x), y)     # towards the middle of the corridor
        self.states.clear()
        self.goals.publish(self.goal(make_pose(*where), "odom"))
        self.states.wait(lambda messages: messages[-1].data == "goal_reached", "the robot to reach its goal", 60.0)
        self.assertLess(math.dist(self.position()[:2], where), 0.35)
        self.assertEqual((rospy.get_param("/des_pos_x"), rospy.get_param("/des_pos_y")), where)
        wait_until(lambda: glob.glob(os.path.join(rospy.get_param("/bug2_display/out"), "*_goal_reached.png")),
                   "a picture of the state")

    def test_7_a_killed_rviz_is_restarted_and_the_run_continues(self):
        address = rosgraph.Master(rospy.get_name()).lookupNode("/bug2_display_rviz")
        self.log.clear()
        os.kill(ServerProxy(address).getPid(rospy.get_name())[2], signal.SIGKILL)
        self.wait_for_log("rviz ended with signal 9")
        self.robot_in_the_middle(self.shot_with(
            "bug2_display", lambda picture: chassis(picture)[260:460, 540:740].sum() > 300, "the robot again"), 300)
        folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, folder)
        out = os.path.join(folder, "mine.png")
        done = run_program([program("m2wr_sim", "screenshot"), "--service", "bug2_display/screenshot", "--out", out])
        self.assertEqual((done.returncode, done.stdout.strip()), (0, out), done.stderr)
        with Image.open(out) as picture:
            self.assertEqual(picture.size, (WIDTH, HEIGHT))
        self.simulation.run_for(0.5)

    def test_8_missing_programs_and_files_are_reported(self):
        config = rospy.get_param("/bug2_display/config")
        command = [sys.executable, program("m2wr_view", "virtual_display")]
        # concurrently, because each takes seconds to start
        with Running(command + ["_config:=" + config, "_out:=/tmp", "__name:=third"],
                     {"PATH": "/nowhere"}) as poor, \
                Running(command + ["_config:=/tmp/lost.rviz", "_out:=/tmp", "__name:=fourth"]) as lost, \
                Running(command + ["_config:=" + config, "_out:=/proc/none", "__name:=fifth"]) as mute:
            mute.wait_for_text("No pictures are saved")
            mute.wait_for_text("pictures go to")
            mute.process.send_signal(signal.SIGINT)
            for run, said in ((poor, "no program Xvfb; install it (apt install xvfb"), (lost, "lost.rviz"), (mute, "")):
                self.assertEqual(run.wait(), 0, run.text)
                self.assertIn(said, run.text)

    def test_9_the_last_picture_is_taken_at_the_end(self):
        folders = [rospy.get_param("/%s/out" % name) for name in ("virtual_display", "bug2_display")]
        self.addCleanup(shutil.rmtree, os.path.dirname(folders[0]))
        for name, folder in zip(("/virtual_display", "/bug2_display"), folders):
            address = rosgraph.Master(rospy.get_name()).lookupNode(name)
            with contextlib.suppress(OSError):      # it may end before it has answered
                ServerProxy(address).shutdown(rospy.get_name(), "the check has ended")
            wait_until(lambda: glob.glob(os.path.join(folder, "*_end.png")), "a last picture in " + folder)
        with Image.open(glob.glob(os.path.join(folders[0], "*_end.png"))[0]) as picture:
            pixels = np.asarray(picture.convert("RGB")).astype(int)
        self.assertGreater(near(pixels, FREE).sum(), 20000)


if __name__ == "__main__":
    rospy.init_node("check_rviz", disable_rostime=True)
    run_checks("rviz", Rviz)

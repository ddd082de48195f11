#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Pictures show the models, follow moves and deletions, and need no folder; a run whose simulator dies is kept."""
import os
import shutil
import signal
import sys
import tempfile
import unittest
from xmlrpc.client import ServerProxy

import numpy as np
import rosbag
import rosgraph
import rospy
from PIL import Image as Picture
from sensor_msgs.msg import Image
from visualization_msgs.msg import Marker, MarkerArray

from gazebo_msgs.msg import ModelState

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_launch_errors import free_port  # noqa: E402
from sim_probe import (  # noqa: E402
    Recorder,
    Running,
    Simulation,
    make_pose,
    program,
    run_checks,
    run_program,
    wait_until,
)

OBSTACLE, ROBOT = (0x90, 0x90, 0x90), (0xD5, 0x5E, 0x00)
CRATE = """<sdf version="1.6"><model name="crate"><static>1</static><link name="link"><collision name="c"><geometry>
<box><size>2 1 1</size></box></geometry></collision></link></model></sdf>"""


def marked(pixels, colour):
    """Return where an RGB picture (rows, columns, 3) has a colour."""
    return np.abs(pixels.astype(int) - colour).max(axis=2) < 8


def pixels_of(message):
    return np.frombuffer(message.data, dtype=np.uint8).reshape(message.height, message.width, 3)


class Pictures(unittest.TestCase):
    """One simulation and one image_dump, whose folder cannot be written to."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.images = Recorder("/image_dump/image", Image).connected()

    def until(self, condition, what):
        return self.images.wait(lambda messages: condition(pixels_of(messages[-1])), what)

    def centre(self, pixels):
        """Return the centre of all grey pixels as fractions of the picture; the legend's patch has little weight."""
        rows, columns = np.nonzero(marked(pixels[:650], OBSTACLE))
        return (columns.mean() / 800.0, rows.mean() / 800.0) if len(rows) > 1000 else None

    def test_pictures_show_the_robot_and_follow_what_moves(self):
        self.until(lambda pixels: marked(pixels[:650], ROBOT).sum() > 200, "a robot in the picture")
        self.assertEqual(self.images.messages[-1].encoding, "rgb8")
        self.until(lambda pixels: self.centre(pixels) is None, "a picture of an empty world")
        self.simulation.spawn("crate", CRATE, (-3.0, 3.0, 0.5, 0.0), kind="sdf")
        self.until(lambda pixels: self.centre(pixels) is not None and self.centre(pixels)[0] < 0.4
                   and self.centre(pixels)[1] < 0.4, "a crate at the upper left")
        size = marked(pixels_of(self.images.messages[-1])[:650], OBSTACLE).sum()
        metre = 656.0 / 10.0        # the window is 656 pixels high and shows 10 m
        self.assertAlmostEqual(size, 2.0 * metre ** 2, delta=0.12 * 2.0 * metre ** 2)
        self.simulation.call("set_model_state", ModelState(model_name="crate", pose=make_pose(3.0, -3.0, 0.5)))
        self.until(lambda pixels: self.centre(pixels) is not None and self.centre(pixels)[0] > 0.6
                   and self.centre(pixels)[1] > 0.5, "the crate at the lower right")
        self.simulation.call("delete_model", "crate")
        self.until(lambda pixels: self.centre(pixels) is None, "a picture without the crate")

    def test_late_subscribers_get_all_markers_at_once(self):
        self.simulation.spawn("late", CRATE, (-3.0, -3.0, 0.5, 0.0), kind="sdf")
        self.addCleanup(self.simulation.call, "delete_model", "late")
        for _ in range(2):          # the second one subscribes when nothing changes any more
            markers = Recorder("/gazebo/world_markers", MarkerArray)
            found = markers.wait(lambda messages: [marker for marker in messages[-1].markers if marker.ns == "late"],
                                 "the marker of the new model")
            markers.close()
            self.assertEqual([(marker.type, marker.scale.x, marker.pose.position.x, marker.header.frame_id)
                              for marker in found], [(Marker.CUBE, 2.0, -3.0, "odom")])

    def test_the_bag_of_a_killed_simulator_is_complete(self):
        folder, port = tempfile.mkdtemp(), free_port()
        self.addCleanup(shutil.rmtree, folder)
        bag, pictures = os.path.join(folder, "run.bag"), os.path.join(folder, "pictures")
        with Running([program("m2wr_sim", "experiment"), "--port", str(port), "m2wr_sim", "bug2.launch", "gui:=false",
                      "record:=" + bag, "pictures:=" + pictures, "real_time_factor:=0"],
                     {"ROS_MASTER_URI": "http://127.0.0.1:%d" % port}) as run:
            wait_until(lambda: run.process.poll() is not None or
                       os.path.isdir(pictures) and len(os.listdir(pictures)) > 8, "pictures in " + pictures, 120.0)
            self.assertIsNone(run.process.poll(), run.text)
            address = rosgraph.Master("/check", "http://127.0.0.1:%d" % port).lookupNode("/gazebo")
            os.kill(ServerProxy(address).getPid("/check")[2], signal.SIGKILL)
            run.wait()
        with rosbag.Bag(bag) as recorded:               # it has an index, so it was closed
            topics = recorded.get_type_and_topic_info().topics
        for topic in ("/gazebo/world_markers", "/robot_description", "/gazebo/robot_states", "/odom"):
            self.assertIn(topic, topics)
        told = run_program([program("m2wr_sim", "bag_report"), bag])
        self.assertEqual(told.returncode, 0, told.stderr)
        self.assertIn("self-contained", told.stdout)
        for name in sorted(os.listdir(pictures)):
            with Picture.open(os.path.join(pictures, name)) as picture:
                pixels = np.asarray(picture.convert("RGB"))
        self.assertGreater(marked(pixels, OBSTACLE).sum(), 2000)
        self.assertGreater(marked(pixels, ROBOT).sum(), 200)
        again = os.path.join(folder, "again")
        drawn = run_program([program("m2wr_view", "image_dump"), "--bag", bag, "--out", again])
        self.assertEqual(drawn.returncode, 0, drawn.stderr)
        self.assertGreater(len(os.listdir(again)), 3)
        figure = os.path.join(folder, "run.svg")
        drawn = run_program([program("motion_plan", "plot_run"), bag, "--out", figure])
        self.assertEqual(drawn.returncode, 0, drawn.stderr)
        self.assertGreater(os.path.getsize(figure), 10000)


if __name__ == "__main__":
    rospy.init_node("check_pictures", disable_rostime=True)
    run_checks("pictures", Pictures)

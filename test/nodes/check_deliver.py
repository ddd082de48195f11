#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""deliver.launch brings every parcel although the node of a robot ends, and refuses what is wrong by radio."""
import json
import os
import shutil
import sys
import tempfile
import unittest

import rospy
from geometry_msgs.msg import Twist
from std_msgs.msg import String
from std_srvs.srv import Trigger

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from launch_runs import Launched  # noqa: E402
from sim_probe import Recorder, run_checks, run_program, wait_until  # noqa: E402

PATIENCE = 300.0            # s of wall time for the run, also on a busy machine
WRONG = ("no JSON", "[1, 2", json.dumps({"kind": "offer"}), "x" * 30000)


class Deliver(unittest.TestCase):
    def setUp(self):
        self.folder = tempfile.mkdtemp()
        self.addCleanup(shutil.rmtree, self.folder)
        self.commands = Recorder("/robot2/cmd_vel", Twist)
        self.radio = rospy.Publisher("/robot1/radio/in", String, queue_size=len(WRONG))
        for opened in (self.commands.close, self.radio.unregister):
            self.addCleanup(opened)

    def test_a_robot_whose_node_ends_is_replaced(self):
        output = os.path.join(self.folder, "delivery")
        with Launched(["m2wr_sim", "deliver.launch", "robots:=2", "parcels:=2", "blocked:=0", "size:=14", "seed:=5",
                       "roughness:=0.5", "real_time_factor:=3", "gui:=false", "output:=" + output]) as run:
            self.commands.wait(lambda messages: any(message.linear.x > 0.1 for message in messages),
                               "robot2 that drives", PATIENCE)
            early = rospy.ServiceProxy("/robot2/pick_up", Trigger)()
            run_program(["rosnode", "kill", "/robot2/carrier"])
            wait_until(self.radio.get_num_connections, "the radio of robot1")
            for text in WRONG:
                self.radio.publish(text)
            run.wait_for_text("radio message is refused")
            run.wait(PATIENCE)
            text = run.text
        self.assertFalse(early.success)
        self.assertTrue(early.message)
        self.assertEqual(run.process.returncode, 0, text)
        self.assertIn("robot2: its node has told nothing since", text)
        self.assertIn("is open again", text)
        self.assertIn("result: 2 of 2 parcels delivered", text)
        self.assertNotIn("Traceback", text)
        with open(output + ".json", encoding="utf-8") as file:
            result = json.load(file)
        self.assertEqual([row["robot"] for row in result["parcels"]], ["robot1", "robot1"], result)
        self.assertTrue(all(row["picked_up"] < row["delivered"] <= result["time"] for row in result["parcels"]), result)
        ends = {row["robot"]: row["end"] for row in result["robots"]}
        self.assertEqual(ends["robot1"], "")
        self.assertIn("told nothing", ends["robot2"])
        self.assertGreater(os.path.getsize(output + ".png"), 10000)


if __name__ == "__main__":
    rospy.init_node("deliver_check")
    run_checks("two_robots_deliver", Deliver)

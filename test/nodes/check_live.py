#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live view in a real browser: it shows what moves, and does what keys and clicks ask for."""
import json
import os
import re
import sys
import unittest
import urllib.error
import urllib.request

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped, Twist
from websockets.sync.client import connect

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from live_browser import Page  # noqa: E402
from sim_probe import Recorder, Running, Simulation, program, run_checks, wait_until, xyz  # noqa: E402

CRATE = """<sdf version="1.6"><model name="crate"><static>1</static><link name="link"><collision name="c"><geometry>
<box><size>1 1 1</size></box></geometry></collision><visual name="v"><geometry><box><size>1 1 1</size></box></geometry>
<material><diffuse>0 0.8 0 1</diffuse></material></visual></link></model></sdf>"""
ADDRESS = re.compile(r"live view: (http://\S+)")


def live(*words):
    """Start the node; returns the program, to be used as a context manager."""
    return Running([program("m2wr_view", "live")] + list(words))


def address_of(running):
    running.wait_for_text("live view: http")
    return ADDRESS.search(running.text).group(1)


def green(pixels):
    """Return how many pixels are green."""
    red, other, blue = (pixels[..., channel].astype(int) for channel in range(3))
    return int(((other > red + 60) & (other > blue + 60)).sum())


def status_of(address, **headers):
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


class Live(unittest.TestCase):
    """One simulation of an empty world with m2wr at the origin."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.running = live("__name:=pages")
        cls.running.__enter__()
        cls.address = address_of(cls.running)

    @classmethod
    def tearDownClass(cls):
        cls.running.__exit__()

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.simulation.call("reset_world")

    def place_of(self, name):
        return xyz(self.simulation.call("get_model_state", name, "").pose.position)

    def test_keys_drive_and_the_robot_stops_after_release(self):
        with Page(self.address) as page:
            commands = Recorder("/cmd_vel", Twist)
            wait_until(page.joystick, "the joystick")
            before = page.scene()
            page.press("ArrowUp", True)
            commands.wait(lambda messages: messages[-1].linear.x == 0.5, "a command to drive")
            wait_until(lambda: self.place_of("m2wr")[0] > 0.7, "the robot at x = 0.7 m")
            page.press("ArrowUp", False)
            commands.wait(lambda messages: messages[-1].linear.x == 0.0, "a command to stop")
            wait_until(lambda: (np.abs(page.scene().astype(int) - before).max(axis=2) > 40).sum() > 300,
                       "other pixels where the robot drove")
            self.assertGreater(float(page.value("time").split()[0]), 0.0)
            self.assertEqual(page.errors(), [])

    def test_a_new_model_is_drawn_in_its_colour_until_deleted(self):
        with Page(self.address) as page:
            wait_until(lambda: green(page.scene()) < 20, "a page without green")
            self.simulation.spawn("crate", CRATE, (2.5, 1.0, 0.5, 0.0), kind="sdf")
            wait_until(lambda: green(page.scene()) > 500, "a green crate on the page")
            wait_until(lambda: (page.value("clearance") or "").endswith(" m"), "the clearance")
            page.driver.refresh()
            page.open()
            wait_until(lambda: green(page.scene()) > 500, "the crate on the page that was loaded again")
            self.simulation.call("delete_model", "crate")
            wait_until(lambda: green(page.scene()) < 20, "the page without the crate")
            self.assertEqual(page.errors(), [])

    def test_clicks_place_an_obstacle_and_send_a_goal(self):
        goals = Recorder("/move_base_simple/goal", PoseStamped)
        with Page(self.address) as page:
            before = set(self.simulation.models())
            page.choose("place a cylinder")
            page.click(330, 420)
            wait_until(lambda: set(self.simulation.models()) - before, "an obstacle in the world")
            name, = set(self.simulation.models()) - before
            self.addCleanup(self.simulation.call, "delete_model", name)
            x, y, _ = self.place_of(name)
            self.assertLess(max(abs(x), abs(y)), 20.0)
            page.choose("send a goal", present="place a cylinder")
            page.click(330, 420)
            goal = goals.wait(lambda messages: messages[-1], "a goal")
            self.assertAlmostEqual(goal.pose.position.x, x, delta=0.02)
            self.assertAlmostEqual(goal.pose.position.y, y, delta=0.02)
            self.assertEqual(goal.header.frame_id, "odom")

    def test_two_pages_pause_and_a_phone_sees_it(self):
        with Page(self.address) as one, Page(self.address, (400, 700)) as phone:
            one.press_button("pause")
            wait_until(lambda: "paused" in phone.status(), "\"paused\" on the phone")
            stopped = self.simulation.time()
            one.press_button("step")
            wait_until(lambda: self.simulation.time() > stopped, "a step")
            self.assertAlmostEqual(self.simulation.time() - stopped, 0.001, delta=1e-9)
            one.press_button("continue")
            wait_until(lambda: "paused" not in one.status(), "a page without \"paused\"")
            self.assertEqual(one.errors() + phone.errors(), [])

    def test_an_audience_can_only_watch(self):
        with live("__name:=audience", "_control:=false") as audience:
            address = address_of(audience)
            with Page(address) as page:
                self.assertEqual([text for text in ("pause", "Reset the world") if page.elements("button", text)], [])
                self.assertFalse(page.joystick())
            with connect(address.replace("http", "ws") + "m2wr") as script:
                script.send(json.dumps({"topic": "/cmd_vel", "forward": 1, "left": 0}))
                wait_until(lambda: "only watch" in json.loads(script.recv(10)).get("error", ""), "a refusal")

    def test_odd_messages_and_other_sites_are_refused(self):
        self.assertEqual(status_of(self.address, Host="elsewhere.example"), 403)
        self.assertEqual(status_of(self.address, Origin="http://elsewhere.example"), 403)
        self.assertEqual(status_of(self.address + "../../etc/passwd"), 404)
        commands = Recorder("/cmd_vel", Twist)
        with connect(self.address.replace("http", "ws") + "m2wr") as script:
            for text in ("no JSON", "[1]", "{}", "[" * 900, json.dumps({"topic": "/cmd_vel", "forward": 2, "left": 0}),
                         '{"topic": "/cmd_vel", "forward": NaN, "left": 0}',
                         json.dumps({"topic": "/nowhere", "forward": 1, "left": 0})):
                script.send(text)
                wait_until(lambda: "expected" in json.loads(script.recv(10)).get("error", "") or None,
                           "a refusal of " + text[:60]) if "nowhere" not in text else wait_until(
                    lambda: "nothing listens" in json.loads(script.recv(10)).get("error", ""), "a refusal")
            script.send(json.dumps({"topic": "/cmd_vel", "forward": 1, "left": 0}))
            commands.wait(lambda messages: messages[-1].linear.x == 0.5, "a command")
        commands.wait(lambda messages: messages[-1].linear.x == 0.0, "a stop when the page is closed")

    def test_another_address_needs_the_token(self):
        with live("__name:=open", "_host:=0.0.0.0") as node:
            link = address_of(node)
            self.assertRegex(link, r"\?token=[\w-]{20,}$")
            self.assertEqual(status_of(link), 200)
            self.assertEqual(status_of(link.partition("?")[0]), 403)
            self.assertEqual(status_of(link[:-1] + ("A" if link[-1] != "A" else "B")), 403)

    def test_a_port_that_is_taken_is_said_with_its_owner(self):
        port = self.address.rstrip("/").rpartition(":")[2]
        with live("__name:=second", "_port:=" + port) as node:
            self.assertEqual(node.wait(), 1)
            self.assertIn(":%s cannot be used" % port, node.text)
            self.assertRegex(node.text, r"\(process \d+\) has it")


if __name__ == "__main__":
    rospy.init_node("check_live", disable_rostime=True)
    run_checks("live", Live)

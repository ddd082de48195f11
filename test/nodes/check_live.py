#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live view in a real browser: it shows what moves, and does what keys and clicks ask for."""
import json
import os
import sys

import numpy as np
import rospy
from geometry_msgs.msg import Twist
from websockets.sync.client import connect

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from live_browser import Page  # noqa: E402
from live_changes import LiveChanges  # noqa: E402
from live_pages import CRATE, address_of, goals_of, green, live, status_of  # noqa: E402
from sim_probe import Recorder, run_checks, wait_until  # noqa: E402


class Live(LiveChanges):
    """What pages show and do, and what they change; one browser for all."""

    def test_keys_drive_and_the_robot_stops_after_release(self):
        page = self.page
        commands = Recorder("/cmd_vel", Twist)
        wait_until(page.joystick, "the joystick")
        for choice in ("send a goal", "select and drag"):       # a list that was used does not keep the arrow keys
            page.choose(choice)
        before = page.scene()
        page.press("ArrowUp", True)
        commands.wait(lambda messages: messages[-1].linear.x == 0.5, "a command to drive")
        wait_until(lambda: self.place_of("m2wr")[0] > 0.7, "the robot at x = 0.7 m")
        page.press("ArrowUp", False)
        commands.wait(lambda messages: messages[-1].linear.x == 0.0, "a command to stop")
        wait_until(lambda: (np.abs(page.scene().astype(int) - before).max(axis=2) > 40).sum() > 300,
                   "other pixels where the robot drove")
        self.assertGreater(float(page.value("time").split()[0]), 0.0)

    def test_a_new_model_is_drawn_in_its_colour_until_deleted(self):
        page = self.page
        wait_until(lambda: green(page.scene()) < 20, "a page without green")
        self.simulation.spawn("crate", CRATE, (2.5, 1.0, 0.5, 0.0), kind="sdf")
        wait_until(lambda: green(page.scene()) > 500, "a green crate on the page")
        wait_until(lambda: (page.value("clearance") or "").endswith(" m"), "the clearance")
        page.driver.refresh()
        page.open()
        wait_until(lambda: green(page.scene()) > 500, "the crate on the page that was loaded again")
        self.simulation.call("delete_model", "crate")
        wait_until(lambda: green(page.scene()) < 20, "the page without the crate")

    def test_clicks_place_an_obstacle_and_send_a_goal(self):
        goals = goals_of("/pages")
        page = self.page
        page.choose("place a cylinder")
        name = self.placed(page, 330, 420)
        x, y, _ = self.place_of(name)
        self.assertLess(max(abs(x), abs(y)), 20.0)
        page.choose("send a goal")
        page.click(330, 420)
        goal = goals.wait(lambda messages: messages[-1], "a goal")
        self.assertAlmostEqual(goal.pose.position.x, x, delta=0.02)
        self.assertAlmostEqual(goal.pose.position.y, y, delta=0.02)
        self.assertEqual(goal.header.frame_id, "odom")

    def test_two_pages_pause_and_a_phone_sees_it(self):
        one = self.page
        with Page(self.address, (400, 700)) as phone:
            one.press_button("pause")
            wait_until(lambda: "paused" in phone.status(), "\"paused\" on the phone")
            self.assertGreater(one.panel_height(), 0.0)
            wait_until(lambda: phone.panel_height() == 0.0, "the panel to be closed on the phone")
            stopped = self.simulation.time()
            one.press_button("step")
            wait_until(lambda: self.simulation.time() > stopped, "a step")
            self.assertAlmostEqual(self.simulation.time() - stopped, 0.001, delta=1e-9)
            one.press_button("continue")
            wait_until(lambda: "paused" not in one.status(), "a page without \"paused\"")
            self.assertEqual(phone.errors(), [])

    def test_status_never_covers_the_panel(self):
        self.addCleanup(self.page.resize_to_window)
        for width in (1400, 900, 760, 600):
            self.page.resize(width, 700)
            wait_until(lambda: not self.page.covers_panel(), "a status beside the panel at %d pixels" % width)

    def test_nodes_frames_and_parameters_are_listed(self):
        self.page.unfold("Nodes, frames, parameters")
        for text in ("publishes /clock", "link_chassis", "max_update_rate = "):
            wait_until(lambda: text in self.page.text(), text + " in the lists")

    def test_an_audience_can_only_watch(self):
        with live("__name:=audience", "_control:=false") as audience:
            address = address_of(audience)
            page = self.page
            with page.elsewhere(address):
                wait_until(lambda: page.elements("input", "free", "value"), "the panel")
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

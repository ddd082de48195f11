#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""The live view as Gazebo's window in a real browser: drag a box, load a world, record; and input that is invalid."""
import os
import socket
import sys
import tempfile
import unittest

import numpy as np
import rospy
from geometry_msgs.msg import PoseStamped

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from check_live import CRATE, address_of, green, live, status_of  # noqa: E402
from live_browser import Page  # noqa: E402
from sim_probe import Recorder, Simulation, run_checks, wait_until, xyz  # noqa: E402

MARKUP = "<img src=x onerror=\"window.broken=1\"><b>cart</b>"
CART = """<robot name="cart"><link name="base"><visual><geometry><mesh filename="file://%s"/></geometry></visual>
</link></robot>"""


class LiveControl(unittest.TestCase):
    """One simulation of an empty world with m2wr at the origin, and a live view."""

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
        self.simulation.call("reset_world")

    def place_of(self, name):
        return np.array(xyz(self.simulation.call("get_model_state", name, "").pose.position))

    def upgrade(self):
        """Return a socket that has asked for a websocket."""
        host, port = self.address.split("/")[2].split(":")
        connection = socket.create_connection((host, int(port)), 30.0)
        connection.sendall((
            "GET /m2wr HTTP/1.1\r\nHost: %s:%s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n" % (host, port)).encode())
        return connection

    def advances(self):
        before = self.simulation.time()
        wait_until(lambda: self.simulation.time() > before, "simulated time that advances")

    def seen_from_above(self, page):
        """Return the box of a new obstacle (name, place of its middle [pixels]) and pixels per metre."""
        goals = Recorder("/move_base_simple/goal", PoseStamped)
        page.choose("top", present="free")
        page.choose("send a goal")
        places = []
        for pixel in ((200, 300), (300, 300)):
            count = len(places)
            page.click(*pixel)
            found = goals.wait(lambda messages, count=count: messages[count:] and messages[-1], "a goal")
            places.append(found.pose.position.x)
        page.choose("place a box", present="send a goal")
        before = set(self.simulation.models())
        page.click(300, 200)
        wait_until(lambda: set(self.simulation.models()) - before, "a box")
        name, = set(self.simulation.models()) - before
        self.addCleanup(self.simulation.call, "delete_model", name)
        page.choose("select and drag", present="place a box")
        return name, (300, 200), 100.0 / (places[1] - places[0])

    def selected(self, page, name, pixel):
        """Click on a model until the panel shows its name."""
        def click():
            page.click(*pixel)
            return page.elements("input", name, "value")
        wait_until(click, "the name of the selected model")

    def test_a_box_is_dragged_and_a_page_may_close_meanwhile(self):
        with Page(self.address) as page:
            name, (x, y), metre = self.seen_from_above(page)
            begin, handle = self.place_of(name), (x + 1.0 * metre, y)
            wait_until(lambda: green(page.scene()) < 20, "a scene without the gizmo")
            self.selected(page, name, (x, y))
            wait_until(lambda: green(page.scene()) > 20, "the gizmo, whose y axis is green")
            page.drag(handle, (handle[0] + 2.0 * metre, y))
            wait_until(lambda: self.place_of(name)[0] > begin[0] + 1.0, "a box that was dragged along x")
            moved = self.place_of(name)
            self.assertAlmostEqual(moved[1], begin[1], delta=0.1)
            self.assertEqual(page.errors(), [])
            handle = (x + (moved[0] - begin[0] + 1.0) * metre, y)
            page.drag(handle, (handle[0] - 1.5 * metre, y), release=False)
        self.advances()
        with Page(self.address) as page:
            self.assertEqual(page.errors(), [])

    def test_another_world_replaces_the_models_but_no_robot(self):
        with Page(self.address) as page:
            page.choose("shapes", present="as it is")
            wait_until(lambda: {"m2wr", "ground_plane"} < set(self.simulation.models()), "the models of another world")
            shapes = set(self.simulation.models())
            page.choose("empty", present="shapes")
            wait_until(lambda: set(self.simulation.models()) == {"m2wr", "ground_plane"}, "an empty world")
            self.assertGreaterEqual(len(shapes), 4)
            self.assertEqual(page.errors(), [])

    def test_a_recording_is_made_and_downloaded(self):
        with Page(self.address) as page, tempfile.TemporaryDirectory() as folder:
            page.driver.execute_cdp_cmd("Page.setDownloadBehavior", {"behavior": "allow", "downloadPath": folder})
            page.unfold("Recording")
            page.press_button("record")
            wait_until(lambda: int((page.value("recording") or "0 s").split()[0]) >= 3, "three seconds of recording")
            page.press_button("stop")
            wait_until(lambda: page.value("recording") is None, "the end of the recording")
            for kind, first in (("bag", b"#ROSBAG V2.0"), ("film", b"GIF8")):
                page.press_button(kind)
                name = "run." + {"bag": "bag", "film": "gif"}[kind]
                page.save(name)
                path = os.path.join(folder, name)
                wait_until(lambda path=path: os.path.exists(path), "the file " + name)
                with open(path, "rb") as stream:
                    self.assertEqual(stream.read(len(first)), first)

    def test_a_name_with_markup_is_shown_as_text(self):
        self.simulation.spawn(MARKUP, CRATE, (2.0, 0.0, 0.5, 0.0), kind="sdf")
        self.addCleanup(self.simulation.call, "delete_model", MARKUP)
        with Page(self.address) as page:
            page.choose("top", present="free")
            wait_until(lambda: page.elements("input", MARKUP, "value") or any(
                page.click(x, 278) for x in range(440, 560, 15)), "the name in the panel")
            self.assertEqual(page.driver.execute_script(
                "return [window.broken === undefined, document.querySelectorAll('img[src=x]').length]"), [True, 0])

    def test_a_mesh_that_is_too_large_is_said_on_the_page(self):
        with tempfile.NamedTemporaryFile(suffix=".stl") as mesh:
            os.truncate(mesh.name, 1 << 30)
            rospy.set_param("/big/robot_description", CART % mesh.name)
            self.addCleanup(rospy.delete_param, "/big/robot_description")
            with Page(self.address) as page:
                wait_until(lambda: "1073741824 bytes; expected at most" in page.status(), "the reason on the page")
            self.advances()

    def test_two_hundred_connections_stop_nothing(self):
        held = [self.upgrade() for _ in range(200)]
        answers = [connection.recv(12) for connection in held]
        self.assertGreaterEqual(answers.count(b"HTTP/1.1 101"), 64)
        self.assertEqual(answers.count(b"HTTP/1.1 101") + answers.count(b"HTTP/1.1 503"), 200)
        self.advances()
        self.assertEqual(status_of(self.address), 200)
        for connection in held:
            connection.close()
        with Page(self.address) as page:
            self.assertEqual(page.errors(), [])

    def test_without_a_port_the_next_free_one_is_taken(self):
        with live("__name:=second") as node:
            first, second = (int(address.rstrip("/").rpartition(":")[2])
                             for address in (self.address, address_of(node)))
            self.assertNotEqual(second, first)      # a page of another test may have ended meanwhile


if __name__ == "__main__":
    rospy.init_node("check_live_control", disable_rostime=True)
    run_checks("live_control", LiveControl)

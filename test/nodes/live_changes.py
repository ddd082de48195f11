# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the live view as Gazebo's window: drag a box, place a model, load a world, record; and invalid input."""
import math
import os
import socket
import tempfile

import numpy as np
import rospy
from sensor_msgs.msg import LaserScan

from live_pages import CRATE, LiveCase, RawPage, address_of, goals_of, green, live, status_of
from sim_probe import Recorder, Running, program, wait_until

DRAWN = 180.0               # s in which a film is drawn, with low priority
THIN = 20                   # of 255; the green axis of the gizmo has it, see green()
MARKUP = "<img src=x onerror=\"window.broken=1\"><b>cart</b>"
CART = """<robot name="cart"><link name="base"><visual><geometry><mesh filename="file://%s"/></geometry></visual>
</link></robot>"""


class LiveChanges(LiveCase):
    """What pages change in the simulation."""

    def upgrade(self):
        """Return a socket that has asked for a websocket."""
        host, port = self.address.split("/")[2].split(":")
        connection = socket.create_connection((host, int(port)), 30.0)
        connection.sendall((
            "GET /m2wr HTTP/1.1\r\nHost: %s:%s\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
            "Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: AAAAAAAAAAAAAAAAAAAAAA==\r\n\r\n" % (host, port)).encode())
        return connection

    def from_above(self, page):
        """Look from above; return where the pixel (200, 300) is [m], and pixels per metre."""
        goals = goals_of("/pages")
        self.addCleanup(goals.close)
        page.choose("free")
        page.choose("from above")
        page.choose("send a goal")

        def goal_at(*pixel):
            known = len(goals.messages)
            found = self.clicked(page, *pixel, lambda: goals.messages[known:], "a goal")[-1].pose.position
            return np.array((found.x, found.y))

        def settled():
            first, right, again = goal_at(200, 300), goal_at(300, 300), goal_at(200, 300)
            moves = np.abs(again - first).max() > 0.01 or abs(right[1] - first[1]) > 0.01
            return None if moves else (first, 100.0 / (right[0] - first[0]))
        return wait_until(settled, "a camera that looks from above and rests")

    def box_from_above(self, page, x, y):
        """Return a new box at a place [m]: its name, the place of its middle [pixels], and pixels per metre."""
        corner, metre = self.from_above(page)
        pixel = (200 + metre * (x - corner[0]), 300 - metre * (y - corner[1]))
        page.choose("place a box")
        name = self.placed(page, *pixel)
        page.choose("select and drag")
        return name, pixel, metre

    def selected(self, page, name, pixel):
        """Click on a model until the panel shows its name."""
        def click():
            page.click(*pixel)
            return page.elements("input", name, "value")
        wait_until(click, "the name of the selected model")

    def test_the_robot_avoids_a_box_dragged_in_its_way(self):
        page, ahead = self.page, 1.6
        scans = Recorder("/m2wr/laser/scan", LaserScan)
        self.addCleanup(scans.close)
        scans.wait(lambda messages: np.all(np.isinf(messages[-1].ranges)), "a scan without an obstacle")
        name, (x, y), metre = self.box_from_above(page, ahead, 3.0)
        wait_until(lambda: green(page.scene(), THIN) < 20, "a scene without the gizmo")
        self.selected(page, name, (x, y))
        wait_until(lambda: green(page.scene(), THIN) > 20, "the gizmo, whose y axis is green")
        handle = (x, y - metre)
        page.drag(handle, (x, handle[1] + 3.0 * metre))
        wait_until(lambda: abs(self.place_of(name)[1]) < 0.2, "a box that was dragged to y = 0")
        self.assertAlmostEqual(self.place_of(name)[0], ahead, delta=0.1)
        nearest = ahead - 0.25 - 0.15       # half the box; the laser is 0.15 m before the robot's middle
        scans.wait(lambda messages: abs(min(messages[-1].ranges) - nearest) < 0.15, "a scan that shows the box")
        with Running([program("motion_plan", "obstacle_avoidance.py")]):
            wait_until(lambda: abs(self.place_of("m2wr")[1]) > 0.3, "a robot that turns away from the box")
        self.assertEqual(page.value("contacts"), "0")

    def test_a_page_may_close_while_a_box_is_dragged(self):
        page = self.page
        name, (x, y), metre = self.box_from_above(page, -2.0, 0.0)
        self.selected(page, name, (x, y))
        begin = self.place_of(name)
        wait_until(lambda: green(page.scene(), THIN) > 20, "the gizmo")
        page.drag((x + metre, y), (x, y), release=False)
        wait_until(lambda: self.place_of(name)[0] < begin[0] - 0.5, "a box that is dragged along x")
        page.driver.get("about:blank")
        self.advances()
        page.open()

    def test_the_list_of_speeds_shows_the_factor_of_the_simulation(self):
        page, now = self.page, self.simulation.call("get_physics_properties")

        def set_factor(factor):
            self.simulation.call("set_physics_properties", now.time_step, factor / now.time_step, now.gravity,
                                 now.ode_config)
        self.addCleanup(set_factor, 1.0)
        wait_until(lambda: page.elements("input", "1", "value"), "a list that shows 1")
        set_factor(0.75)
        wait_until(lambda: page.elements("input", "0.75", "value"), "a list that shows 0.75")
        page.choose("2")
        wait_until(lambda: abs(self.simulation.call("get_physics_properties").max_update_rate * now.time_step - 2.0)
                   < 1e-9, "a simulation at twice real time")

    def test_another_world_replaces_the_models_but_no_robot(self):
        page = self.page
        page.choose("shapes")
        wait_until(lambda: {"m2wr", "ground_plane"} < set(self.simulation.models())
                   and len(self.simulation.models()) >= 4, "the models of another world")
        page.choose("empty")
        wait_until(lambda: set(self.simulation.models()) == {"m2wr", "ground_plane"}, "an empty world")

    def downloaded(self, folder, kind):
        """Press the button for a file, "bag" or "film"; return its content."""
        page, name = self.page, "run." + {"bag": "bag", "film": "gif"}[kind]
        path = os.path.join(folder, name)
        if os.path.exists(path):
            os.remove(path)
        self.repeated(lambda: page.press_button(kind), lambda: page.elements("a", name, "download"),
                      "an offer of " + name, DRAWN)
        # the browser makes the file empty, then replaces it by the whole one
        self.repeated(lambda: page.save(name), lambda: os.path.exists(path) and os.path.getsize(path) > 0,
                      "the content of " + name, DRAWN)
        with open(path, "rb") as stream:
            return stream.read()

    def test_a_recording_is_made_downloaded_and_replayed(self):
        page = self.page
        with tempfile.TemporaryDirectory() as folder:
            page.driver.execute_cdp_cmd("Browser.setDownloadBehavior", {"behavior": "allow", "downloadPath": folder})
            page.unfold("Recording")
            page.press_button("record")
            wait_until(lambda: int((page.value("recording") or "0 s").split()[0]) >= 1, "a second of recording")
            begin = self.simulation.time()
            wait_until(lambda: self.simulation.time() > begin + 1.0, "a recorded second of simulated time")
            page.press_button("stop")
            wait_until(lambda: page.value("recording") is None, "the end of the recording")
            bag = self.downloaded(folder, "bag")
            self.assertEqual(bag[:13], b"#ROSBAG V2.0\n")
            self.assertEqual(self.downloaded(folder, "film")[:4], b"GIF8")
            kept = os.path.join(folder, "kept.bag")
            with open(kept, "wb") as stream:
                stream.write(bag)
            with live("--bag", kept) as replay, page.elsewhere(address_of(replay)):
                wait_until(lambda: float(page.value("time").split()[0]) > 0.5, "a recorded run that is shown")
                self.assertEqual(self.downloaded(folder, "bag"), bag)

    def test_a_model_is_placed_by_a_click(self):
        page = self.page
        page.choose("place the model barrel")
        self.assertEqual(self.placed(page, 330, 420), "barrel_1")
        page.choose("select and drag")      # no other test's click is to place one more
        self.assertLess(abs(self.place_of("barrel_1")[2]), 0.6)

    def test_a_name_with_markup_is_shown_as_text(self):
        self.simulation.spawn(MARKUP, CRATE, (2.0, 0.0, 0.5, 0.0), kind="sdf")
        self.addCleanup(self.simulation.call, "delete_model", MARKUP)
        page = self.page
        page.choose("from above")
        page.choose("select and drag")
        wait_until(lambda: page.elements("input", MARKUP, "value") or any(
            page.click(x, 278) for x in range(440, 560, 15)), "the name in the panel")
        self.assertEqual(page.driver.execute_script(
            "return [window.broken === undefined, document.querySelectorAll('img[src=x]').length]"), [True, 0])

    def test_a_mesh_that_is_too_large_is_said_on_the_page(self):
        with tempfile.NamedTemporaryFile(suffix=".stl") as mesh:
            os.truncate(mesh.name, 1 << 30)
            rospy.set_param("/big/robot_description", CART % mesh.name)
            self.addCleanup(rospy.delete_param, "/big/robot_description")
            wait_until(lambda: "1073741824 bytes; expected at most" in self.page.status(), "the reason on the page")
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
        self.page.open()

    def test_a_goal_that_is_no_number_is_refused_with_why(self):
        goals = goals_of("/pages")
        self.addCleanup(goals.close)
        with RawPage(self.address) as page:
            page.choose("send a goal")
            for bad in (math.nan, math.inf):
                page.click((bad, 0.0, 5.0), (0.0, 0.0, -1.0))
                self.assertRegex(page.complaint(), r"from [(\[]%g, 0.0, 5.0[)\]] .*expected three finite numbers" % bad)
            page.click((1.0, 2.0, 5.0), (0.0, 0.0, 1.0))
            self.assertIn("not on the ground", page.complaint())
            page.click((1.0, 2.0, 5.0), (0.0, 0.0, -1.0))
            goal = goals.wait(lambda messages: messages[-1], "a goal").pose.position
        self.assertEqual((goal.x, goal.y, len(goals.messages)), (1.0, 2.0, 1))
        self.advances()

    def test_without_a_port_the_next_free_one_is_taken(self):
        with live("__name:=next") as node:
            first, second = (int(address.rstrip("/").rpartition(":")[2])
                             for address in (self.address, address_of(node)))
            self.assertNotEqual(second, first)      # a page of another test may have ended meanwhile

# SPDX-License-Identifier: BSD-3-Clause
"""What the tests of the live view share: the node, one page for all tests of a class, and what is expected of it."""
import re
import time
import unittest
import urllib.error
import urllib.request
import xmlrpc.client

import msgspec
import numpy as np
import rosgraph
import rospy
import viser
import zstandard
from geometry_msgs.msg import PoseStamped
from websockets.sync.client import connect

from live_browser import Page
from m2wr_live.web.layers import LAYERS
from sim_probe import PATIENCE, Recorder, Running, Simulation, program, wait_until, xyz

CRATE = """<sdf version="1.6"><model name="crate"><static>1</static><link name="link"><collision name="c"><geometry>
<box><size>1 1 1</size></box></geometry></collision><visual name="v"><geometry><box><size>1 1 1</size></box></geometry>
<material><diffuse>0 0.8 0 1</diffuse></material></visual></link></model></sdf>"""
GOAL = "/move_base_simple/goal"
LAST = LAYERS[-1][0]
CLICK = 15.0        # s after which a click is repeated
ADDRESS = re.compile(r"live view: (http://\S+)")


def live(*words):
    """Start the node; returns the program, to be used as a context manager."""
    return Running([program("m2wr_view", "live")] + list(words))


def address_of(running):
    running.wait_for_text("live view: http")
    return ADDRESS.search(running.text).group(1)


def green(pixels, least=60):
    """Return how many pixels have ``least`` more green than red and blue; thin lines are blended with what is below."""
    red, other, blue = (pixels[..., channel].astype(int) for channel in range(3))
    return int(((other > red + least) & (other > blue + least)).sum())


def status_of(address, **headers):
    """Return the HTTP status of an address."""
    try:
        with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=10) as answer:
            return answer.status
    except urllib.error.HTTPError as error:
        return error.code


def goals_of(node):
    """Return the recorder of goals as soon as a live view, given by its node's name, is connected to it.

    A subscriber counts a publisher before the connection is made; the publisher refuses goals until then.
    """
    goals = Recorder(GOAL, PoseStamped)

    def connected():
        try:
            publisher = xmlrpc.client.ServerProxy(rosgraph.Master(rospy.get_name()).lookupNode(node))
            return any(link[2] == "o" and link[4] == GOAL and link[5] for link in publisher.getBusInfo("/live")[2])
        except OSError:         # the node is about to end
            return False
    wait_until(connected, "a connection from %s for goals" % node)
    return goals


class RawPage:
    """A program that speaks viser's protocol as a page does, for messages that no browser sends."""

    def __init__(self, address):
        self._socket = connect(address.replace("http", "ws", 1), subprotocols=["viser-v" + viser.__version__],
                               max_size=None)
        self._waiting = []                  # messages of the newest window that were not looked at

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()

    def _next(self, condition, what):
        """Return the first message that fits."""
        deadline = time.monotonic() + PATIENCE
        while True:
            while self._waiting:
                message = self._waiting.pop(0)
                if condition(message):
                    return message
            data = self._socket.recv(max(0.0, deadline - time.monotonic()))
            size = int.from_bytes(data[8:16], "little")
            text = msgspec.msgpack.decode(zstandard.ZstdDecompressor().decompress(data[16:16 + size]))
            self._waiting = text["messages"]
            if time.monotonic() > deadline:
                raise AssertionError("waited for " + what)

    def _send(self, kind, **fields):
        self._socket.send(msgspec.msgpack.encode(dict(fields, type=kind)))

    def choose(self, option):
        """Choose an option of a list of the panel."""
        self._send("ViewerCameraMessage", wxyz=[1, 0, 0, 0], position=[0, 0, 5], fov=1.0, near=0.1, far=100.0,
                   image_height=700, image_width=900, look_at=[0, 0, 0], up_direction=[0, 0, 1])
        found = self._next(lambda message: message["type"] == "GuiDropdownMessage"
                           and option in message["props"]["options"], "the list with " + option)
        self._next(lambda message: message["type"] == "GuiCheckboxMessage" and message["props"]["label"] == LAST,
                   "the last control of the panel; clicks before it are not answered")
        self._send("GuiUpdateMessage", uuid=found["uuid"], updates={"value": option})

    def click(self, origin, direction):
        """Click along a ray [m]."""
        self._send("ScenePointerMessage", event_type="click", ray_origin=origin, ray_direction=direction,
                   screen_pos=[[0.5, 0.5]], modifier=None)

    def complaint(self):
        """Return the text that tells the user what is wrong."""
        return self._next(lambda message: message["type"] == "NotificationShowMessage",
                          "a complaint")["props"]["body"]


class LiveCase(unittest.TestCase):
    """One simulation of an empty world with m2wr at the origin, a live view, and a page of it."""

    @classmethod
    def setUpClass(cls):
        cls.simulation = Simulation()
        cls.simulation.wait_for_model("m2wr")
        cls.running = live("__name:=pages")
        cls.running.__enter__()
        cls.addClassCleanup(cls.running.__exit__)
        cls.address = address_of(cls.running)
        cls.page = Page(cls.address)
        cls.page.__enter__()
        cls.addClassCleanup(cls.page.__exit__)

    def setUp(self):
        self.simulation.call("unpause_physics")
        self.simulation.call("reset_world")

    def tearDown(self):
        self.assertEqual(self.page.errors(), [])

    @staticmethod
    def repeated(action, effect, what, patience=PATIENCE):
        """Do what a user does until ``effect()`` is true; return its value.

        What is clicked may move at that moment, and a list of the panel that is still closing takes a click.
        """
        def attempt():
            action()
            try:
                return wait_until(effect, what, CLICK)
            except AssertionError:
                return None
        return wait_until(attempt, what, patience)

    def clicked(self, page, x, y, effect, what):
        """Click at a place of the page [pixels] until ``effect()`` is true; return its value."""
        return self.repeated(lambda: page.click(x, y), effect, what)

    def placed(self, page, x, y):
        """Click at a place of the page [pixels] until a model is added, which the test deletes; return its name."""
        before = set(self.simulation.models())
        added = self.clicked(page, x, y, lambda: set(self.simulation.models()) - before, "a model")
        for name in added:
            self.addCleanup(self.simulation.call, "delete_model", name)
        return min(added)

    def place_of(self, name):
        return np.array(xyz(self.simulation.call("get_model_state", name, "").pose.position))

    def advances(self):
        before = self.simulation.time()
        wait_until(lambda: self.simulation.time() > before, "simulated time that advances")

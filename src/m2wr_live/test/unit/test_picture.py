# SPDX-License-Identifier: BSD-3-Clause
"""What is sent to pages while ten robots drive: few messages, each encoded once for all pages."""
import math

import numpy as np
import pytest

from m2wr_live.scene.live_scene import LiveScene
from m2wr_live.scene.robot_model import read_robot_model
from m2wr_live.web.picture import SELDOM, Picture
from m2wr_live.web.server import PageServer
from m2wr_node.listening import free_port
from m2wr_node.web_access import Access

ROBOTS, PICTURES = 10, 30
URDF = """<robot name="cart"><link name="base"><visual><geometry><box size="1 2 3"/></geometry></visual></link>
<link name="wheel"><visual><geometry><cylinder radius="0.5" length="0.1"/></geometry></visual></link>
<link name="ball"><visual><geometry><sphere radius="0.5"/></geometry></visual></link>
<joint name="w" type="continuous"><parent link="base"/><child link="wheel"/><origin xyz="0 0.2 0"/></joint>
<joint name="b" type="continuous"><parent link="base"/><child link="ball"/><origin xyz="0 0.4 0"/></joint></robot>"""
NAMES = ["cart%d::%s" % (number, link) for number in range(ROBOTS) for link in ("base", "wheel", "ball")]


@pytest.fixture
def pages(tmp_path):
    server = PageServer("127.0.0.1", free_port("127.0.0.1", 0), Access("", "c"), str(tmp_path))
    yield server.viser
    server.stop()


class Driving:
    """Ten robots side by side, of which some drive along x, one step of 5 cm a picture."""

    def __init__(self, viser):
        self.scene, self.picture = LiveScene(), None
        self.scene.take_description("d", read_robot_model(URDF, lambda _: None))
        self.buffer = viser._websock_server.get_message_buffer()
        self.place(0.0, ROBOTS)
        self.picture = Picture(viser.scene, self.scene)
        self.picture.draw()

    def place(self, x, driving):
        poses = [(x * (number < driving), float(number), 0.0, 0.0, 0.0, 0.0, 1.0)
                 for number in range(ROBOTS) for _ in range(3)]
        self.scene.take_links(NAMES, np.array(poses))
        self.scene.beams = {"/scan%d" % number: np.full((36, 2, 3), x) for number in range(driving)}
        self.scene.update()

    def drive(self, pictures, driving=ROBOTS):
        """Return how many messages were sent."""
        before = self.buffer.message_counter
        for number in range(pictures):
            self.place(0.05 * (number + 1), driving)
            self.picture.draw()
        return self.buffer.message_counter - before


def test_ten_robots_take_few_messages(pages):
    driving = Driving(pages)
    driving.drive(PICTURES)
    count = driving.drive(PICTURES)
    kinds, seldom = 3, PICTURES / SELDOM        # box, cylinder and sphere: where they are; then names, beams, tail
    chunks = ROBOTS * 2 * 5                     # of trails: remove, node, visibility, place, rotation
    assert kinds * PICTURES <= count <= kinds * PICTURES + seldom * (ROBOTS + 2) + chunks


def test_robots_that_rest_are_not_sent_again(pages):
    driving = Driving(pages)
    driving.drive(3 * SELDOM)
    assert driving.drive(3 * SELDOM, driving=0) > 0
    assert driving.drive(3 * SELDOM, driving=0) == 0


def trail_of(driving):
    """Return the segments that pages show of all trails, sorted."""
    picture = driving.picture._trails
    nodes = [node.points for chunks in picture._nodes.values() for node in chunks.values()]
    nodes.append(picture._tail._node.points)
    shown = np.concatenate(nodes)
    return sorted(shown[shown[:, 0, 2] > -1.0].reshape(-1, 6).astype(float).round(3).tolist())


@pytest.mark.parametrize("pictures", [7, 20, 21, 119, 120, 121, 300])
def test_a_trail_is_shown_without_a_gap(pages, pictures):
    driving = Driving(pages)
    driving.drive(SELDOM * math.ceil(pictures / SELDOM))
    driving.picture._trails.draw()
    trail = driving.scene.robots["cart0"].trail
    expected = sorted([a[0], float(number), 0.02, b[0], float(number), 0.02]
                      for number in range(ROBOTS) for a, b in zip(trail, trail[1:]))
    np.testing.assert_allclose(trail_of(driving), expected, atol=1e-3)


def test_a_trail_that_is_reset_is_removed(pages):
    driving = Driving(pages)
    driving.drive(150)
    driving.scene.forget_run()
    driving.picture._trails.draw()
    assert trail_of(driving) == []


def test_beams_of_a_robot_that_is_deleted_are_removed(pages):
    driving = Driving(pages)
    driving.drive(SELDOM)
    shown = driving.picture._beams._node
    assert (shown.points[:, 0, 2] > -1.0).sum() == 36 * ROBOTS
    driving.drive(SELDOM, driving=1)
    assert (driving.picture._beams._node.points[:, 0, 2] > -1.0).sum() == 36

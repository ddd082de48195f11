# SPDX-License-Identifier: BSD-3-Clause
"""Gymnasium environments in the live view, without a ROS master."""
import time
import urllib.request

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="the optional Python package gymnasium is not installed")
pytest.importorskip("viser", reason="viser is not installed")

import m2wr_sim.api.gym_env  # noqa: E402, F401   registers the environments


@pytest.fixture
def env():
    env = gymnasium.make("m2wr/Bug2World02-v0", render_mode="human")
    env.reset(seed=1)
    yield env
    env.close()


def test_pages_see_robot_world_scan_and_mark(env):
    env.step(np.array([0.3, 0.0], np.float32))
    scene = env.unwrapped._picture._scene
    robot = scene.robots["m2wr"]
    x, y, _ = env.unwrapped._sim.pose()[0]
    assert robot.pose[:2, 3] == pytest.approx((x, y), abs=1e-9) and len(robot.model.shapes) >= 4
    assert {"link_chassis", "link_left_wheel"} <= set(robot.poses)
    assert len({shape.owner for shape in scene.markers.shapes}) > 5
    beams, = scene.beams.values()
    place = robot.pose.dot((0.15, 0.0, 0.05, 1.0))[:3]           # of the laser, in link_chassis
    assert beams[:, 0] == pytest.approx(np.tile(place, (len(beams), 1)), abs=1e-6)
    reach = np.hypot(*(beams[:, 1] - beams[:, 0])[:, :2].T)
    assert 0.2 < reach.min() < 2.0                          # the walls of the corridor
    assert scene.hits == [(0.0, -4.0)] and scene.now == pytest.approx(0.1)
    pages = env.unwrapped._picture.pages
    assert any(line.startswith("contacts  0") for line in pages.server.status["lines"])
    assert env.render() is None


def test_a_page_is_served_and_closed_with_the_environment(env):
    port = env.unwrapped._picture.pages.viser.get_port()
    with urllib.request.urlopen("http://localhost:{}/".format(port), timeout=20.0) as page:
        assert b"live.js" in page.read()
    env.close()
    with pytest.raises(OSError):
        urllib.request.urlopen("http://localhost:{}/".format(port), timeout=20.0)


def test_time_passes_no_faster_than_on_the_wall(env):
    begun = time.monotonic()
    for _ in range(5):
        env.step(np.zeros(2, np.float32))
    assert time.monotonic() - begun > 0.35                  # the first step fixes the time of the second


def test_a_new_episode_forgets_the_trail(env):
    for _ in range(4):
        env.step(np.array([0.5, 0.0], np.float32))
    scene = env.unwrapped._picture._scene
    assert len(scene.robots["m2wr"].trail) > 1
    env.reset(seed=2)
    assert len(scene.robots["m2wr"].trail) == 1 and scene.hits and scene.now == 0.0

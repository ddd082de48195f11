# SPDX-License-Identifier: BSD-3-Clause
"""Clicks: the node's parameters, and what a click does in a world that a test plays."""
import math

import pytest
import rospy
from geometry_msgs.msg import PointStamped

from m2wr_sim.errors import SimError
from m2wr_tools.obstacles import click as click_obstacles
from m2wr_tools.obstacles.click import ClickObstacles, read_parameters
from m2wr_tools.obstacles.obstacle import Obstacle
from m2wr_view.outlines import M2WR_FOOTPRINT

UPRIGHT = (0.0, 0.0, 0.0, 1.0)


def read(**values):
    return read_parameters(lambda name, default: values.get(name[1:], default))


def test_the_defaults_are_a_box_that_stays():
    config = read()
    assert config.obstacle == Obstacle("box", (0.5, 0.5, 0.5)) and config.delete_on_click and config.frame == "odom"


def test_all_parameters_count():
    config = read(shape="cylinder", size=[0.2, 1], mass=3, colour="red", yaw=1, delete_on_click=False, frame="/world_")
    assert (config.obstacle.kind, config.obstacle.size, config.obstacle.mass) == ("cylinder", (0.2, 1.0), 3.0)
    assert (config.yaw, config.delete_on_click, config.frame) == (1.0, False, "world_")


@pytest.mark.parametrize("values, words", [
    ({"shape": "cone"}, "~shape is 'cone'"), ({"size": "big"}, "~size is 'big'"), ({"size": [1, 1]}, "expected 3"),
    ({"size": [1, 1, -1]}, "height"), ({"size": [1, 1, True]}, "~size"), ({"mass": "heavy"}, "~mass is 'heavy'"),
    ({"mass": -1}, "mass"), ({"yaw": math.nan}, "~yaw"), ({"colour": "reddish"}, "reddish")])
def test_a_bad_parameter_is_named(values, words):
    with pytest.raises(SimError, match=words):
        read(**values)


class FakeWorld:
    """A robot at the origin, and what clicks have made."""

    def __init__(self):
        self.models = {}

    def obstacles(self):
        return dict(self.models)

    def robots(self):
        return {"m2wr": ((0.0, 0.0, 0.1), UPRIGHT)}

    def add(self, obstacle, position, yaw=0.0, name=""):
        name = "obstacle%d" % (len(self.models) + 1)
        self.models[name] = (obstacle.kind, obstacle.size, (position, UPRIGHT))
        return name

    def delete(self, name):
        del self.models[name]


@pytest.fixture
def world(monkeypatch):
    monkeypatch.setattr(click_obstacles, "robot_footprint", lambda: M2WR_FOOTPRINT)
    monkeypatch.setattr(rospy, "loginfo", lambda *_: None)
    monkeypatch.setattr(rospy, "logwarn", lambda *_: None)
    return FakeWorld()


def click(node, x, y, frame="odom"):
    message = PointStamped()
    message.header.frame_id, message.point.x, message.point.y = frame, x, y
    node.answer(message)


def test_a_click_adds_and_a_click_on_it_deletes(world):
    node = ClickObstacles(read(), world)
    click(node, 2.0, 1.0)
    assert list(world.models) == ["obstacle1"] and world.models["obstacle1"][2][0] == (2.0, 1.0, 0.0)
    click(node, 3.0, 1.0, "world")
    assert len(world.models) == 2
    click(node, 2.26, 1.0)          # a centimetre beside its side
    assert list(world.models) == ["obstacle2"]


def test_deleting_can_be_switched_off(world):
    node = ClickObstacles(read(delete_on_click=False), world)
    click(node, 2.0, 1.0)
    click(node, 2.0, 1.0)
    assert len(world.models) == 2


def test_nothing_is_put_into_a_robot(world):
    click(ClickObstacles(read(), world), 0.3, 0.0)
    assert not world.models


@pytest.mark.parametrize("x", [math.nan, math.inf])
def test_a_click_nowhere_is_refused(world, x):
    with pytest.raises(SimError, match="finite"):
        click(ClickObstacles(read(), world), x, 0.0)
    assert not world.models

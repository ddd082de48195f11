# SPDX-License-Identifier: BSD-3-Clause
"""What the node explore says about maps that it cannot use, and about what is missing; without a master."""
from types import SimpleNamespace

import numpy as np
import pytest
import rospy
from map_msgs.msg import OccupancyGridUpdate
from nav_msgs.msg import OccupancyGrid

from m2wr_exploration.ros.explore_node import ExploreNode
from m2wr_exploration.ros.map_input import MapInput
from m2wr_navigation.ros.transforms import TransformError


@pytest.fixture
def said(monkeypatch):
    """Return the list of all warnings; nothing is subscribed."""
    found = []
    monkeypatch.setattr(rospy, "Subscriber", lambda *args, **more: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: found.append(text))
    return found


def grid(columns=40, rows=20, resolution=0.05, x=0.0, y=0.0, frame="map"):
    message = OccupancyGrid()
    message.header.frame_id = frame
    message.info.width, message.info.height, message.info.resolution = columns, rows, resolution
    message.info.origin.position.x, message.info.origin.position.y = x, y
    message.info.origin.orientation.w = 1.0
    message.data = [0] * (columns * rows)
    return message


def given(*messages):
    made = MapInput("costmap", "costmap_updates")
    for message in messages:
        made._on_map(message)
    return made


def test_a_map_that_shrinks_is_told_and_used(said):
    made = given(grid(), grid(columns=30))
    assert said == ["the map on /costmap has shrunk from x 0.0 to 2.0 m, y 0.0 to 1.0 m to x 0.0 to 1.5 m, y 0.0 to "
                    "1.0 m; what is outside is unknown again"]
    assert made.snapshot().shape == (20, 30)


def test_a_map_that_grows_or_moves_with_the_robot_is_not_told(said):
    given(grid(), grid(columns=50, rows=30, x=-0.5, y=-0.5), grid(columns=50, rows=30, x=3.0, y=-0.5))
    assert not said


def bad(**changes):
    message = grid()
    for name, value in changes.items():
        target = message.info if hasattr(message.info, name) else message
        setattr(target, name, value)
    return message


def rotated():
    message = grid()
    message.info.origin.orientation.z, message.info.origin.orientation.w = np.sin(0.25), np.cos(0.25)
    return message


@pytest.mark.parametrize("message, words", [
    (bad(data=[0] * 3), "has 40 x 20 cells and 3 values"), (bad(width=0), "has 0 x 20 cells"),
    (bad(width=100000, height=100000), "expected 1 to 100000000 cells"),
    (bad(resolution=float("nan")), "has the resolution nan m"), (bad(resolution=0.0), "the resolution above 0"),
    (rotated(), "is rotated by 0.500 rad"), (grid(frame=""), "has no frame_id")])
def test_a_map_that_cannot_be_used_is_told_and_the_last_stays(said, message, words):
    made = given(grid(), message)
    assert len(said) == 1 and words in said[0] and "the map on /costmap is not used" in said[0]
    assert made.snapshot().shape == (20, 40)


def test_a_change_outside_of_the_map_is_told(said):
    made = given(grid())
    made._on_update(OccupancyGridUpdate(x=38, y=0, width=4, height=1, data=[100] * 4))
    assert len(said) == 1 and "4 x 1 cells at (38, 0) does not fit the map on /costmap of 40 x 20" in said[0]
    assert not made.snapshot().costs.any()


class Missing:
    """Stands for what the node asks for; the robot's pose is missing."""

    def __init__(self, server=True):
        self.server = server

    def is_there(self):
        return self.server

    def fresh_pose(self, frame, robot, age):
        raise TransformError("there is no frame %s; expected a transform from %s" % (robot, frame))


def turn(made, server=True):
    """Let the node decide once, with a map and without a robot."""
    stub = SimpleNamespace(_map=made, _goals=Missing(server), _transforms=Missing(), _values={
        "robot_base_frame": "base_link", "transform_tolerance": 0.3, "planner_frequency": 1.0})
    stub._missing = lambda reason: ExploreNode._missing(stub, reason)
    return ExploreNode._turn(stub)


def test_no_map_no_planner_and_no_robot_are_told(said):
    turn(given())
    turn(given(grid()), server=False)
    turn(given(grid()))
    assert said == ["waiting: no map on /costmap", "waiting: no action server on /move_base",
                    "waiting: there is no frame base_link; expected a transform from map"]

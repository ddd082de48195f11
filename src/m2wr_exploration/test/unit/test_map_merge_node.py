# SPDX-License-Identifier: BSD-3-Clause
"""The node map_merge, without a master: which robots it finds, where their maps lie, what it says."""
import numpy as np
import pytest
import rospy
from nav_msgs.msg import OccupancyGrid

from exploration_grids import grid
from m2wr_exploration.ros import map_merge_node
from m2wr_exploration.ros.map_merge_node import MapMergeNode, Places, init_pose, robots_of
from m2wr_exploration.team.map_match import Match

GRID = "nav_msgs/OccupancyGrid"
TOPICS = [("/robot1/map", GRID), ("/robot2/map", GRID), ("/map", GRID), ("/robot1/scan", "sensor_msgs/LaserScan"),
          ("/other/map", GRID), ("/robot1/move_base/global_costmap/costmap", GRID)]


class Master:
    """Parameters, messages and what was published."""

    def __init__(self):
        self.parameters, self.said, self.sent, self.maps = {}, [], [], {}

    def publish(self, message):
        self.sent.append(message)


@pytest.fixture
def master(monkeypatch):
    made = Master()

    def subscriber(topic, kind, callback, **more):
        if kind is OccupancyGrid:
            made.maps[topic] = callback

    monkeypatch.setattr(rospy, "get_param", lambda name, default=None: made.parameters.get(name, default))
    monkeypatch.setattr(rospy, "Subscriber", subscriber)
    monkeypatch.setattr(rospy, "Publisher", lambda *args, **more: made)
    monkeypatch.setattr(rospy, "get_name", lambda: "/map_merge")
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time(1)))
    monkeypatch.setattr(rospy, "logwarn", lambda text, *args: made.said.append(text % args if args else text))
    monkeypatch.setattr(rospy, "loginfo", lambda text, *args: None)
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: made.said.append(text))
    return made


def message(data, resolution=0.5):
    made = OccupancyGrid()
    made.header.frame_id = "map"
    made.info.height, made.info.width = np.array(data).shape
    made.info.resolution, made.info.origin.orientation.w = resolution, 1.0
    made.data = [value for row in data for value in row]
    return made


def start(master, **given):
    master.parameters["~"] = given
    made = MapMergeNode()
    made.discover(TOPICS)
    return made


def test_robots_are_found_by_their_topics():
    assert robots_of(TOPICS, "map", "", "/map") == ["/other", "/robot1", "/robot2"]
    assert robots_of(TOPICS, "map", "robot", "/map") == ["/robot1", "/robot2"]
    assert robots_of(TOPICS, "map", "", "/merged") == ["", "/other", "/robot1", "/robot2"]
    assert robots_of(TOPICS, "move_base/global_costmap/costmap", "", "/map") == ["/robot1"]


def test_maps_lie_where_the_robots_began(master):
    for robot, x in (("/robot1", 0.0), ("/robot2", 1.0)):
        master.parameters[robot + "/map_merge"] = {"init_pose_x": x, "init_pose_y": 0.0, "init_pose_z": 0.0,
                                                   "init_pose_yaw": 0.0}
    node = start(master, robot_namespace="robot")
    assert not node.publish() and "waiting: no map on a topic that ends with /map" in master.said[-1]
    master.maps["/robot1/map"](message([[0, 100]]))
    master.maps["/robot2/map"](message([[-1, 0]]))
    assert node.publish()
    merged = master.sent[-1]
    assert merged.header.frame_id == "world" and (merged.info.width, merged.info.height) == (4, 1)
    assert np.array(merged.data).tolist() == [0, 100, -1, 0]


@pytest.mark.parametrize("given, words", [
    ({}, "init_pose_x is None"), (3, "init_pose_x is None"),
    ({"init_pose_x": 0, "init_pose_y": "left", "init_pose_yaw": 0}, "init_pose_y is 'left'"),
    ({"init_pose_x": 0, "init_pose_y": 0, "init_pose_yaw": float("nan")}, "init_pose_yaw is nan")])
def test_a_start_pose_that_is_missing_is_told(given, words):
    with pytest.raises(ValueError, match=words):
        init_pose(given, "/robot1")


def test_a_robot_without_a_start_pose_is_told_once_and_left_out(master):
    master.parameters["/robot2/map_merge"] = {"init_pose_x": 0.0, "init_pose_y": 0.0, "init_pose_yaw": 0.0}
    node = start(master, robot_namespace="robot")
    node.discover(TOPICS)
    assert list(node.inputs) == ["/robot2"] and len(master.said) == 1
    assert "/robot1/map_merge/init_pose_x" in master.said[0]


def test_maps_too_far_apart_are_told(master):
    for robot, x in (("/robot1", 0.0), ("/robot2", 1e6)):
        master.parameters[robot + "/map_merge"] = {"init_pose_x": x, "init_pose_y": x, "init_pose_yaw": 0.0}
    node = start(master, robot_namespace="robot")
    for robot in ("/robot1", "/robot2"):
        master.maps[robot + "/map"](message([[0, 100]]))
    assert not node.publish() and "the merged map would have" in master.said[-1]


def test_a_parameter_that_cannot_be_used_is_told(master):
    start(master, merging_rate="fast", robot_namspace="robot")
    assert any("merging_rate" in text for text in master.said) and any("robot_namspace" in text for text in master.said)


@pytest.mark.parametrize("confidence, reason, words", [
    (1.5, "", "lies at (1.00, 2.00), 0.500 rad"), (0.4, "another place fits as well", "another place fits as well"),
    (0.9, "", "estimation_confidence asks for more")])
def test_without_start_poses_only_a_sure_place_counts(master, monkeypatch, confidence, reason, words):
    monkeypatch.setattr(map_merge_node, "match", lambda first, second: Match(
        np.array([1.0, 2.0, 0.5]), confidence, 12.0, 0.97, 0.5, reason))
    node = start(master, robot_namespace="robot", known_init_poses=False)
    for robot in ("/robot1", "/robot2"):
        master.maps[robot + "/map"](message([[0, 100]]))
    node.estimate()
    node.estimate()
    assert sum(words in text for text in master.said) == 1
    assert sorted(node.places.poses) == (["/robot1", "/robot2"] if confidence > 1.0 else ["/robot1"])
    assert node.publish()


def test_maps_that_are_too_small_to_be_compared_are_told():
    told = Places(1.0).estimate({"/a": grid("#.#"), "/b": grid("#.#")})
    assert len(told) == 1 and told[0][0] == "/b" and "of wall" in told[0][1]

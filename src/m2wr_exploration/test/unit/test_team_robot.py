# SPDX-License-Identifier: BSD-3-Clause
"""What one robot of a team sends and gets, without a master: scans, commands, maps, and why it takes no part."""
import math

import numpy as np
import pytest
import rospy
from geometry_msgs.msg import Twist
from nav_msgs.msg import OccupancyGrid, Odometry
from sensor_msgs.msg import LaserScan

from exploration_grids import grid
from m2wr_exploration.ros import team_robot
from m2wr_exploration.ros.team_robot import TeamRobot
from m2wr_navigation.ros.transforms import TransformError


class Ros:
    """Topics and the clock."""

    def __init__(self):
        self.now, self.sent, self.callbacks, self.said = 100.0, {}, {}, []


class Frames:
    """Transforms by their two names; a pose in the odometry frame may be asked for at a stamp."""

    def __init__(self, ros):
        self.ros, self.poses = ros, {("world", "robot1/odom"): (np.array([1.0, 0.0, 0.0]), 100.0),
                                     ("robot1/odom", "robot1/base"): (np.array([2.0, 3.0, 0.0]), 100.0)}

    def stamped_pose(self, target, source):
        if (target, source) not in self.poses:
            raise TransformError("there is no transform from %s to %s" % (source, target))
        return self.poses[target, source]

    def pose(self, target, source, stamp):
        if stamp.to_sec() > self.poses["robot1/odom", "robot1/base"][1]:
            raise TransformError("too new")
        return self.stamped_pose("robot1/odom", "robot1/base")[0]

    def fresh_pose(self, target, source, age):
        raise TransformError("the transform from %s to %s is old" % (source, target))


@pytest.fixture
def ros(monkeypatch):
    made = Ros()

    class Publisher:
        def __init__(self, topic, *args, **more):
            self.topic = topic

        def publish(self, message):
            made.sent.setdefault(self.topic, []).append(message)

    monkeypatch.setattr(rospy, "Publisher", Publisher)
    monkeypatch.setattr(rospy, "Subscriber", lambda topic, kind, callback, **more: made.callbacks.update(
        {topic: callback}))
    monkeypatch.setattr(rospy, "get_time", lambda: made.now)
    monkeypatch.setattr(rospy.Time, "now", staticmethod(lambda: rospy.Time.from_sec(made.now)))
    monkeypatch.setattr(rospy, "logwarn_throttle", lambda period, text: made.said.append(text))
    monkeypatch.setattr(team_robot, "Goals", lambda action: None)
    return made


@pytest.fixture
def robot(ros):
    made = TeamRobot("robot1", "world", "robot1/odom", "robot1/base", np.array([5.0, 0.0, 0.0]), Frames(ros))
    made.locate()
    return made


def scan(stamp=100.0, **changes):
    made = LaserScan(angle_min=-0.1, angle_increment=0.1, range_max=10.0, ranges=[2.0, 2.0, 4.0])
    made.header.stamp, made.header.frame_id = rospy.Time.from_sec(stamp), "robot1/laser"
    for name, value in changes.items():
        setattr(made, name, value)
    return made


def passed(ros):
    return ros.sent.get("/robot1/scan_without_robots", [])


def test_its_pose_is_that_of_the_mapper_and_of_the_odometry(robot):
    assert robot.pose.tolist() == [3.0, 3.0, 0.0] and robot.posed == 100.0


def test_its_pose_at_the_time_of_a_scan(robot):
    robot._transforms.poses["robot1/odom", "robot1/base"] = (np.array([2.5, 3.0, 0.0]), 101.0)
    assert robot.pose_at(rospy.Time(100)).tolist() == [3.5, 3.0, 0.0]
    assert robot.pose_at(rospy.Time(200)).tolist() == [3.0, 3.0, 0.0]       # not known: the newest that it took
    robot.pose = None
    assert robot.pose_at(rospy.Time(100)) is None


def test_before_there_is_a_map_its_start_counts(robot):
    del robot._transforms.poses["world", "robot1/odom"]
    robot.locate()
    assert robot.pose.tolist() == [7.0, 3.0, 0.0] and robot.posed == -math.inf


def test_beams_that_end_on_a_teammate_are_no_measurements(ros, robot):
    robot.others = lambda stamp: [np.array([5.0, 3.0])] if stamp.to_sec() == 100.0 else []
    ros.callbacks["/robot1/m2wr/laser/scan"](scan())
    assert np.isnan(passed(ros)[0].ranges[:2]).all() and passed(ros)[0].ranges[2] == 4.0


def test_a_scan_waits_for_its_transform_but_not_for_ever(ros, robot):
    hear = ros.callbacks["/robot1/m2wr/laser/scan"]
    hear(scan(100.25))
    ros.now = 102.0
    robot.pass_scans()
    assert not passed(ros) and not ros.said         # before the first one, the transforms are still to come
    ros.now = 100.0
    hear(scan(100.25))
    assert not passed(ros)
    robot._transforms.poses["robot1/odom", "robot1/base"] = (np.zeros(3), 100.5)
    hear(scan(100.5))
    assert [message.header.stamp.to_sec() for message in passed(ros)] == [100.25, 100.5]
    hear(scan(100.75))
    ros.now = 102.0
    robot.pass_scans()
    assert len(passed(ros)) == 2 and "a scan on /robot1/m2wr/laser/scan is not used: too new" in ros.said[-1]


@pytest.mark.parametrize("message, words", [
    (scan(ranges=[]), "it has 0 beams; expected 1 to 100000"), (scan(angle_min=math.nan), "its angles are not finite")])
def test_a_scan_that_cannot_be_used_is_told(ros, robot, message, words):
    ros.callbacks["/robot1/m2wr/laser/scan"](message)
    assert not passed(ros) and words in ros.said[0]


def twist(linear, angular):
    made = Twist()
    made.linear.x, made.angular.z = linear, angular
    return made


def test_an_old_command_is_a_stop_and_a_stop_is_sent_once(ros, robot):
    ros.callbacks["/robot1/cmd_vel_wanted"](twist(0.3, 0.1))
    robot.command(robot.wanted(100.1))
    for _ in range(3):
        robot.command(robot.wanted(100.6))
    sent = [(message.linear.x, message.angular.z) for message in ros.sent["/robot1/cmd_vel"]]
    assert sent == [(0.3, 0.1), (0.0, 0.0)]


def test_numbers_that_are_not_finite_are_told_and_not_used(ros, robot):
    ros.callbacks["/robot1/cmd_vel_wanted"](twist(math.nan, 0.0))
    odometry = Odometry()
    odometry.twist.twist.linear.x = math.inf
    ros.callbacks["/robot1/odom"](odometry)
    assert robot.wanted(100.0) == (0.0, 0.0) and not robot.velocity.any()
    assert "expected finite numbers" in ros.said[0] and "/robot1/odom" in ros.said[1]


def test_why_a_robot_takes_no_part_is_told_in_turn(ros, robot):
    assert robot.fault(100.0, 10.0) == "nothing has come on /robot1/m2wr/laser/scan yet"
    ros.callbacks["/robot1/m2wr/laser/scan"](scan())
    ros.callbacks["/robot1/odom"](Odometry())
    ros.callbacks["/robot1/move_base/status"](None)
    assert robot.fault(100.0, 10.0) == "no map has come on /robot1/move_base/global_costmap/costmap yet"
    robot.costmap.costmap = grid("...")
    assert "is in map; expected world" in robot.fault(100.0, 10.0)
    robot.costmap.costmap.frame = "world"
    assert robot.fault(110.0, 10.0) == ""
    assert robot.fault(110.5, 10.0) == "nothing has come on /robot1/m2wr/laser/scan for 10 s"
    ros.now = 110.5
    for topic, message in (("m2wr/laser/scan", scan(110.0)), ("odom", Odometry()), ("move_base/status", None)):
        ros.callbacks["/robot1/" + topic](message)
    assert robot.fault(110.5, 10.0) == "the transform from robot1/base to world is old"
    robot.forget()
    assert robot.fault(110.5, 10.0) == "nothing has come on /robot1/m2wr/laser/scan yet" and robot.pose is None


def test_teammates_nearby_are_drawn_and_one_empty_map_follows(ros, robot):
    def drawn():
        message = ros.sent["/robot1/teammates"][-1]
        return int((np.array(message.data) == 100).sum()), len(ros.sent["/robot1/teammates"])

    square = np.array([(0.0, 0.0), (0.5, 0.0), (0.5, 0.5), (0.0, 0.5)])
    assert drawn() == (0, 1)                # at the start, for a costmap that waits for it
    robot.show_teammates([square + robot.pose[:2] + 1.0, square + 50.0])
    assert 100 <= drawn()[0] <= 121 and drawn()[1] == 2
    for _ in range(3):
        robot.show_teammates([])
    assert drawn() == (0, 3)


def test_the_map_of_planners_has_unknown_and_occupied_cells(ros, robot):
    robot.show_known(np.array([[0, 100, -1]], np.int8), grid("...", 0.1))
    message = ros.sent["/robot1/team_map"][0]
    assert isinstance(message, OccupancyGrid) and np.array(message.data).tolist() == [0, 100, -1]


def test_beams_without_an_end_may_get_a_range(ros, robot):
    endless = [math.inf, 2.0, -math.inf]
    ros.callbacks["/robot1/m2wr/laser/scan"](scan(ranges=endless))
    assert list(passed(ros)[0].ranges) == endless               # as measured
    made = TeamRobot("robot1", "world", "robot1/odom", "robot1/base", np.zeros(3), Frames(ros), 9.95)
    made.others = lambda stamp: [np.array([9.95 + 3.0, 3.0])]   # a teammate where the beam would end
    ros.callbacks["/robot1/m2wr/laser/scan"](scan(ranges=endless + [math.nan]))
    ranges = passed(ros)[-1].ranges
    assert ranges[0] == pytest.approx(9.95) and ranges[1:3] == [2.0, -math.inf] and math.isnan(ranges[3])

# SPDX-License-Identifier: BSD-3-Clause
"""The ROS layer without a master: messages, and the switch."""
import math

import pytest
from nav_msgs.msg import Odometry
from sensor_msgs.msg import LaserScan

from motion_plan import ros_support


def odometry(x=1.0, yaw=0.3):
    msg = Odometry()
    msg.pose.pose.position.x = x
    msg.pose.pose.orientation.z, msg.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    msg.twist.twist.linear.x, msg.twist.twist.angular.z = 0.5, 0.1
    return msg


def test_odometry_becomes_plain_values():
    pose, speed = ros_support.planar_pose(odometry())
    assert pose == pytest.approx((1.0, 0.0, 0.3)) and speed == (0.5, 0.1)


@pytest.mark.parametrize('msg', [odometry(x=math.nan), odometry(yaw=math.nan)])
def test_odometry_with_nan_is_refused(msg):
    with pytest.raises(ValueError, match='finite'):
        ros_support.planar_pose(msg)


class NoTopics:
    """A rhythm that subscribes to nothing."""

    @staticmethod
    def subscribe(topic, message_class, callback):
        pass


class NoCommands(NoTopics):
    """A rhythm whose publishers publish nothing."""

    @staticmethod
    def publisher(topic, message_class):
        pass


def test_a_switch_made_during_shutdown_is_stopped(monkeypatch):
    stopped = []
    monkeypatch.setattr(ros_support.rospy, 'Service', lambda *_: None)
    monkeypatch.setattr(ros_support.rospy.core, 'is_shutdown_requested', lambda: True)
    monkeypatch.setattr(ros_support.rospy, 'on_shutdown', lambda hook: None)
    monkeypatch.setattr(ros_support.Switchable, '_shut_down', lambda self: stopped.append(self))
    switch = ros_support.Switchable(NoCommands(), '/switch', lambda on: None)
    assert stopped == [switch]


def scan_at(stamp):
    msg = LaserScan(angle_min=-math.pi / 2, angle_max=math.pi / 2, angle_increment=math.pi / 719, range_max=10.0,
                    ranges=[3.0] * 720)
    msg.header.stamp = ros_support.rospy.Time.from_sec(stamp)
    return msg


def odometry_at(stamp, x):
    msg = odometry(x=x, yaw=0.0)
    msg.header.stamp, msg.header.frame_id, msg.child_frame_id = ros_support.rospy.Time.from_sec(stamp), 'odom', 'base'
    return msg


def test_a_moved_robot_is_detected_and_old_scans_are_ignored(monkeypatch):
    monkeypatch.setattr(ros_support.rospy, 'get_time', lambda: 2.0)
    senses = ros_support.Senses(NoTopics(), remember=True)
    for stamp, x in ((1.0, 0.0), (1.05, 0.02)):
        senses.clbk_odom(odometry_at(stamp, x))
    senses.clbk_laser(scan_at(1.04))
    assert not senses.jumped and senses.base_frame == 'base'
    senses.clbk_odom(odometry_at(1.1, 4.0))
    assert senses.jumped and not senses.scan_since_jump
    before = senses.scan_stamp
    senses.clbk_laser(scan_at(1.08))            # taken at the old place, received late
    assert senses.scan_stamp == before and not senses.scan_since_jump
    senses.clbk_laser(scan_at(1.12))
    assert senses.scan_since_jump
    senses.clbk_odom(odometry_at(1.15, 4.02))
    assert senses.jumped                        # until the node resets it
    senses.forget()
    assert not senses.jumped and senses.scan_since_jump

# SPDX-License-Identifier: BSD-3-Clause
"""Placing the robot at a clicked pose."""
import logging
import math
from types import SimpleNamespace

import pytest
import rospy
from geometry_msgs.msg import PoseWithCovarianceStamped

from m2wr_tools.robots.place_robot import PlaceRobot, check_goal
from motion_plan.ros_poses import PoseError


class Model:
    """A simulation with one model, which stands at height 0.1 and drives."""

    def __init__(self):
        self.set = []

    def get_state(self, name, frame):
        pose = SimpleNamespace(position=SimpleNamespace(x=0.0, y=0.0, z=0.1))
        return SimpleNamespace(success=name == "m2wr", status_message="no model " + name, pose=pose)

    def set_state(self, state):
        self.set.append(state)
        return SimpleNamespace(success=True, status_message="")


def message(x=1.0, y=2.0, yaw=math.pi / 2, frame="odom"):
    made = PoseWithCovarianceStamped()
    made.header.frame_id = frame
    made.pose.pose.position.x, made.pose.pose.position.y = x, y
    made.pose.pose.orientation.z, made.pose.pose.orientation.w = math.sin(yaw / 2), math.cos(yaw / 2)
    return made


@pytest.fixture
def warnings(monkeypatch):
    """Lines that were logged as warnings."""
    lines = []
    monkeypatch.setattr(rospy, "logwarn", lambda text, *words: lines.append(text % words))
    monkeypatch.setattr(rospy, "loginfo", lambda text, *words: logging.info(text, *words))
    return lines


def lost(target, source):
    raise PoseError("tf does not lead there")


def test_the_robot_is_put_upright_and_at_rest_at_its_height(warnings):
    model = Model()
    PlaceRobot("m2wr", "odom", model.get_state, model.set_state).take(message())
    state, = model.set
    assert (state.model_name, state.reference_frame) == ("m2wr", "world")
    assert (state.pose.position.x, state.pose.position.y, state.pose.position.z) == (1.0, 2.0, 0.1)
    q = state.pose.orientation
    assert (q.x, q.y) == (0.0, 0.0) and 2.0 * math.atan2(q.z, q.w) == pytest.approx(math.pi / 2)
    assert state.twist.linear.x == state.twist.angular.z == 0.0 and not warnings


def test_a_pose_in_the_map_is_brought_into_the_world(warnings):
    model = Model()
    PlaceRobot("m2wr", "odom", model.get_state, model.set_state,
               transform=lambda target, source: (0.5, -0.5, 0.0)).take(message(frame="map"))
    assert (model.set[0].pose.position.x, model.set[0].pose.position.y) == (1.5, 1.5)


@pytest.mark.parametrize("name, pose, said", [("m2wr", message(x=math.nan), "finite"), ("r2", message(), "no model r2"),
                                              ("m2wr", message(frame="moon"), "tf does not lead there")])
def test_what_cannot_be_done_is_told_and_changes_nothing(warnings, name, pose, said):
    model = Model()
    PlaceRobot(name, "odom", model.get_state, model.set_state, transform=lost).take(pose)
    assert model.set == [] and len(warnings) == 1 and said in warnings[0] and "is not moved" in warnings[0]


@pytest.mark.parametrize("nodes, told", [(["/me"], 1), (["/me", "/bug2"], 0)])
def test_a_goal_without_a_controller_is_reported(warnings, monkeypatch, nodes, told):
    monkeypatch.setattr(rospy, "get_name", lambda: "/me")
    check_goal(None, lambda: ([], [["/odom", ["/bug2"]], ["/move_base_simple/goal", nodes]], []))
    assert len(warnings) == told and all("roslaunch m2wr_sim bug2.launch" in line for line in warnings)


def test_a_goal_while_the_master_goes_is_no_error(warnings):
    def gone():
        raise OSError("connection refused")

    check_goal(None, gone)
    assert not warnings

"""The edge to ROS as far as it needs no master: parameters and messages."""
import math

import pytest
from nav_msgs.msg import Odometry

from motion_plan import ros_support


@pytest.fixture
def parameters(monkeypatch):
    """A parameter server that is a dict."""
    values = {}
    monkeypatch.setattr(ros_support.rospy, 'has_param', values.__contains__)
    monkeypatch.setattr(ros_support.rospy, 'get_param', lambda name, default=None: values.get(name, default))
    return values


def test_missing_parameter_is_one_sentence_with_the_cure(parameters):
    with pytest.raises(ros_support.NodeError) as error:
        ros_support.required_number('des_pos_x', 'x of the goal in metres', 'bug2.launch')
    text = str(error.value)
    assert 'des_pos_x' in text and 'rosparam set des_pos_x' in text and 'roslaunch motion_plan bug2.launch' in text
    assert '\n' not in text


@pytest.mark.parametrize('value', [math.nan, math.inf, 'here', None, [1], True])
def test_a_parameter_that_is_no_number_is_named(parameters, value):
    parameters['des_pos_y'] = value
    with pytest.raises(ros_support.NodeError, match='des_pos_y.*finite'):
        ros_support.required_number('des_pos_y', 'y of the goal', 'bug2.launch')


@pytest.mark.parametrize('value', [3, -2.5, '4.5'])
def test_numbers_are_taken(parameters, value):
    parameters['des_pos_y'] = value
    assert ros_support.required_number('des_pos_y', 'y of the goal', 'bug2.launch') == float(value)


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

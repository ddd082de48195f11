# SPDX-License-Identifier: BSD-3-Clause
"""Controllers of robots that steer, against circles of known radius."""
import math

import pytest
from four_wheel_steering_msgs.msg import FourWheelSteering

from control_robots import JOINT, LINK, PLUGIN, POSITION, VELOCITY, WHEEL, twist
from m2wr_sim.ros_control.controllers.four_wheel_steering import Geometry, measured_twist


def steered(steer_kind=POSITION):
    """A box on four wheels, each with a steering joint."""
    text = LINK.format("base", 10, 0.3, '<collision><geometry><box size="0.5 0.3 0.1"/></geometry></collision>')
    for name, place in (("fl", "0.3 0.25 -0.05"), ("rl", "-0.3 0.25 -0.05"), ("fr", "0.3 -0.25 -0.05"),
                        ("rr", "-0.3 -0.25 -0.05")):
        text += LINK.format(name + "_fork", 0.5, 0.003, "") + LINK.format(name + "_link", 0.5, 0.003, WHEEL)
        text += JOINT.format(name + "_steer", "revolute", "base", name + "_fork", place,
                             '<limit lower="-1" upper="1" effort="50" velocity="5"/>', steer_kind).replace(
                                 '<axis xyz="0 1 0"/>', '<axis xyz="0 0 1"/>')
        text += JOINT.format(name + "_wheel", "continuous", name + "_fork", name + "_link", "0 0 0", "", VELOCITY)
    return "<robot name='car'>%s%s</robot>" % (text, PLUGIN.format(""))


FOUR = {"type": "four_wheel_steering_controller/FourWheelSteeringController", "front_wheel": ["fl_wheel", "fr_wheel"],
        "rear_wheel": ["rl_wheel", "rr_wheel"], "front_steering": ["fl_steer", "fr_steer"],
        "rear_steering": ["rl_steer", "rr_steer"], "pose_covariance_diagonal": [0.1] * 6,
        "twist_covariance_diagonal": [0.1] * 6, "cmd_vel_timeout": 20.0, "base_frame_id": "base"}


def test_four_steered_wheels_turn_as_commanded(make_robot):
    robot = make_robot(steered(), steer=FOUR)
    robot.begin("steer")
    robot.run(0.5)
    robot.send("/steer/cmd_vel", twist(0.5, 0.4))
    robot.run(4.0)
    odometry = robot.ports.topics["/steer/odom"].messages[-1]
    assert odometry.twist.twist.angular.z == pytest.approx(0.4, abs=0.02)
    pose = odometry.pose.pose
    assert robot.position()[:2] == pytest.approx((pose.position.x, pose.position.y), abs=0.06)
    robot.send("/steer/cmd_four_wheel_steering", FourWheelSteering(0.3, 0.3, 0.0, 0.0, 0.3, 0.0, 0.0))
    robot.run(1.0)
    assert robot.angle("fl_steer") == pytest.approx(0.3, abs=0.02)
    assert robot.angle("rr_steer") == pytest.approx(0.3, abs=0.02)


def test_ackermann_takes_the_steering_angle(make_robot):
    values = {"type": "ackermann_steering_controller/AckermannSteeringController", "rear_wheel": "rl_wheel",
              "front_steer": "fl_steer", "pose_covariance_diagonal": [0.1] * 6, "twist_covariance_diagonal": [0.1] * 6}
    robot = make_robot(steered(), car=values)
    robot.begin("car")
    robot.send("/car/cmd_vel", twist(0.2, 0.25))
    robot.run(0.4)
    assert robot.angle("fl_steer") == pytest.approx(0.25, abs=0.01)


@pytest.mark.parametrize("offset", [0.0, 0.05])
@pytest.mark.parametrize("speed, front, rear", [(0.5, 0.3, -0.3), (-0.4, 0.3, -0.3), (0.5, 0.2, 0.2), (0.8, -0.4, 0.0)])
def test_wheels_roll_on_circles_about_one_centre(speed, front, rear, offset):
    size = Geometry(track=0.5, offset=offset, base=0.6, radius=0.1)
    rate = speed * (math.tan(front) - math.tan(rear)) / size.base
    angles, rates = size.steering_of(front, rear), size.speeds_of(speed, front, rear)
    sideways = 0.5 * speed * (math.tan(front) + math.tan(rear))
    for angle, wheel, x, side in zip(angles, rates, (0.3, 0.3, -0.3, -0.3), (1.0, -1.0, 1.0, -1.0)):
        # velocity of the wheel's centre: at the steering axis, and the offset along the wheel's own axle
        y = side * 0.5 * size.track
        vx, vy = speed - rate * y, sideways + rate * x
        assert math.atan2(vy * math.copysign(1.0, speed), vx * math.copysign(1.0, speed)) == pytest.approx(angle)
        along = vx * math.cos(angle) + vy * math.sin(angle)
        assert wheel * size.radius == pytest.approx(along - side * size.offset * rate)
    if offset == 0.0:
        assert measured_twist(list(rates), front, rear, size) == pytest.approx((speed, sideways, rate))

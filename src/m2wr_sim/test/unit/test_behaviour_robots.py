# SPDX-License-Identifier: BSD-3-Clause
"""Robots of other forms: balls, cylinders and boxes as wheels and feet, other drives, SDF with plugins."""
import math
from pathlib import Path

import pytest

from conftest import at, box
from m2wr_sim.api.loading import read_robot
from m2wr_sim.geometry import yaw_of

ROBOTS = Path(__file__).resolve().parents[1] / "data" / "robots"
SPAWN_HEIGHT = {"four_wheels.xacro": 0.0, "ball_wheels.urdf": 0.08, "omni.xacro": 0.0, "cart.sdf": 0.0}
# the part of the commanded turn rate that arrives: exact for two wheels; the omnidirectional one drags its four balls;
# four wheels slip sideways, and by track^2 / (track^2 + base^2) at least and all of it at most they turn
TURNS = {"four_wheels.xacro": (0.61, 1.0), "ball_wheels.urdf": (0.99, 1.01), "omni.xacro": (0.98, 1.0),
         "cart.sdf": (0.99, 1.01)}


def load(name):
    """Return a robot by its file, whatever it is written in."""
    return read_robot(ROBOTS / name)


@pytest.fixture(params=sorted(SPAWN_HEIGHT))
def name(request):
    return request.param


@pytest.fixture
def standing(make_rig):
    """Return a function that makes a rig with the robot standing in front of a wall 4 m away."""
    def make(name, **options):
        rig = make_rig(box("wall", 4.1, 0.0, 0.5, (0.2, 4.0, 1.0)), step_ms=2, **options)
        robot = load(name)
        rig.simulator.spawn(robot, at(z=SPAWN_HEIGHT[name]), namespace="/")
        rig.run(1.0)
        return rig, robot.name
    return make


def moved(rig, name, seconds):
    """Run; return how far the model's origin came [m] and by how much it turned [rad]."""
    before = rig.pose(name)
    rig.run(seconds)
    after = rig.pose(name)
    return (math.hypot(after[0][0] - before[0][0], after[0][1] - before[0][1]),
            math.remainder(yaw_of(after[1]) - yaw_of(before[1]), 2.0 * math.pi))


def test_every_fixture_is_tested():
    assert set(SPAWN_HEIGHT) == {path.name for path in ROBOTS.iterdir()}


def test_it_does_not_move(standing, name):
    rig, robot = standing(name)
    distance, turn = moved(rig, robot, 2.0)
    assert distance < 1e-4 and abs(turn) < 1e-4


def test_it_drives_straight(standing, name):
    rig, robot = standing(name)
    rig.send(0.5, 0.0).run(1.0)
    distance, turn = moved(rig, robot, 2.0)
    assert distance == pytest.approx(1.0, rel=0.01) and abs(turn) < 0.005
    assert rig.pose(robot)[0][1] == pytest.approx(0.0, abs=0.01)
    odometry = rig.messages("/odom")[-1]
    assert odometry.twist.twist.linear.x == pytest.approx(0.5, rel=0.01)
    assert odometry.pose.pose.position.x == pytest.approx(rig.pose(robot)[0][0], abs=0.05)


def test_a_positive_angular_z_turns_it_left_in_place(standing, name):
    rig, robot = standing(name, wheel_convention="rep103")
    rig.send(0.0, 0.4).run(1.0)
    distance, turn = moved(rig, robot, 4.0)
    least, most = TURNS[name]
    assert least - 1e-3 <= turn / 1.6 <= most + 1e-3
    assert distance < 0.2


def test_it_turns_right_while_it_drives(standing, name):
    rig, robot = standing(name)
    rig.send(0.3, -0.3).run(1.0)
    distance, turn = moved(rig, robot, 3.0)
    least, most = TURNS[name]
    assert least - 1e-3 <= turn / -0.9 <= most + 1e-3
    assert 0.7 < distance <= 0.91


def test_it_scans_the_wall(standing, name):
    rig, _ = standing(name)
    ahead = rig.messages("/scan")[-1]
    middle = ahead.ranges[len(ahead.ranges) // 2]
    assert len(rig.messages("/scan")) == 10 and 3.8 < middle < 4.05
    assert math.isinf(ahead.ranges[0]) and math.isinf(ahead.ranges[-1])


def test_a_skid_steer_with_even_load_spins_about_its_middle(standing):
    rig, robot = standing("four_wheels.xacro")
    rig.send(0.0, 1.0).run(8.0)
    assert rig.pose(robot)[0][:2] == pytest.approx((0.0, 0.0), abs=0.005)


def test_a_robot_of_a_lab_has_all_its_topics(standing):
    rig, _ = standing("cart.sdf")
    assert {"/odom", "/scan", "/joint_states"} <= set(rig.ports.topics)
    assert any(topic.endswith("image_raw") for topic in rig.ports.topics)


def test_an_omnidirectional_robot_moves_sideways_and_turns(standing):
    rig, robot = standing("omni.xacro")
    from geometry_msgs.msg import Twist
    message = Twist()
    message.linear.y = 0.5
    rig.ports.send("/cmd_vel", message)
    rig.run(1.0)
    distance, turn = moved(rig, robot, 2.0)
    assert distance == pytest.approx(1.0, rel=0.01) and abs(turn) < 0.005
    assert rig.pose(robot)[0][1] > 1.4 and abs(rig.pose(robot)[0][0]) < 0.01
    message.linear.y, message.angular.z = 0.0, 1.0          # the centre of mass is 3 cm ahead of the origin
    rig.ports.send("/cmd_vel", message)
    rig.run(0.1)
    distance, turn = moved(rig, robot, 3.0)
    assert turn == pytest.approx(3.0, rel=0.02) and distance < 0.005

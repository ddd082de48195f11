# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_tricycle_drive.so: a steered and driven front wheel; its circle has a closed form."""
import math

import pytest
from geometry_msgs.msg import Twist

from conftest import at
from m2wr_sim.model.urdf.loader import load_urdf

INERTIAL = """<inertial><mass value="{0}"/>
<inertia ixx="{1}" iyy="{1}" izz="{1}" ixy="0" ixz="0" iyz="0"/></inertial>"""
WHEEL = """<joint name="{0}_joint" type="continuous"><parent link="{1}"/><child link="{0}"/>
<origin xyz="{2} {3} {4}" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/></joint><link name="{0}">""" \
    + INERTIAL.format(0.5, 0.002) \
    + """<collision><geometry><cylinder radius="0.1" length="0.03"/></geometry></collision></link>"""
PLUGIN = """<gazebo><plugin name="drive" filename="libgazebo_ros_tricycle_drive.so"><robotNamespace>/</robotNamespace>
<steeringJoint>fork_joint</steeringJoint><actuatedWheelJoint>front_joint</actuatedWheelJoint>
<encoderWheelLeftJoint>left_joint</encoderWheelLeftJoint><encoderWheelRightJoint>right_joint</encoderWheelRightJoint>
<diameterActuatedWheel>0.2</diameterActuatedWheel><diameterEncoderWheel>0.2</diameterEncoderWheel>
<separationEncoderWheel>0.4</separationEncoderWheel><wheelTorque>20</wheelTorque>{}</plugin></gazebo>"""
LENGTH = 0.5        # m from the rear axle to the front wheel


def tricycle(more=""):
    body = '<link name="base_link">' + INERTIAL.format(10.0, 0.3) + "</link>"
    fork = ('<joint name="fork_joint" type="revolute"><parent link="base_link"/><child link="fork"/>'
            '<origin xyz="%g 0 0.1"/><axis xyz="0 0 1"/><limit lower="-1.6" upper="1.6" effort="50" velocity="10"/>'
            '</joint><link name="fork">' % LENGTH + INERTIAL.format(0.5, 0.005) + "</link>")
    return load_urdf('<robot name="cart">' + body.replace("<inertial>", '<inertial><origin xyz="0.15 0 0.1"/>') + fork
                     + WHEEL.format("front", "fork", 0, 0, 0) + WHEEL.format("left", "base_link", 0, 0.2, 0.1)
                     + WHEEL.format("right", "base_link", 0, -0.2, 0.1) + PLUGIN.format(more) + "</robot>", "cart.urdf")


@pytest.fixture
def spawn(make_rig):
    """Return a function that makes a rig with the cart."""
    def make(more=""):
        rig = make_rig()
        rig.simulator.spawn(tricycle(more), at(z=0.001), "cart", namespace="/")
        return rig.run(0.2)
    return make


def send(rig, speed, angle):
    message = Twist()
    message.linear.x, message.angular.z = speed, angle
    rig.ports.send("/cmd_vel", message)


def test_angular_z_is_the_angle_of_the_front_wheel(spawn):
    rig = spawn()
    send(rig, 0.5, 0.4)
    rig.run(1.0)
    joints = rig.simulator.models["cart"].handle.joints
    assert rig.engine.joint_angle(joints["fork_joint"]) == pytest.approx(0.4, abs=0.002)
    before = rig.pose("cart")[1]
    rig.run(2.0)
    turned = 2.0 * (math.atan2(rig.pose("cart")[1][2], rig.pose("cart")[1][3]) - math.atan2(before[2], before[3]))
    # the front wheel rolls at 0.5 m/s along its own direction
    assert turned == pytest.approx(2.0 * 0.5 * math.sin(0.4) / LENGTH, rel=0.02)


@pytest.mark.parametrize("source", ["encoder", "world"])
def test_odometry_follows_the_circle(spawn, source):
    rig = spawn("<odometrySource>%s</odometrySource>" % source)
    send(rig, 0.5, 0.4)
    rig.run(3.0)
    (x, y, _), _ = rig.pose("cart")
    found = rig.messages("/odom")[-1].pose.pose.position
    assert (found.x, found.y) == pytest.approx((x, y), abs=0.03)
    assert rig.messages("/odom")[-1].child_frame_id == "base_link"


def test_steering_has_the_speed_that_is_given(spawn):
    rig = spawn("<steeringSpeed>0.5</steeringSpeed>")
    send(rig, 0.0, -0.8)
    rig.run(1.0)
    joints = rig.simulator.models["cart"].handle.joints
    assert rig.engine.joint_angle(joints["fork_joint"]) == pytest.approx(-0.5, abs=0.02)
    rig.run(1.0)
    assert rig.engine.joint_angle(joints["fork_joint"]) == pytest.approx(-0.8, abs=0.011)


def test_the_wheel_keeps_its_acceleration(spawn):
    rig = spawn("<wheelAcceleration>2.0</wheelAcceleration>")
    send(rig, 0.5, 0.0)
    rig.run(1.0)
    # as in Gazebo an update counts from when it was due, so that a step is added to each period of ten
    assert rig.rate("front_joint", "cart") == pytest.approx(2.2, abs=0.05)
    rig.run(2.0)
    assert rig.rate("front_joint", "cart") == pytest.approx(5.0, rel=0.01)


def test_joint_states_name_all_four_joints(spawn):
    rig = spawn()
    assert rig.messages("/joint_states")[-1].name == ["fork_joint", "front_joint", "left_joint", "right_joint"]


def test_an_angle_beyond_a_right_angle_is_limited(spawn):
    rig = spawn()
    send(rig, 0.0, 9.0)
    rig.run(0.5)
    joints = rig.simulator.models["cart"].handle.joints
    assert rig.engine.joint_angle(joints["fork_joint"]) == pytest.approx(0.5 * math.pi, abs=0.01)


@pytest.mark.parametrize("tags, part", [("<steeringJoint>bar</steeringJoint>", '"bar" is no joint of cart'),
                                        ("<wheelTorque>-1</wheelTorque>", "<wheelTorque>")])
def test_a_bad_tag_is_told(make_rig, caplog, tags, part):
    name = tags[1:tags.index(">")]
    robot = tricycle()
    from dataclasses import replace
    plugin = robot.plugins[0]
    changed = tuple((tag, tags.split(">")[1].split("<")[0] if tag == name else text) for tag, text in plugin.parameters)
    make_rig().simulator.spawn(replace(robot, plugins=(replace(plugin, parameters=changed),)), at(), "cart")
    assert part in caplog.text

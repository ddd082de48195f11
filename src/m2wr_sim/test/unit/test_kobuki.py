# SPDX-License-Identifier: BSD-3-Clause
"""libgazebo_ros_kobuki.so on a base of the same structure: drive, odometry, gyro, bumpers, cliffs and wheel drops."""
import math

import pytest
from geometry_msgs.msg import Twist
from kobuki_msgs.msg import BumperEvent, CliffEvent, MotorPower, WheelDropEvent
from std_msgs.msg import Empty

from conftest import at, box
from m2wr_sim.model.urdf.loader import load_urdf

BODY = """<link name="base_footprint"/><joint name="base" type="fixed"><parent link="base_footprint"/>
<child link="base_link"/><origin xyz="0 0 0.01"/></joint><link name="base_link"><inertial><mass value="2.4"/>
<inertia ixx="0.02" iyy="0.02" izz="0.037" ixy="0" ixz="0" iyz="0"/></inertial><collision name="base">
<origin xyz="0 0 0.06"/><geometry><cylinder length="0.1" radius="0.175"/></geometry></collision></link>"""
WHEEL = """<joint name="{0}_joint" type="continuous"><parent link="base_link"/><child link="{0}_link"/>
<origin xyz="0 {1} 0.025" rpy="-1.5707963 0 0"/><axis xyz="0 0 1"/></joint><link name="{0}_link"><inertial>
<mass value="0.05"/><inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial><collision>
<geometry><cylinder length="0.02" radius="0.035"/></geometry></collision></link><gazebo reference="{0}_link">
<sensor type="contact" name="drop_{0}"><contact><collision>{0}_link_collision</collision></contact></sensor></gazebo>"""
CASTER = """<joint name="{0}_joint" type="fixed"><parent link="base_link"/><child link="{0}"/><origin xyz="{1} 0 0.01"/>
</joint><link name="{0}"><inertial><mass value="0.01"/><inertia ixx="1e-5" iyy="1e-5" izz="1e-5" ixy="0" ixz="0"
iyz="0"/></inertial><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
<gazebo reference="{0}"><mu1>0</mu1><mu2>0</mu2></gazebo>"""
CLIFF = """<joint name="{0}_joint" type="fixed"><parent link="base_link"/><child link="{0}"/>
<origin xyz="{1} {2} 0.02" rpy="0 1.5707963 0"/></joint><link name="{0}"/><gazebo reference="{0}"><sensor type="ray"
name="{0}"><update_rate>50</update_rate><ray><scan><horizontal><samples>50</samples><min_angle>-0.04</min_angle>
<max_angle>0.04</max_angle></horizontal></scan><range><min>0.01</min><max>0.15</max></range></ray></sensor></gazebo>"""
REST = """<joint name="gyro_joint" type="fixed"><parent link="base_link"/><child link="gyro"/></joint>
<link name="gyro"/><gazebo reference="gyro"><sensor type="imu" name="imu"/></gazebo>
<gazebo reference="base_link"><sensor type="contact" name="bumpers"><contact>
<collision>base_footprint_fixed_joint_lump__base_collision</collision></contact></sensor>
</gazebo>"""
PLUGIN = """<gazebo><plugin name="base" filename="libgazebo_ros_kobuki.so"><robotNamespace>/</robotNamespace>
<publish_tf>1</publish_tf><left_wheel_joint_name>left_joint</left_wheel_joint_name><right_wheel_joint_name>right_joint
</right_wheel_joint_name><wheel_separation>0.23</wheel_separation><wheel_diameter>0.07</wheel_diameter>
<torque>1.0</torque><velocity_command_timeout>{timeout}</velocity_command_timeout>
<cliff_sensor_left_name>cliff_left</cliff_sensor_left_name><cliff_sensor_center_name>cliff_front
</cliff_sensor_center_name><cliff_sensor_right_name>cliff_right</cliff_sensor_right_name>
<cliff_detection_threshold>0.04</cliff_detection_threshold><bumper_name>{bumper}</bumper_name><imu_name>imu</imu_name>
<wheel_drop_left_sensor_name>drop_left</wheel_drop_left_sensor_name><wheel_drop_right_sensor_name>drop_right
</wheel_drop_right_sensor_name></plugin></gazebo>"""


def base(timeout=0.6, bumper="bumpers"):
    cliffs = CLIFF.format("cliff_left", 0.08, 0.14) + CLIFF.format("cliff_front", 0.15, 0) \
        + CLIFF.format("cliff_right", 0.08, -0.14)
    return load_urdf('<robot name="turtle">' + BODY + WHEEL.format("left", 0.115) + WHEEL.format("right", -0.115)
                     + CASTER.format("front", 0.115) + CASTER.format("back", -0.135) + cliffs + REST
                     + PLUGIN.format(timeout=timeout, bumper=bumper) + "</robot>", "turtle.urdf")


@pytest.fixture
def spawn(make_rig):
    """Return a function that makes a rig with the base; ``listen`` subscribes to all its topics."""
    def make(*models, pose=at(z=0.001), **options):
        rig = make_rig(*models)
        rig.simulator.spawn(base(**options), pose, "turtle", namespace="/")
        return rig
    return make


def command(rig, linear, angular, seconds, step=0.1):
    """Send a command again and again for some time, as a teleoperation does."""
    message = Twist()
    message.linear.x, message.angular.z = linear, angular
    for _ in range(int(round(seconds / step))):
        rig.ports.send("/mobile_base/commands/velocity", message)
        rig.run(step)


def core(rig):
    return rig.messages("/mobile_base/sensors/core")[-1]


def test_it_drives_and_its_odometry_is_right(spawn):
    rig = spawn()
    rig.run(0.2)
    command(rig, 0.2, 0.0, 3.0)
    command(rig, 0.1, 0.8, 4.0)
    (x, y, _), orientation = rig.pose("turtle")
    odometry = rig.messages("/odom")[-1]
    position, turn = odometry.pose.pose.position, odometry.pose.pose.orientation
    assert math.hypot(x, y) > 0.4
    assert (position.x, position.y) == pytest.approx((x, y), abs=0.01)
    yaw, truth = 2.0 * math.atan2(turn.z, turn.w), 2.0 * math.atan2(orientation[2], orientation[3])
    assert math.remainder(yaw - truth, math.tau) == pytest.approx(0.0, abs=0.02)
    assert (odometry.header.frame_id, odometry.child_frame_id) == ("odom", "base_footprint")
    assert (odometry.twist.twist.linear.x, odometry.twist.twist.angular.z) == pytest.approx((0.1, 0.8), abs=0.02)
    stamps = rig.stamps_ms("/odom")
    assert stamps[-1] - stamps[-2] == pytest.approx(20.0, abs=1.01)


def test_a_command_ends_after_its_time_out(spawn):
    rig = spawn(timeout=0.5)
    command(rig, 0.3, 0.0, 0.1)
    rig.run(0.3)
    assert rig.rate("left_joint", "turtle") == pytest.approx(0.3 / 0.035, rel=0.02)
    rig.run(0.4)
    assert rig.rate("left_joint", "turtle") == pytest.approx(0.0, abs=0.05)


def test_motors_are_switched_by_their_topic(spawn, caplog):
    rig = spawn()
    rig.ports.send("/mobile_base/commands/motor_power", MotorPower(MotorPower.OFF))
    command(rig, 0.3, 0.0, 0.3)
    assert rig.rate("left_joint", "turtle") == pytest.approx(0.0, abs=0.05)
    rig.ports.send("/mobile_base/commands/motor_power", MotorPower(7))
    command(rig, 0.3, 0.0, 0.1)
    assert "motor_power with state 7 ignored; expected 0 (off) or 1 (on)" in caplog.text
    rig.ports.send("/mobile_base/commands/motor_power", MotorPower(MotorPower.ON))
    command(rig, 0.3, 0.0, 0.3)
    assert rig.rate("left_joint", "turtle") == pytest.approx(0.3 / 0.035, rel=0.02)


def test_odometry_restarts_on_command(spawn):
    rig = spawn()
    command(rig, 0.3, 0.0, 1.0)
    rig.ports.send("/mobile_base/commands/reset_odometry", Empty())
    rig.run(0.1)
    assert abs(rig.messages("/odom")[-1].pose.pose.position.x) < 0.05


@pytest.mark.parametrize("yaw, bumper", [(0.0, BumperEvent.CENTER), (0.9, BumperEvent.RIGHT), (-0.9, BumperEvent.LEFT)])
def test_a_wall_presses_the_bumper_on_its_side(spawn, yaw, bumper):
    rig = spawn(box("wall", 0.6, 0.0, 0.5, (0.1, 6.0, 1.0)),
                pose=((0.0, 0.0, 0.001), (0.0, 0.0, math.sin(0.5 * yaw), math.cos(0.5 * yaw))))
    rig.run(0.1)
    command(rig, 0.4, 0.0, 2.6)
    events = rig.messages("/mobile_base/events/bumper")
    assert (events[0].bumper, events[0].state) == (bumper, BumperEvent.PRESSED)
    command(rig, -0.3, 0.0, 0.8)
    assert (rig.messages("/mobile_base/events/bumper")[-1].state, core(rig).bumper) == (BumperEvent.RELEASED, 0)


def test_a_cliff_is_seen_at_the_edge(spawn):
    rig = spawn(box("table", -0.5, 0.0, 0.25, (1.6, 2.0, 0.5)), pose=at(x=0.0, z=0.501))
    rig.run(0.1)
    assert core(rig).cliff == 0 and not rig.messages("/mobile_base/events/cliff")
    command(rig, 0.1, 0.0, 2.0)
    event = rig.messages("/mobile_base/events/cliff")[0]
    assert (event.sensor, event.state) == (CliffEvent.CENTER, CliffEvent.CLIFF)
    assert core(rig).cliff & 2


def test_wheels_in_the_air_have_dropped(spawn):
    rig = spawn(pose=at(z=0.3))
    rig.run(0.1)
    assert core(rig).wheel_drop == 3
    rig.run(1.0)
    assert core(rig).wheel_drop == 0
    states = [event.state for event in rig.messages("/mobile_base/events/wheel_drop")]      # it bounces
    assert states[:2] == [WheelDropEvent.DROPPED] * 2 and states[-1] == WheelDropEvent.RAISED


def test_a_sensor_that_is_missing_is_named(spawn, caplog):
    rig = spawn(bumper="hull")
    assert '"hull" is no sensor of type contact of turtle (it has ' in caplog.text and "bumpers: contact" in caplog.text
    rig.run(0.1)


def test_a_reset_begins_again(spawn):
    rig = spawn()
    command(rig, 0.3, 0.0, 1.0)
    rig.simulator.reset_simulation()
    rig.run(0.2)
    position = rig.messages("/odom")[-1].pose.pose.position
    assert (position.x, position.y) == pytest.approx((0.0, 0.0), abs=1e-3)
    assert rig.rate("left_joint", "turtle") == pytest.approx(0.0, abs=0.01)

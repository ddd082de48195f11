# SPDX-License-Identifier: BSD-3-Clause
"""The planar move plugin: velocity by decree, odometry by differences, tf, time-out, refusals."""
import math
from dataclasses import replace

import pytest
from geometry_msgs.msg import Twist

from conftest import at, box
from m2wr_sim.control.planar import twist_between, world_velocity
from m2wr_sim.geometry import yaw_of
from m2wr_sim.model.types import PluginSpec, Surface
from m2wr_sim.runtime import changes


def twist(x=0.0, y=0.0, turn=0.0):
    message = Twist()
    message.linear.x, message.linear.y, message.angular.z = x, y, turn
    return message


@pytest.fixture
def make(make_rig):
    """Return a function that makes a rig with a slippery puck that moves as it is told."""
    def make_with(pose=at(z=0.25), namespace=None, tags=(), **options):
        rig = make_rig(joint_states=False, **options)
        spec = PluginSpec("move", "libgazebo_ros_planar_move.so", tuple(dict(tags).items()),
                          where="puck: plugin \"move\"")
        puck = box("puck", 0, 0, 0, static=False, mass=2.0, surface=Surface(mu=0.0, mu2=0.0))
        rig.simulator.spawn(replace(puck, plugins=(spec,)), pose, namespace=namespace)
        return rig
    return make_with


@pytest.mark.parametrize("command, expected", [((0.5, 0.0), (0.0, 0.5)), ((0.0, 0.5), (-0.5, 0.0)),
                                               ((0.3, -0.4), (0.4, 0.3))])
def test_it_moves_along_its_own_axes(make, command, expected):
    rig = make(at(z=0.25, yaw=0.5 * math.pi))
    rig.ports.send("/cmd_vel", twist(*command))
    position, turn = rig.run(2.0).pose("puck")
    assert position[:2] == pytest.approx([2.0 * value for value in expected], abs=2e-3)
    assert yaw_of(turn) == pytest.approx(0.5 * math.pi, abs=1e-3)


def test_stored_centre_of_mass_does_not_move_it(make):
    """set_link_properties stores what does not act yet, as Gazebo does: 1e308 m here."""
    rig = make()
    model = rig.simulator.models["puck"]
    inertial = replace(model.record.links[0].inertial, pose=((0.0, -1.7e308, 0.0), (0.0, 0.0, 0.0, 1.0)))
    changes.set_link_properties(rig.simulator, model, "link", True, inertial, solve=False)
    rig.ports.send("/cmd_vel", twist(0.5, 0.0, 1.0))
    expected = 0.5 * math.sin(2.0), 0.5 * (1.0 - math.cos(2.0))
    assert rig.run(2.0).pose("puck")[0][:2] == pytest.approx(expected, abs=0.01)


def test_it_follows_a_circle(make):
    rig = make()
    rig.ports.send("/cmd_vel", twist(0.5, 0.0, 1.0))
    position, turn = rig.run(2.0).pose("puck")
    assert yaw_of(turn) == pytest.approx(2.0, abs=0.005)
    assert position[:2] == pytest.approx((0.5 * math.sin(2.0), 0.5 * (1.0 - math.cos(2.0))), abs=0.005)


def test_motion_starts_in_the_first_step_and_stops_with_command(make):
    rig = make()
    rig.ports.send("/cmd_vel", twist(1.0))
    assert rig.run(0.001).pose("puck")[0][0] == pytest.approx(0.001, rel=1e-6)
    rig.ports.send("/cmd_vel", twist())
    before = rig.run(0.001).pose("puck")[0][0]
    assert rig.run(1.0).pose("puck")[0][0] == pytest.approx(before, abs=1e-9)


def test_odometry(make):
    rig = make(at(1.0, 2.0, 0.25, 0.5))
    rig.ports.send("/cmd_vel", twist(0.5, 0.2, 0.3))
    rig.run(1.0)
    message = rig.messages("/odom")[-1]
    assert rig.stamps_ms("/odom")[:3] == [51, 102, 153]
    assert (message.header.frame_id, message.child_frame_id) == ("odom", "base_footprint")
    speed = message.twist.twist
    assert (speed.linear.x, speed.linear.y, speed.angular.z) == pytest.approx((0.5, 0.2, 0.3), abs=0.01)
    assert message.pose.pose.position.z == 0.0
    assert [message.pose.covariance[index] for index in range(0, 36, 7)] == [1e-5, 1e-5, 1e12, 1e12, 1e12, 1e-3]
    assert not any(message.twist.covariance)
    stamp, parent, child, position, _ = rig.ports.transforms[-1]
    assert (stamp, parent, child) == (message.header.stamp, "odom", "base_footprint")
    assert position[2] == pytest.approx(0.25, abs=1e-3)


def test_fast_rotation_reports_the_commanded_rate(make):
    rig = make()
    rig.ports.send("/cmd_vel", twist(turn=100.0))
    assert rig.run(0.5).messages("/odom")[-1].twist.twist.angular.z == 100.0


def test_without_rate_moves_without_odometry(make):
    rig = make(tags={"odometryRate": "0"})
    rig.ports.send("/cmd_vel", twist(0.5))
    assert rig.run(1.0).messages("/odom") == [] and rig.pose("puck")[0][0] == pytest.approx(0.5, abs=1e-3)


@pytest.mark.parametrize("tags, options", [({"cmdTimeout": "0.2"}, {}), ({}, {"command_timeout_ns": 200000000})])
def test_a_command_may_time_out(make, tags, options):
    rig = make(tags=tags, **options)
    rig.ports.send("/cmd_vel", twist(1.0))
    assert rig.run(2.0).pose("puck")[0][0] == pytest.approx(0.2, abs=0.002)


@pytest.mark.parametrize("tags", [{}, {"cmdTimeout": "-1e308"}, {"cmdTimeout": "1e308"}])
def test_command_stays_active_by_default(make, tags):
    rig = make(tags=tags)
    rig.ports.send("/cmd_vel", twist(1.0))
    assert rig.run(3.0).pose("puck")[0][0] == pytest.approx(3.0, abs=0.002)


def test_non_finite_command_is_rejected(make, caplog):
    rig = make()
    rig.ports.send("/cmd_vel", twist(1.0))
    rig.run(1.0)
    rig.ports.send("/cmd_vel", twist(y=math.nan))
    assert rig.run(1.0).pose("puck")[0][0] == pytest.approx(2.0, abs=0.002)
    assert "refused a velocity command" in caplog.text


@pytest.mark.parametrize("bad", [twist(1e12), twist(y=-1e100), twist(turn=1e300), twist(1.1e4)])
def test_command_above_the_limit_is_rejected(make, caplog, bad):
    rig = make()
    rig.ports.send("/cmd_vel", twist(1.0))
    rig.run(0.5)
    for _ in range(3):
        rig.ports.send("/cmd_vel", bad)
        rig.run(0.5)
    assert rig.pose("puck")[0][0] == pytest.approx(2.0, abs=0.002)
    assert caplog.text.count("refused a velocity command") == 1


def test_command_at_the_limit_is_accepted(make):
    rig = make()
    rig.ports.send("/cmd_vel", twist(1e4, -1e4, 1e4))
    rig.run(0.5)
    assert all(math.isfinite(value) for part in rig.pose("puck") for value in part)


def test_reset_clears_command_and_odometry(make):
    rig = make()
    rig.ports.send("/cmd_vel", twist(1.0))
    rig.run(1.0)
    rig.simulator.reset_world()
    rig.run(0.06)
    message = rig.messages("/odom")[-1]
    assert message.pose.pose.position.x == message.twist.twist.linear.x == pytest.approx(0.0, abs=1e-6)


def test_names_follow_the_tags(make):
    rig = make(namespace="/bot", tags={"commandTopic": "go", "odometryTopic": "where", "odometryFrame": "map",
                                       "robotBaseFrame": "puck"}).run(0.1)
    assert "/bot/go" in rig.ports.subscriptions
    message = rig.messages("/bot/where")[-1]
    assert (message.header.frame_id, message.child_frame_id) == ("map", "puck")


def test_joint_rotation_is_kept(make_rig, m2wr):
    rig = make_rig(joint_states=False)
    spec = PluginSpec("move", "libgazebo_ros_planar_move.so", (), where="x")
    rig.simulator.spawn(replace(m2wr, plugins=(spec,)), at(z=0.1))
    rig.ports.send("/cmd_vel", twist(0.5))
    rig.run(2.0)
    assert rig.rate("joint_left_wheel") == pytest.approx(5.0, rel=0.02)
    assert rig.pose()[0][0] == pytest.approx(1.0, rel=0.02)


# -- the arithmetic -----------------------------------------------------------------------------------------------

def test_world_velocity_inverts_twist():
    before, elapsed = (1.0, 2.0, 3.1), 0.01
    x, y = world_velocity(before[2], 0.4, -0.3)
    after = (before[0] + elapsed * x, before[1] + elapsed * y, before[2])
    assert twist_between(before, after, elapsed) == pytest.approx((0.4, -0.3, 0.0))


@pytest.mark.parametrize("before, after, turned", [(3.0, -3.0, 0.2832), (-3.0, 3.0, -0.2832), (0.1, 0.3, 0.2)])
def test_rotation_is_the_shorter_one(before, after, turned):
    assert twist_between((0, 0, before), (0, 0, after), 1.0)[2] == pytest.approx(turned, abs=1e-4)

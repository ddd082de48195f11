# SPDX-License-Identifier: BSD-3-Clause
"""Sliding wheels: closed forms of the friction ellipse, and turns of four-wheeled robots, against friction theory.

A robot with its centre of mass between four wheels, base L and track B, turns at a rate w about its middle while the
rims of its wheels run at u.  Each wheel slides by v1 = u - w B / 2 along and v2 = w L / 2 across.  The moments of both
forces cancel: mu1^2 v1 B = mu2^2 v2 L.  So w is the rate 2 u / B that wheel odometry reports, divided by
1 + (mu2 L)^2 / (mu1 B)^2.  For L = 0.512 m and B = 0.571 m that is 1.80, for 0.262 m and 0.376 m it is 1.49; the makers
of two such robots measured factors of 1.875 and 1.5, by which their controllers multiply the track.
"""
import math

import pytest

from conftest import at, ground
from m2wr_sim.geometry import yaw_of
from m2wr_sim.model.urdf.loader import load_urdf
from m2wr_sim.physics.sliding import first_direction, sliding_slips
from m2wr_sim.physics.wheels import skids, wheel_poses

RADIUS, CORNERS = 0.15, {"fl": (0.5, 0.5), "fr": (0.5, -0.5), "rl": (-0.5, 0.5), "rr": (-0.5, -0.5)}
BODY = """<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/><inertia ixx="{3}" iyy="{3}" izz="{3}"
ixy="0" ixz="0" iyz="0"/></inertial>{4}</link>"""
WHEEL = '<collision><origin rpy="{} 0 0"/><geometry><cylinder radius="0.15" length="0.1"/></geometry></collision>'
DIRECTIONS = ["", "<fdir1>1 0 0</fdir1>", "<fdir1>0 0 1</fdir1>"]       # none; turns with the wheel; its axle


def cart(base, track, mu1=1.0, mu2=1.0, direction="", ahead=0.0):
    """A box on four wheels; ``ahead``: of its centre of mass [m]."""
    text = BODY.format("box", ahead, 30.0, 0.8, "")
    for name, (x, y) in CORNERS.items():
        text += BODY.format(name, 0.0, 2.0, 0.02, WHEEL.format(0.5 * math.pi))
        text += '<gazebo reference="%s"><mu1>%r</mu1><mu2>%r</mu2>%s</gazebo>' % (name, mu1, mu2, direction)
        text += ('<joint name="%s_joint" type="continuous"><parent link="box"/><child link="%s"/>'
                 '<origin xyz="%r %r 0"/><axis xyz="0 1 0"/></joint>' % (name, name, x * base, y * track))
    return load_urdf("<robot name='cart'>%s</robot>" % text, "test")


@pytest.fixture
def drive(make_engine):
    """Return a function that drives a cart; it returns distance and rotation, true and by its wheels."""
    def run(robot, left, right, track, seconds=4.0):
        engine = make_engine(models=(ground(),))
        handle = engine.add_model(robot, at(z=RADIUS))
        joints, box = handle.joints, handle.links["box"]
        engine.step(200)
        for name, joint in joints.items():
            engine.set_joint_motor(joint, (left if name[1] == "l" else right) / RADIUS, 1e6)
        engine.step(300)                                # while it gains speed, its wheels spin
        start = engine.link_pose(box)
        angles = {name: engine.joint_angle(joint) for name, joint in joints.items()}
        yaw, last = 0.0, yaw_of(start[1])
        for _ in range(int(seconds * 20)):
            engine.step(50)
            now = yaw_of(engine.link_pose(box)[1])
            yaw, last = yaw + math.remainder(now - last, 2.0 * math.pi), now
        end = engine.link_pose(box)[0]
        way = {name: RADIUS * (engine.joint_angle(joint) - angles[name]) for name, joint in joints.items()}
        wheels = [0.5 * sum(value for name, value in way.items() if name[1] == side) for side in "lr"]
        moved = (end[0] - start[0][0], end[1] - start[0][1])
        return moved, yaw, 0.5 * sum(wheels), (wheels[1] - wheels[0]) / track
    return run


@pytest.mark.parametrize("direction", DIRECTIONS)
@pytest.mark.parametrize("base, track", [(0.512, 0.571), (0.262, 0.376), (0.6, 0.4)])
def test_pivot_is_that_of_friction_theory(drive, direction, base, track):
    moved, yaw, _, odometry = drive(cart(base, track, 0.5, 0.5, direction), -0.2, 0.2, track)
    assert yaw / odometry == pytest.approx(1.0 / (1.0 + (base / track) ** 2), rel=0.01)
    assert math.hypot(*moved) < 0.005


@pytest.mark.parametrize("mu1, mu2", [(1.0, 0.5), (0.5, 1.0)])
@pytest.mark.parametrize("direction, swapped", zip(DIRECTIONS[1:], (False, True)))
def test_mu1_acts_along_fdir1(drive, mu1, mu2, direction, swapped):
    moved, yaw, _, odometry = drive(cart(0.3, 0.4, mu1, mu2, direction), -0.2, 0.2, 0.4)
    along, across = (mu2, mu1) if swapped else (mu1, mu2)
    # a direction that turns with the wheel is normal to the ground for 1 % of the time, and not followed then
    assert yaw / odometry == pytest.approx(1.0 / (1.0 + (across * 0.3 / (along * 0.4)) ** 2), rel=0.03)
    assert math.hypot(*moved) < 0.01


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_a_load_in_front_does_not_drive_it_away(drive, direction):
    moved, yaw, _, odometry = drive(cart(0.5, 0.57, direction=direction, ahead=0.05), -0.2, 0.2, 0.57)
    assert math.hypot(*moved) < 0.15                    # with the friction pyramid 0.45
    assert 1.0 / (1.0 + (0.5 / 0.57) ** 2) < yaw / odometry < 1.0       # wheels with less load slide more


@pytest.mark.parametrize("direction", DIRECTIONS)
def test_ahead_it_drives_as_its_wheels_roll(drive, direction):
    moved, yaw, distance, _ = drive(cart(0.5, 0.57, direction=direction, ahead=0.05), 0.5, 0.5, 0.57)
    assert moved[0] == pytest.approx(distance, rel=0.001) and distance == pytest.approx(2.0, rel=0.01)
    assert abs(moved[1]) < 0.001 and abs(yaw) < 0.001


def test_two_wheels_on_one_axis_do_not_slide(drive):
    robot = cart(0.0, 0.57)
    moved, yaw, _, odometry = drive(robot, -0.2, 0.2, 0.57)
    assert yaw == pytest.approx(odometry, rel=0.002) and math.hypot(*moved) < 0.001


def test_slips_give_forces_of_the_ellipse():
    for velocity in ((0.3, 0.0, 0.0), (0.1, -0.2, 0.0), (0.0, 0.01, 0.0)):
        slips = sliding_slips(velocity, (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), 0.8, 0.4, 50.0)
        along, across = velocity[0] / slips[0], velocity[1] / slips[1]
        assert math.hypot(along / 0.8, across / 0.4) == pytest.approx(50.0)
        assert math.atan2(across * 0.8 ** 2, along * 0.4 ** 2) == pytest.approx(math.atan2(
            velocity[1] * 0.4 ** 2 * 0.8 ** 2, velocity[0] * 0.8 ** 2 * 0.4 ** 2))


def test_without_slip_or_load_the_wheel_holds():
    up, ahead = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0)
    assert sliding_slips((0.0, 0.0, 0.5), up, ahead, 1.0, 1.0, 50.0) == (0.0, 0.0)
    assert sliding_slips((0.3, 0.1, 0.0), up, ahead, 1.0, 1.0, 0.0) == (0.0, 0.0)
    assert sliding_slips((math.nan, 0.1, 0.0), up, ahead, 1.0, 1.0, 50.0) == (0.0, 0.0)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (0.0, 0.6, 0.8), (1.0, 0.0, 0.0), (0.6, -0.8, 0.0)])
def test_first_direction_is_along_the_surface(normal):
    first = first_direction(normal)
    assert sum(value * value for value in first) == pytest.approx(1.0)
    assert sum(one * two for one, two in zip(first, normal)) == pytest.approx(0.0, abs=1e-12)


def test_only_wheels_on_several_axles_skid(m2wr, make_engine):
    robot = cart(0.5, 0.6)

    def skid(links, joints=robot.joints):
        return skids(links, wheel_poses(links, joints))

    assert skid(robot.links) and not skid(m2wr.links, m2wr.joints)
    pair = robot.links[:1] + tuple(link for link in robot.links if link.name in ("fl", "fr"))
    assert not skid(pair)            # two wheels on one axle
    front, rear = robot.links[1], next(link for link in robot.links if link.name == "rl")
    assert skid((front, rear)) and not skid((front,)) and not skid((), ())
    # a robot whose wheels share an axle moves as libode moves it: slips that depend on forces are not set
    one_axle, two_axles = make_engine(), make_engine()
    one_axle.add_model(m2wr, at())
    two_axles.add_model(robot, at())
    assert not any(shape.skids for shape in one_axle._shapes.values())
    assert sum(shape.skids for shape in two_axles._shapes.values()) == 4

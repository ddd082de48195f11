# SPDX-License-Identifier: BSD-3-Clause
"""Merging over fixed joints: inertia against closed forms, order and names against Gazebo's rules."""
import math

import numpy as np
import pytest

from m2wr_sim.geometry import IDENTITY, compose, matrix_from_quaternion, quaternion_from_rpy
from m2wr_sim.model.sdf.shapes import inertia_matrix
from m2wr_sim.model.types import Box, Inertial, Sphere
from m2wr_sim.model.urdf.lumping import Body, Connection, Part, lump, merge_inertials, part_names

UNIT_BALL = Inertial(1.0, IDENTITY, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4))


def at(x, y=0.0, z=0.0, roll=0.0, pitch=0.0, yaw=0.0):
    return (x, y, z), quaternion_from_rpy(roll, pitch, yaw)


def box_inertial(mass, x, y, z, pose=IDENTITY):
    return Inertial(mass, pose, (mass * (y * y + z * z) / 12, 0.0, 0.0, mass * (x * x + z * z) / 12, 0.0,
                                 mass * (x * x + y * y) / 12))


def about_link_origin(inertial):
    """Return (mass, first moment, tensor about the link's origin) in link axes: what a rigid body is, frame-free."""
    centre, turn = np.array(inertial.pose[0]), matrix_from_quaternion(inertial.pose[1])
    tensor = turn @ inertia_matrix(inertial) @ turn.T
    return (inertial.mass, inertial.mass * centre,
            tensor + inertial.mass * (centre @ centre * np.eye(3) - np.outer(centre, centre)))


def test_two_balls_make_a_dumb_bell():
    merged = merge_inertials(Inertial(1.0, at(-0.5), UNIT_BALL.inertia), UNIT_BALL, at(0.5))
    assert merged.mass == 2.0
    assert merged.pose[0] == pytest.approx((0.0, 0.0, 0.0))
    assert merged.inertia == pytest.approx((0.8, 0.0, 0.0, 1.3, 0.0, 1.3))    # 2 * 0.4, and + 2 * 1 * 0.5^2


def test_two_half_boxes_make_the_whole_box():
    half = box_inertial(3.0, 0.5, 0.2, 0.1)
    merged = merge_inertials(half, half, at(0.5))
    assert merged.pose[0] == pytest.approx((0.25, 0.0, 0.0))
    assert merged.inertia == pytest.approx(box_inertial(6.0, 1.0, 0.2, 0.1).inertia)


def test_result_is_expressed_in_the_parents_inertial_orientation():
    parent = box_inertial(2.0, 0.3, 0.6, 0.9, at(0.1, 0.2, 0.3, 0.4, -0.5, 0.6))
    child = box_inertial(5.0, 0.7, 0.1, 0.2, at(-0.3, 0.1, 0.0, -1.0, 0.2, 0.9))
    parent_from_child = at(1.0, -2.0, 0.5, 0.3, 0.7, -2.0)
    merged = merge_inertials(parent, child, parent_from_child)
    assert merged.pose[1] == parent.pose[1]
    moved = Inertial(child.mass, compose(parent_from_child, child.pose), child.inertia)
    for got, one, other in zip(about_link_origin(merged), about_link_origin(parent), about_link_origin(moved)):
        assert got == pytest.approx(one + other)


def test_parent_without_inertial_gets_that_of_merged_links():
    merged = merge_inertials(None, UNIT_BALL, at(0.0, 2.0, 0.0, 0.0, 0.0, 1.0))
    assert merged.mass == 1.0 and merged.pose == ((0.0, 2.0, 0.0), IDENTITY[1])
    assert merged.inertia == pytest.approx(UNIT_BALL.inertia)
    assert merge_inertials(UNIT_BALL, None) is UNIT_BALL
    assert merge_inertials(None, None) is None


def bodies_of(*names, **inertials):
    return {name: Body(name, inertials.get(name, UNIT_BALL), [Part("", name, Sphere(1.0))]) for name in names}


def test_chain_of_fixed_joints_is_merged_into_the_root():
    bodies = bodies_of("root", "arm", "tip")
    joints = [Connection("j_arm", "fixed", "root", "arm", at(1.0, yaw=math.pi / 2), reduced=True),
              Connection("j_tip", "fixed", "arm", "tip", at(2.0), reduced=True)]
    assert lump(bodies, joints, "root") == ["root"] and joints == [] and list(bodies) == ["root"]
    root = bodies["root"]
    assert root.inertial.mass == 3.0
    poses = dict(root.lumped)
    assert set(poses) == {"arm", "tip"}
    assert poses["tip"][0] == pytest.approx((1.0, 2.0, 0.0))
    assert [part.origin for part in root.collisions] == ["root", "arm", "tip"]
    assert root.collisions[2].pose[0] == pytest.approx((1.0, 2.0, 0.0))
    assert part_names("root", root.collisions, "_collision") == [
        "root_collision", "root_fixed_joint_lump__arm_collision_1", "root_fixed_joint_lump__tip_collision_2"]


def test_moving_joints_below_a_merged_link_go_to_its_parent():
    bodies = bodies_of("root", "mast", "dish")
    joints = [Connection("a", "fixed", "root", "mast", at(0.0, 0.0, 1.0, yaw=math.pi / 2), reduced=True),
              Connection("b", "revolute", "mast", "dish", at(0.5))]
    assert lump(bodies, joints, "root") == ["root", "dish"]
    assert [(joint.name, joint.parent) for joint in joints] == [("b", "root")]
    assert joints[0].pose[0] == pytest.approx((0.0, 0.5, 1.0))


def test_order_is_depth_first_by_joint_name():
    bodies = bodies_of("r", "x", "y", "z", "x1")
    joints = [Connection("j3", "revolute", "r", "x"), Connection("j1", "revolute", "r", "z"),
              Connection("j2", "revolute", "r", "y"), Connection("j0", "revolute", "x", "x1")]
    assert lump(bodies, joints, "r") == ["r", "z", "y", "x", "x1"]


def test_nothing_is_merged_into_a_root_called_world():
    bodies = bodies_of("world", "base", "lamp")
    joints = [Connection("bolt", "fixed", "world", "base", reduced=True),
              Connection("hold", "fixed", "base", "lamp", at(1.0), reduced=True)]
    assert lump(bodies, joints, "world") == ["world", "base"]
    assert [joint.name for joint in joints] == ["bolt"]
    assert bodies["base"].inertial.mass == 2.0


def test_kept_fixed_joint_keeps_its_link():
    bodies = bodies_of("root", "camera")
    joints = [Connection("j", "fixed", "root", "camera", reduced=False)]
    assert lump(bodies, joints, "root") == ["root", "camera"] and len(joints) == 1


@pytest.mark.parametrize("link, urdf_names, expected", [
    ("base", ["", ""], ["base_collision", "base_collision_1"]),
    ("base", ["base_plate"], ["base_plate_collision"]),
    ("base", ["plate", "base"], ["base_fixed_joint_lump__plate_collision", "base_collision_1"]),
])
def test_collision_names(link, urdf_names, expected):
    parts = [Part(name, link, Box((1.0, 1.0, 1.0))) for name in urdf_names]
    assert part_names(link, parts, "_collision") == expected

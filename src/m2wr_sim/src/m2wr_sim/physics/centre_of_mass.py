# SPDX-License-Identifier: BSD-3-Clause
"""Moves the centre of mass of a link in a running world: the origin of its body, to which geoms and joints refer."""
from __future__ import annotations

from typing import TYPE_CHECKING, Sequence

from m2wr_sim.geometry import cross, rotate
from m2wr_sim.model.types import Heightmap, Plane
from m2wr_sim.physics import pyode_bodies as bodies
from m2wr_sim.physics.wheels import wheel_poses

if TYPE_CHECKING:
    from m2wr_sim.physics.parts import LinkBody, ModelParts


def move_centre(parts: ModelParts, link: LinkBody, com: Sequence[float]) -> None:
    """Change the centre of mass of a link. Its pose and its motion do not change.

    ODE takes the anchors and zero angles of joints from the present poses of the bodies.  Therefore the link and those
    connected to it by joints are moved to their initial poses and back.

    Parameters
    ----------
    parts : ModelParts
        The link's model.
    link : LinkBody
    com : (3,) of float
        The new centre of mass, in the link frame.
    """
    by_name = {entry.spec.name: entry for entry in parts.links}
    joints = [drive for drive in parts.joints if link.spec.name in (drive.spec.child, drive.spec.parent)]
    names = {link.spec.name}.union(*((drive.spec.child, drive.spec.parent) for drive in joints))
    kept = [(entry, entry.body.getPosition(), entry.body.getQuaternion())
            for entry in parts.links if entry.spec.name in names and entry is not link]
    pose = bodies.link_pose(link)
    x, y, z = com
    shift = rotate(pose[1], (x - link.com[0], y - link.com[1], z - link.com[2]))
    linear, angular = link.body.getLinearVel(), link.body.getAngularVel()
    link.com = (x, y, z)
    _shift_geoms(parts, link)
    for entry in [link] + [entry for entry, _, _ in kept]:
        bodies.place_body(entry.body, entry.com, entry.pose)
    for drive in joints:
        bodies.anchor_joint(drive.joint, drive.spec, by_name[drive.spec.child])
    for entry, position, quaternion in kept:
        entry.body.setPosition(position)
        entry.body.setQuaternion(quaternion)
    bodies.place_body(link.body, link.com, pose)
    link.body.setLinearVel(tuple(a + b for a, b in zip(linear, cross(angular, shift))))


def _shift_geoms(parts: ModelParts, link: LinkBody) -> None:
    wheels = wheel_poses([entry.spec for entry in parts.links], [drive.spec for drive in parts.joints])
    for geom, collision in link.geoms:
        if not isinstance(collision.geometry, (Plane, Heightmap)):          # those two are on no body
            x, y, z = wheels.get((link.spec.name, collision.name), collision.pose)[0]
            geom.setOffsetPosition((x - link.com[0], y - link.com[1], z - link.com[2]))

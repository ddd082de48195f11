# SPDX-License-Identifier: BSD-3-Clause
"""Finds the wheels of a model, and the initial poses of its links. Uses no objects of the engine."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, Iterable, Tuple

from m2wr_sim.geometry import compose, multiply, rotate, rotate_inverse
from m2wr_sim.model.types import Cylinder

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Quaternion
    from m2wr_sim.model.types import Joint, Link

_WHEEL_ALIGNMENT = math.cos(math.radians(2.0))      # between the axes of a cylinder and its joint: it is a wheel
_SAME_AXLE = 0.01       # m between the axes of two wheels on one axle: more than a model's rounding
_WHEEL_SNAP = math.cos(math.radians(0.1))           # below that angle the axes are aligned


def wheel_poses(links: Iterable[Link], joints: Iterable[Joint]) -> Dict[Tuple[str, str], Pose]:
    """Find the cylinders that are wheels: their link rotates about the axis of the cylinder.

    Model files often round a quarter turn, for instance to 1.5707.  A wheel that is tilted by that little makes the
    robot deviate by millimetres in a few metres.  Therefore an axis within 0.1 degrees of that of the joint is aligned
    with it exactly.

    Parameters
    ----------
    links : iterable of m2wr_sim.model.types.Link
        Of a model.
    joints : iterable of m2wr_sim.model.types.Joint
        Of the same model.

    Returns
    -------
    dict
        ``{(link name, collision name): pose of the cylinder in the link frame}``
    """
    wheels: Dict[Tuple[str, str], Pose] = {}
    by_name = {link.name: link for link in links}
    for joint in joints:
        if joint.kind != "revolute" or joint.child not in by_name:
            continue
        axis = rotate(joint.pose[1], joint.axis.xyz)
        norm = math.sqrt(sum(value * value for value in axis))
        for collision in by_name[joint.child].collisions:
            if not isinstance(collision.geometry, Cylinder) or norm == 0.0:
                continue
            position, orientation = collision.pose
            along = rotate_inverse(orientation, tuple(value / norm for value in axis))
            if abs(along[2]) >= _WHEEL_SNAP:
                sign = math.copysign(1.0, along[2])
                # shortest rotation from the cylinder's z axis to `along`; first order is exact enough here
                orientation = _unit(multiply(orientation, (-0.5 * sign * along[1], 0.5 * sign * along[0], 0.0, 1.0)))
            if abs(along[2]) >= _WHEEL_ALIGNMENT:
                wheels[joint.child, collision.name] = (position, orientation)
    return wheels


def skids(links: Iterable[Link], wheels: Dict[Tuple[str, str], Pose]) -> bool:
    """Return whether a model has wheels on several axles: some of them must slide when it turns, unless they steer.

    Parameters
    ----------
    links : iterable of m2wr_sim.model.types.Link
        Of a model.
    wheels : dict
        Its :func:`wheel_poses`.
    """
    by_name = {link.name: link for link in links}
    axles = []
    for (link, _), (centre, orientation) in wheels.items():
        position, turned = compose(by_name[link].pose, (centre, orientation))
        axles.append((position, rotate(turned, (0.0, 0.0, 1.0))))
    for position, _ in axles[1:]:
        apart = tuple(position[k] - axles[0][0][k] for k in range(3))
        along = sum(apart[k] * axles[0][1][k] for k in range(3))
        if math.sqrt(max(0.0, sum(value * value for value in apart) - along * along)) > _SAME_AXLE:
            return True
    return False


def initial_link_pose(model_pose: Pose, link: Link) -> Pose:
    """Return the world pose of a link in the model's initial configuration.

    Parameters
    ----------
    model_pose : pose
        Of the model frame in the world.
    link : m2wr_sim.model.types.Link

    Returns
    -------
    pose
    """
    position, orientation = compose(model_pose, link.pose)
    return (position, _unit(orientation))


def _unit(quaternion: Quaternion) -> Quaternion:
    x, y, z, w = quaternion
    norm = math.sqrt(sum(value * value for value in quaternion))
    return (x / norm, y / norm, z / norm, w / norm)

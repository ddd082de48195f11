# SPDX-License-Identifier: BSD-3-Clause
"""Builds ODE bodies, geoms and joints from model records, through the Python binding.

The origin of an ODE body must be its centre of mass.  Therefore a body has the axes of its link's frame, and its origin
is shifted by ``com`` (in the link frame).  Geoms have the opposite shift.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Optional, Sequence, Tuple

import ode

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY, compose, rotate
from m2wr_sim.model.types import SECOND_AXIS, Box, Cylinder, Heightmap, Mesh, Plane, Sphere
from m2wr_sim.physics.contacts import MODE_FDIR1, along_surface
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE
from m2wr_sim.physics.joint_axes import NativePiston, axis_access
from m2wr_sim.physics.limits import SOFTEST, check_inertial, link_tensor
from m2wr_sim.physics.native_shapes import height_geom, mesh_geom
from m2wr_sim.physics.parts import JointDrive

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Quaternion
    from m2wr_sim.model.types import Axis, Collision, Inertial, Joint, Link
    from m2wr_sim.physics.contacts import PairSurface
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.parts import LinkBody, ModelParts

CATEGORY_STATIC, CATEGORY_MOVING = 1, 2
COLLIDE_EVERYTHING = 0x7fffffff

# Joint parameters of ODE 0.16 by number: the constants of the binding are those of an older library, without effect.
PARAM_LO_STOP, PARAM_HI_STOP, PARAM_VEL, PARAM_FMAX, PARAM_CFM = 0, 1, 2, 5, 8
PARAM_STOP_ERP, PARAM_STOP_CFM = 9, 10
PARAMETERS = {"lower": PARAM_LO_STOP, "upper": PARAM_HI_STOP, "rate": PARAM_VEL, "max_force": PARAM_FMAX,
              "fudge_factor": 6, "cfm": PARAM_CFM, "stop_erp": PARAM_STOP_ERP, "stop_cfm": PARAM_STOP_CFM, "erp": 13}


def ode_quaternion(quaternion: Sequence[float]) -> Quaternion:
    """Reorder ``(x, y, z, w)`` to ODE's ``(w, x, y, z)``."""
    return (quaternion[3], quaternion[0], quaternion[1], quaternion[2])


def make_mass(inertial: Inertial, name: str) -> ode.Mass:
    """Return ODE's mass of an Inertial, in link axes about the centre of mass.

    Parameters
    ----------
    inertial : m2wr_sim.model.types.Inertial
    name : str
        Name of the link, for messages.

    Returns
    -------
    ode.Mass

    Raises
    ------
    ModelError
        If mass or inertia are not those of a physical body, or beyond the limits of ODE.
    """
    check_inertial(inertial, name)
    tensor = link_tensor(inertial)
    mass = ode.Mass()
    mass.setParameters(inertial.mass, 0.0, 0.0, 0.0, tensor[0, 0], tensor[1, 1], tensor[2, 2],
                       tensor[0, 1], tensor[0, 2], tensor[1, 2])
    return mass


def make_body(world: ode.World, link: Link, name: str, pose: Pose) -> ode.Body:
    """Create the body of a movable link.

    Parameters
    ----------
    world : ode.World
    link : m2wr_sim.model.types.Link
    name : str
        ``model::link``, for messages.
    pose : pose
        Of the link frame in the world.

    Returns
    -------
    ode.Body

    Raises
    ------
    ModelError
        If mass or inertia are not those of a physical body.
    """
    mass = make_mass(link.inertial, name)
    body = ode.Body(world)
    body.setMass(mass)
    body.setGravityMode(bool(link.gravity))
    if link.kinematic:
        body.setKinematic()
    place_body(body, link.inertial.pose[0], pose)
    return body


def place_body(body: ode.Body, com: Sequence[float], pose: Pose) -> None:
    """Move a body so that its link frame has a given pose.

    Parameters
    ----------
    body : ode.Body
    com : (3,) sequence of float
        Centre of mass in the link frame [m].
    pose : pose
        Of the link frame in the world.
    """
    position, orientation = pose
    shift = rotate(orientation, com)
    body.setPosition((position[0] + shift[0], position[1] + shift[1], position[2] + shift[2]))
    body.setQuaternion(ode_quaternion(orientation))


def make_geom(collision: Collision, space: ode.SpaceBase, where: str) -> Geom:
    """Create the geom of a collision; planes are made by :func:`make_plane`.

    Parameters
    ----------
    collision : m2wr_sim.model.types.Collision
    space : ode.SpaceBase
        Space that gets the geom.
    where : str
        ``model::link::collision``, for messages.

    Returns
    -------
    ode.GeomObject or NativeGeom

    Raises
    ------
    ModelError
        If the kind of the geometry is not supported, or its size is out of range.
    """
    geometry = collision.geometry
    sizes: Sequence[float]
    arguments: Tuple[Any, ...]
    if isinstance(geometry, Mesh):
        return mesh_geom(geometry, space, where)
    if isinstance(geometry, Heightmap):
        return height_geom(geometry, space, where)
    if isinstance(geometry, Box):
        sizes, geom = geometry.size, ode.GeomBox
        arguments = (tuple(geometry.size),)
    elif isinstance(geometry, Sphere):
        sizes, geom = (geometry.radius,), ode.GeomSphere
        arguments = (geometry.radius,)
    elif isinstance(geometry, Cylinder):
        sizes, geom = (geometry.radius, geometry.length), ode.GeomCylinder
        arguments = (geometry.radius, geometry.length)
    else:
        raise ModelError("%s: cannot collide with a %s; expected a box, sphere, cylinder, plane, mesh or heightmap"
                         % (where, type(geometry).__name__))
    if not all(LEAST_SIZE <= size <= FARTHEST for size in sizes):
        raise ModelError("%s: size %s; expected %g to %g m" % (where, list(sizes), LEAST_SIZE, FARTHEST))
    return geom(space, *arguments)


def make_plane(collision: Collision, plane: Plane, link_pose: Pose, space: ode.SpaceBase) -> ode.GeomPlane:
    """Create the geom of a plane, through the height of the collision.

    As in Gazebo, the normal is in world axes for any pose, and moving the model later does not move the plane.

    Parameters
    ----------
    collision : m2wr_sim.model.types.Collision
    plane : m2wr_sim.model.types.Plane
        Its geometry.
    link_pose : pose
        Of the link frame in the world.
    space : ode.SpaceBase
        Space that gets the geom.

    Returns
    -------
    ode.GeomPlane

    Raises
    ------
    ModelError
        If the normal is zero.
    """
    nx, ny, nz = plane.normal
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not norm > 0.0:
        raise ModelError("collision %s: plane normal %s has no direction" % (collision.name, plane.normal))
    height = compose(link_pose, collision.pose)[0][2]
    return ode.GeomPlane(space, (nx / norm, ny / norm, nz / norm), nz / norm * height)


def attach_geom(geom: Geom, body: ode.Body, com: Sequence[float], pose: Pose) -> None:
    """Attach a geom to a body.

    Parameters
    ----------
    geom : ode.GeomObject or NativeGeom
    body : ode.Body
    com : (3,) sequence of float
        Centre of mass in the link frame [m].
    pose : pose
        Of the geom in the link frame.
    """
    position, orientation = pose
    geom.setBody(body)
    geom.setOffsetPosition((position[0] - com[0], position[1] - com[1], position[2] - com[2]))
    geom.setOffsetQuaternion(ode_quaternion(orientation))


def place_geom(geom: Geom, link_pose: Pose, pose: Pose) -> None:
    """Move the geom of a static link.

    Parameters
    ----------
    geom : ode.GeomObject or NativeGeom
    link_pose : pose
        Of the link frame in the world.
    pose : pose
        Of the collision in the link frame.
    """
    position, orientation = compose(link_pose, pose)
    position, orientation = compose((position, orientation), getattr(geom, "frame", IDENTITY))
    geom.setPosition(position)
    geom.setQuaternion(ode_quaternion(orientation))


def direct_friction(contact: ode.Contact, surface: PairSurface, geom: Geom) -> int:
    """Set the direction of mu of a contact, which rotates with one of the shapes.

    Parameters
    ----------
    contact : ode.Contact
    surface : PairSurface
        With a direction ``along``.
    geom : ode.GeomObject or NativeGeom
        The shape in whose frame ``along`` is.

    Returns
    -------
    int
        Mode of the contact; without ``MODE_FDIR1`` if the direction is nearly normal to the surface.
    """
    w, x, y, z = geom.getQuaternion()
    along = along_surface(rotate((x, y, z, w), surface.along), contact.getContactGeomParams()[1])
    if along is None:
        return surface.mode & ~MODE_FDIR1
    contact.setFDir1(along)
    return surface.mode


def make_joint(world: ode.World, spec: Joint, name: str, parent: Optional[LinkBody], child: LinkBody) -> JointDrive:
    """Create a joint between two links.

    As in Gazebo, the child is the first body: positions and rates are those of the child relative to the parent.

    Parameters
    ----------
    world : ode.World
    spec : m2wr_sim.model.types.Joint
    name : str
        ``model::joint``.
    parent : LinkBody or None
        None for the world.
    child : LinkBody

    Returns
    -------
    JointDrive

    Raises
    ------
    ModelError
        If the type of the joint is not supported.
    """
    first, second = child.body, parent.body if parent is not None else ode.environment
    kinds = {"revolute": ode.HingeJoint, "prismatic": ode.SliderJoint, "fixed": ode.FixedJoint, "ball": ode.BallJoint,
             "universal": ode.UniversalJoint, "screw": NativePiston}
    if spec.kind not in kinds:
        raise ModelError("joint %s: type %s; expected one of %s" % (name, spec.kind, ", ".join(sorted(kinds))))
    joint = kinds[spec.kind](world)
    joint.attach(first, second)
    anchor_joint(joint, spec, child)
    axes = [axis_access(spec.kind, joint, index) for index in range(max(1, len(spec.axes())))]
    for access, axis in zip(axes, spec.axes()):
        _set_up_axis(joint, spec.kind, axis, access.group)
    second = JointDrive(name + SECOND_AXIS, spec, joint, axes[1]) if len(axes) > 1 else None
    return JointDrive(name, spec, joint, axes[0], second)


def anchor_joint(joint: ode.Joint, spec: Joint, child: LinkBody) -> None:
    """Set anchor, axes and zero position of a joint from the present poses of its links, which are the initial ones.

    Parameters
    ----------
    joint : ode.Joint
    spec : m2wr_sim.model.types.Joint
    child : LinkBody
    """
    anchor, orientation = compose(link_pose(child), spec.pose)
    axis = rotate(orientation, spec.axis.xyz)
    if spec.kind == "fixed":
        joint.setFixed()
    elif spec.kind == "ball":
        joint.setAnchor(anchor)
    elif spec.kind == "universal":
        joint.setAnchor(anchor)
        # libode's first axis is the child's, a model's is the parent's
        joint.setAxis1(rotate(orientation, spec.axes()[1].xyz))
        joint.setAxis2(axis)
    else:
        if spec.kind != "prismatic":
            joint.setAnchor(anchor)
        joint.setAxis(axis)


def bounded_softness(cfm: float) -> float:
    """Limit a softness (CFM) [s/kg] to what the direct solver can use; at the limit a stop has no effect anyway."""
    return min(max(cfm, 0.0), SOFTEST)


def _set_up_axis(joint: ode.Joint, kind: str, axis: Axis, group: int) -> None:
    """Set stops and friction. Stops of a rotation beyond half a turn are omitted, as ODE does not have them."""
    bound = 1e15 if kind == "prismatic" else math.pi
    if axis.lower > -bound:
        joint.setParam(group + PARAM_LO_STOP, axis.lower)
    if axis.upper < bound:
        joint.setParam(group + PARAM_HI_STOP, axis.upper)
    if axis.lower > -bound or axis.upper < bound:
        joint.setParam(group + PARAM_STOP_ERP, axis.stop_erp)
        joint.setParam(group + PARAM_STOP_CFM, bounded_softness(axis.stop_cfm))
    if axis.fudge_factor is not None:
        joint.setParam(group + PARAMETERS["fudge_factor"], axis.fudge_factor)
    if axis.friction > 0.0:
        joint.setParam(group + PARAM_VEL, 0.0)
        joint.setParam(group + PARAM_FMAX, axis.friction)


def link_pose(link: LinkBody) -> Pose:
    """Return the pose of a link frame in the world."""
    if link.body is None:
        return link.pose
    w, x, y, z = link.body.getQuaternion()
    orientation = (x, y, z, w)
    px, py, pz = link.body.getPosition()
    shift = rotate(orientation, link.com)
    return ((px - shift[0], py - shift[1], pz - shift[2]), orientation)


def describe_loss(step: int, dt: float, parts: ModelParts, link: LinkBody) -> str:
    """Return a message about a body that left the world: time, state, and commands of its motors.

    Parameters
    ----------
    step, dt : int, float
        Number of the step, its length [s].
    parts : ModelParts
        The model of the body.
    link : LinkBody

    Returns
    -------
    str
    """
    motors = ["%s %g with up to %g" % (drive.name.partition("::")[2],
                                       drive.joint.getParam(drive.access.group + PARAM_VEL),
                                       drive.joint.getParam(drive.access.group + PARAM_FMAX))
              for drive in parts.drives() if drive.spec.axes()]
    return ("step %d (%g ms each): the simulation diverged: %s is at %s, with velocity %s m/s and angular velocity "
            "%s rad/s. Motors: %s" % (step, 1e3 * dt, link.name, link.body.getPosition(), link.body.getLinearVel(),
                                      link.body.getAngularVel(), ", ".join(motors) or "none"))

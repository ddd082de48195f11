# SPDX-License-Identifier: BSD-3-Clause
"""Build ODE bodies, geoms and joints from model records, through the Python binding.

A body's origin must be its centre of mass, a link's frame is where the model says: bodies keep their link's axes and
only the origin is shifted, by ``com`` (in link axes); geoms carry the same shift.
"""
import math

import ode

from m2wr_sim.errors import ModelError
from m2wr_sim.geometry import IDENTITY, compose, multiply, rotate, rotate_inverse
from m2wr_sim.model.types import Box, Cylinder, Heightmap, Mesh, Sphere
from m2wr_sim.physics.contacts import MODE_FDIR1, along_surface
from m2wr_sim.physics.engine import FARTHEST, LEAST_SIZE
from m2wr_sim.physics.idle import Countdown
from m2wr_sim.physics.limits import SOFTEST, check_inertial, turned_tensor
from m2wr_sim.physics.native_shapes import height_geom, mesh_geom

CATEGORY_STATIC, CATEGORY_MOVING = 1, 2
COLLIDE_EVERYTHING = 0x7fffffff

# Joint parameters of ODE 0.16 by number: the binding's own constants are those of an older library and do nothing.
PARAM_LO_STOP, PARAM_HI_STOP, PARAM_VEL, PARAM_FMAX, PARAM_CFM = 0, 1, 2, 5, 8
PARAM_STOP_ERP, PARAM_STOP_CFM, PARAM_GROUP_2 = 9, 10, 0x100
PARAMETERS = {"lower": PARAM_LO_STOP, "upper": PARAM_HI_STOP, "rate": PARAM_VEL, "max_force": PARAM_FMAX,
              "fudge_factor": 6, "cfm": PARAM_CFM, "stop_erp": PARAM_STOP_ERP, "stop_cfm": PARAM_STOP_CFM, "erp": 13}

_WHEEL_ALIGNMENT = math.cos(math.radians(2.0))
_WHEEL_SNAP = math.cos(math.radians(0.1))


class ModelParts:
    """Everything the engine owns for one model."""

    def __init__(self, name, static):
        self.name, self.static = name, static
        self.space = None
        self.links, self.joints, self.geoms = [], [], []
        self.self_colliding, self.sleeps, self.stiffer = False, False, 1.0
        self.too_mobile = None      # what limits.too_mobile tells of its links


class Shape:
    """What the contact callback needs to know of a geom."""

    __slots__ = ("name", "collision", "wheel", "moves", "model", "link", "body", "stiffer", "restless", "countdown")

    def __init__(self, name, collision, wheel, model, link, body, stiffer, countdown):
        self.name, self.collision, self.wheel = name, collision, wheel
        self.model, self.link, self.body = model, link, body
        self.moves, self.stiffer = body is not None, stiffer if body is not None else math.inf
        self.countdown, self.restless = countdown, body is not None and countdown is None


class LinkBody:
    """One link in the engine: its body (None where static), geoms, and the shift between link and body frame.

    ``countdown`` is there where the body may sleep.
    """

    __slots__ = ("name", "spec", "body", "com", "pose", "geoms", "countdown")

    def __init__(self, name, spec, body, com, pose, sleeps=False):
        self.name, self.spec, self.body, self.com, self.pose = name, spec, body, com, pose
        self.countdown = Countdown() if sleeps and body is not None else None
        self.geoms = []                     # (geom, Collision)


class JointDrive:
    """One joint in the engine, with its count of full turns and how it is damped and pulled: see dampers.settle."""

    __slots__ = ("name", "spec", "joint", "hinge", "angle", "damping", "stiffness", "pull", "dampers")

    def __init__(self, name, spec, joint, hinge):
        self.name, self.spec, self.joint, self.hinge, self.angle = name, spec, joint, hinge, 0.0
        self.damping = self.stiffness = self.pull = 0.0
        self.dampers = {}


def ode_quaternion(quaternion):
    """Reorder ``(x, y, z, w)`` to ODE's ``(w, x, y, z)``."""
    return (quaternion[3], quaternion[0], quaternion[1], quaternion[2])


def make_mass(inertial, name):
    """Return ODE's mass of an Inertial, in link axes about the centre of mass.

    Raises
    ------
    ModelError
        If mass or inertia are not those of a physical body, or more or less than ODE takes.
    """
    check_inertial(inertial, name)
    tensor = turned_tensor(inertial)
    mass = ode.Mass()
    mass.setParameters(inertial.mass, 0.0, 0.0, 0.0, tensor[0, 0], tensor[1, 1], tensor[2, 2],
                       tensor[0, 1], tensor[0, 2], tensor[1, 2])
    return mass


def make_body(world, link, name, pose):
    """Create the body of a movable link whose frame stands at ``pose`` in the world.

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


def place_body(body, com, pose):
    """Put a body so that its link frame stands at ``pose``."""
    position, orientation = pose
    shift = rotate(orientation, com)
    body.setPosition((position[0] + shift[0], position[1] + shift[1], position[2] + shift[2]))
    body.setQuaternion(ode_quaternion(orientation))


def make_geom(collision, space, where):
    """Create the geom of one collision; planes are made by :func:`make_plane`.

    Raises
    ------
    ModelError
        If the geometry is of no kind this engine knows, or smaller or larger than its numbers carry.
    """
    geometry = collision.geometry
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


def make_plane(collision, link_pose, space):
    """Create the geom of a plane: normal in world axes whatever the pose, through the collision's world height.

    That is what Gazebo does with planes; moving the model later does not move them either.
    """
    nx, ny, nz = collision.geometry.normal
    norm = math.sqrt(nx * nx + ny * ny + nz * nz)
    if not norm > 0.0:
        raise ModelError("collision %s: plane normal %s has no direction" % (collision.name, collision.geometry.normal))
    height = compose(link_pose, collision.pose)[0][2]
    return ode.GeomPlane(space, (nx / norm, ny / norm, nz / norm), nz / norm * height)


def attach_geom(geom, body, com, pose):
    """Fix a geom to a body, ``pose`` being its pose in the link frame."""
    position, orientation = pose
    geom.setBody(body)
    geom.setOffsetPosition((position[0] - com[0], position[1] - com[1], position[2] - com[2]))
    geom.setOffsetQuaternion(ode_quaternion(orientation))


def place_geom(geom, link_pose, pose):
    """Put the geom of a static link."""
    position, orientation = compose(link_pose, pose)
    position, orientation = compose((position, orientation), getattr(geom, "frame", IDENTITY))
    geom.setPosition(position)
    geom.setQuaternion(ode_quaternion(orientation))


def direct_friction(contact, surface, geom):
    """Give a contact the direction of mu that turns with ``geom``; returns the mode, without it where it means nothing.
    """
    w, x, y, z = geom.getQuaternion()
    along = along_surface(rotate((x, y, z, w), surface.along), contact.getContactGeomParams()[1])
    if along is None:
        return surface.mode & ~MODE_FDIR1
    contact.setFDir1(along)
    return surface.mode


def make_joint(world, spec, name, parent, child):
    """Create a joint between two :class:`LinkBody` (``parent`` may be None: the world); returns a JointDrive.

    Gazebo attaches the child as the first body, so positions and rates are those of the child relative to the parent.
    """
    first, second = child.body, parent.body if parent is not None else ode.environment
    kinds = {"revolute": ode.HingeJoint, "prismatic": ode.SliderJoint, "fixed": ode.FixedJoint, "ball": ode.BallJoint,
             "universal": ode.UniversalJoint}
    if spec.kind not in kinds:
        raise ModelError("joint %s: type %s; expected one of %s" % (name, spec.kind, ", ".join(sorted(kinds))))
    joint = kinds[spec.kind](world)
    joint.attach(first, second)
    anchor_joint(joint, spec, child)
    for index, axis in enumerate(spec.axes()):
        _set_up_axis(joint, spec.kind, axis, axis_group(spec.kind, index))
    return JointDrive(name, spec, joint, spec.kind == "revolute")


def anchor_joint(joint, spec, child):
    """Set where a joint is and what it counts from, from its links as they stand: as in the model, unturned."""
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
        if spec.kind == "revolute":
            joint.setAnchor(anchor)
        joint.setAxis(axis)


def bounded_softness(cfm: float) -> float:
    """Return a softness (CFM) [s/kg] that the direct solver can take; beyond, a stop already holds nothing."""
    return min(max(cfm, 0.0), SOFTEST)


def axis_group(kind, index):
    """Return what libode adds to the numbers of the parameters of a joint's axis."""
    return PARAM_GROUP_2 if kind == "universal" and index == 0 else 0


def _set_up_axis(joint, kind, axis, group):
    """Set stops and friction; ODE knows no stops beyond half a turn for what turns, wider ones are left out."""
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


def link_pose(link):
    """Return ``(position, orientation)`` of a link frame in the world."""
    if link.body is None:
        return link.pose
    w, x, y, z = link.body.getQuaternion()
    orientation = (x, y, z, w)
    px, py, pz = link.body.getPosition()
    shift = rotate(orientation, link.com)
    return ((px - shift[0], py - shift[1], pz - shift[2]), orientation)


def wheel_poses(model):
    """Find the cylinders that are wheels: those whose link hangs on a hinge along the cylinder's axis.

    Model files round a quarter turn to 1.5707 and the like; a wheel that wobbles by so little steers the robot by
    millimetres on a few metres.  Within :data:`_WHEEL_SNAP` of the hinge's axis a wheel is set exactly onto it.

    Returns
    -------
    dict
        ``{(link name, collision name): pose of the cylinder in the link frame}``
    """
    wheels = {}
    links = {link.name: link for link in model.links}
    for joint in model.joints:
        if joint.kind != "revolute" or joint.child not in links:
            continue
        axis = rotate(joint.pose[1], joint.axis.xyz)
        norm = math.sqrt(sum(value * value for value in axis))
        for collision in links[joint.child].collisions:
            if not isinstance(collision.geometry, Cylinder) or norm == 0.0:
                continue
            position, orientation = collision.pose
            along = rotate_inverse(orientation, tuple(value / norm for value in axis))
            if abs(along[2]) >= _WHEEL_SNAP:
                sign = math.copysign(1.0, along[2])
                # shortest turn that takes the cylinder's z axis to `along`; first order is exact enough here
                orientation = _unit(multiply(orientation, (-0.5 * sign * along[1], 0.5 * sign * along[0], 0.0, 1.0)))
            if abs(along[2]) >= _WHEEL_ALIGNMENT:
                wheels[joint.child, collision.name] = (position, orientation)
    return wheels


def initial_link_pose(model_pose, link):
    """Return the world pose of a link in the model's initial configuration."""
    position, orientation = compose(model_pose, link.pose)
    return (position, _unit(orientation))


def _unit(quaternion):
    norm = math.sqrt(sum(value * value for value in quaternion))
    return tuple(value / norm for value in quaternion)


def describe_loss(step, dt, parts, link):
    """Return a message about a body that left the world: time, state, and commands of its motors.

    Parameters
    ----------
    step, dt : int, float
        Number of the step, its length [s].
    parts : object with ``joints``
        The model of the body.
    link : LinkBody
    """
    motors = ["%s %g with up to %g" % (drive.spec.name, drive.joint.getParam(PARAM_VEL),
                                       drive.joint.getParam(PARAM_FMAX))
              for drive in parts.joints if drive.spec.kind in ("revolute", "prismatic")]
    return ("step %d (%g ms each): the simulation diverged: %s is at %s, with velocity %s m/s and angular velocity "
            "%s rad/s. Motors: %s" % (step, 1e3 * dt, link.name, link.body.getPosition(), link.body.getLinearVel(),
                                      link.body.getAngularVel(), ", ".join(motors) or "none"))

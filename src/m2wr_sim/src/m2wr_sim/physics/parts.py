# SPDX-License-Identifier: BSD-3-Clause
"""Records of what the engines keep for each model: its links, joints and geoms in ODE."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, List, Optional, Tuple

from m2wr_sim.physics.idle import Countdown

if TYPE_CHECKING:
    import ode

    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.types import Collision, Joint, Link
    from m2wr_sim.physics.dampers import Damper
    from m2wr_sim.physics.joint_axes import AxisAccess
    from m2wr_sim.physics.native_shapes import Geom


class ModelParts:
    """The objects of the engine for one model.

    Parameters
    ----------
    name : str
        Name in the world.
    static : bool
        Whether the model is static; then it has no bodies, joints and space.
    """

    def __init__(self, name: str, static: bool) -> None:
        self.name, self.static = name, static
        self.space: ode.SimpleSpace = None      # of the geoms on bodies; None if the model is static
        self.links: List[LinkBody] = []
        self.joints: List[JointDrive] = []
        self.geoms: List[Geom] = []
        self.self_colliding, self.sleeps, self.skids, self.stiffer = False, False, False, 1.0
        self.too_mobile: Optional[Tuple[str, str]] = None       # result of limits.too_mobile

    def drives(self) -> List[JointDrive]:
        """Return the axes of all joints."""
        return [drive for joint in self.joints for drive in (joint, joint.second) if drive is not None]


class Shape:
    """Data of a geom for the contact callback.

    Parameters
    ----------
    name : str
        ``model::link::collision``.
    collision : m2wr_sim.model.types.Collision
    wheel : bool
        Whether it is the cylinder of a wheel, see :mod:`m2wr_sim.physics.wheels`.
    model, link : str
        Names of its model, and ``model::link``.
    body : ode.Body or None
        None if it is static.
    stiffer : float
        See :func:`m2wr_sim.physics.contacts.load_class`.
    countdown : Countdown or None
        None if the body never sleeps.
    kinematic : bool, optional
        Whether nothing can push the body; two such shapes, or one and a static one, have no contacts.
    skids : bool, optional
        Whether the model has wheels on several axles, see :func:`m2wr_sim.physics.wheels.skids`.

    Attributes
    ----------
    slip : (float, float) or None
        Compliance [m/s/N] along and across the first direction of friction, added to that of the surfaces.
    """

    __slots__ = ("name", "collision", "wheel", "moves", "model", "link", "body", "stiffer", "restless", "countdown",
                 "yields", "skids", "slip")

    def __init__(self, name: str, collision: Collision, wheel: bool, model: str, link: str, body: Optional[ode.Body],
                 stiffer: float, countdown: Optional[Countdown], kinematic: bool = False,
                 skids: bool = False) -> None:
        self.name, self.collision, self.wheel = name, collision, wheel
        self.model, self.link = model, link
        self.body: ode.Body = body              # as in LinkBody
        self.moves, self.stiffer = body is not None, stiffer if body is not None else math.inf
        self.countdown, self.restless = countdown, body is not None and countdown is None
        self.yields = body is not None and not kinematic
        self.skids = wheel and skids and body is not None
        self.slip: Optional[Tuple[float, float]] = None


class LinkBody:
    """A link in the engine: body, geoms, and the shift between link frame and body.

    Parameters
    ----------
    name : str
        ``model::link``.
    spec : m2wr_sim.model.types.Link
    body : ode.Body or None
        None if the link is static.
    com : (3,) of float
        Centre of mass in the link frame [m].
    pose : pose
        Of the link frame in the world: the initial one, and of a static link the present one.
    sleeps : bool
        Whether the body may sleep; it has a ``countdown`` then.
    """

    __slots__ = ("name", "spec", "body", "com", "pose", "geoms", "countdown")

    def __init__(self, name: str, spec: Link, body: Optional[ode.Body], com: Vector, pose: Pose,
                 sleeps: bool = False) -> None:
        self.name, self.spec, self.com, self.pose = name, spec, com, pose
        self.body: ode.Body = body              # not Optional: most code handles only links of movable models
        self.countdown = Countdown() if sleeps and body is not None else None
        self.geoms: List[Tuple[Geom, Collision]] = []


class JointDrive:
    """One axis of a joint: its angle with full rotations, and its damping, see :mod:`m2wr_sim.physics.dampers`.

    Parameters
    ----------
    name : str
        ``model::joint``.
    spec : m2wr_sim.model.types.Joint
    joint : ode.Joint or NativePiston
    access : AxisAccess
        How libode reads and drives the axis.
    second : JointDrive, optional
        The other axis of a joint with two.
    """

    __slots__ = ("name", "spec", "joint", "access", "second", "hinge", "angle", "damping", "stiffness", "pull",
                 "dampers")

    def __init__(self, name: str, spec: Joint, joint: ode.Joint, access: AxisAccess,
                 second: Optional[JointDrive] = None) -> None:
        self.name, self.spec, self.joint, self.access, self.second = name, spec, joint, access, second
        self.hinge, self.angle = access.rotates, 0.0
        self.damping = self.stiffness = self.pull = 0.0
        self.dampers: Dict[int, Damper] = {}        # by index of the axis

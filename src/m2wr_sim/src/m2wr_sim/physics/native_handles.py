# SPDX-License-Identifier: BSD-3-Clause
"""Native handles of ODE's objects, which the Python binding does not provide for bodies and joints."""
from __future__ import annotations

import ctypes
import math
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, Iterator, List, Sequence, Tuple, TypeVar

import ode

if TYPE_CHECKING:
    from m2wr_sim.model.types import Joint
    from m2wr_sim.physics.dampers import Damper
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.parts import JointDrive, LinkBody, ModelParts, Shape

    #: Native handles of bodies.
    Handles = Dict[LinkBody, int]

_Key = TypeVar("_Key")
_MODEL_JOINTS = (1, 2, 3, 5, 7, 14)     # dJointType: ball, hinge, slider, universal, fixed, piston
_DAMPERS = (9, 10)                  # dJointType: angular and linear motor


def body_handle(library: Any, body: ode.Body) -> int:
    """Return the native handle of a body, by means of a temporary geom.

    Parameters
    ----------
    library : ctypes.CDLL
        libode, see :func:`m2wr_sim.physics.native_ode.library`.
    body : ode.Body

    Returns
    -------
    int
    """
    probe = ode.GeomSphere(None, 1.0)
    probe.setBody(body)
    handle: int = library.dGeomGetBody(probe._id())
    return handle


def joint_handles(library: Any, moving: Iterable[ModelParts], bodies: Handles) -> Dict[JointDrive, int]:
    """Return the native handles of all joints.

    Parameters
    ----------
    library : ctypes.CDLL
        libode.
    moving : iterable of ModelParts
        The movable models.
    bodies : dict
        Link -> native handle of its body.

    Returns
    -------
    dict
    """
    moving = list(moving)
    handles = _handles_of(library, moving, bodies, _MODEL_JOINTS,
                          lambda parts: [(drive, drive.spec) for drive in reversed(parts.joints)])
    handles.update((drive.second, handles[drive]) for parts in moving for drive in parts.joints
                   if drive.second is not None)
    return handles


def motor_handles(library: Any, moving: Iterable[ModelParts], bodies: Handles) -> Dict[Damper, int]:
    """Return the native handles of all dampers.

    Parameters
    ----------
    library : ctypes.CDLL
        libode.
    moving : iterable of ModelParts
        The movable models.
    bodies : dict
        Link -> native handle of its body.

    Returns
    -------
    dict
    """
    def newest_first(parts: ModelParts) -> List[Tuple[Damper, Joint]]:
        made = [(damper, drive.spec) for drive in parts.joints for damper in drive.dampers.values()]
        return sorted(made, key=lambda entry: -entry[0].number)
    return _handles_of(library, moving, bodies, _DAMPERS, newest_first)


def _handles_of(library: Any, moving: Iterable[ModelParts], bodies: Handles, kinds: Sequence[int],
                newest_first: Callable[[ModelParts], List[Tuple[_Key, Joint]]]) -> Dict[_Key, int]:
    """Return the native handles of joints or motors of some types.

    In libode the list of a body's joints begins with the one attached last; ``newest_first`` returns those of a model
    in the same order.
    """
    handles: Dict[_Key, int] = {}
    for parts in moving:
        by_name = {link.spec.name: bodies[link] for link in parts.links}
        waiting = {body: _joints_of(library, body, kinds) for body in by_name.values()}
        for entry, spec in newest_first(parts):
            for end in {spec.child, spec.parent} - {"world"}:
                handle = next(waiting[by_name[end]])
                if end == spec.child:
                    handles[entry] = handle
    return handles


def _joints_of(library: Any, body: int, kinds: Sequence[int]) -> Iterator[int]:
    """Yield the native handles of a body's joints of some types, from the one attached last."""
    for index in range(library.dBodyGetNumJoints(body)):
        joint = library.dBodyGetJoint(body, index)
        if library.dJointGetType(joint) in kinds:
            yield joint


def reach(library: Any, geoms: Iterable[Tuple[Geom, Shape]]) -> Dict[int, float]:
    """Return the radii of spheres around the bodies that contain their geoms in any orientation.

    Parameters
    ----------
    library : ctypes.CDLL
        libode.
    geoms : iterable of (geom, Shape)

    Returns
    -------
    dict
        Native handle of a body -> radius [m].
    """
    radii: Dict[int, float] = {}
    box = (ctypes.c_double * 6)()
    for geom, shape in geoms:
        body = library.dGeomGetBody(geom._id())
        if not body:
            continue
        library.dGeomGetAABB(geom._id(), box)
        at = shape.body.getPosition()
        radius = math.sqrt(sum(max(abs(box[2 * axis] - at[axis]), abs(box[2 * axis + 1] - at[axis])) ** 2
                               for axis in range(3)))
        radii[body] = max(radius, radii.get(body, 0.0))
    return radii

# SPDX-License-Identifier: BSD-3-Clause
"""How each axis of a joint is read and driven in libode, and the piston of screws, which the Python binding lacks.

A model's first axis is that of the parent.  A universal joint of libode has the child as its first body, so the order
of its two axes is the opposite one.
"""
from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, Any, Callable, Optional, Sequence, Tuple

import ode

from m2wr_sim.physics.native_handles import body_handle
from m2wr_sim.physics.native_ode import library

if TYPE_CHECKING:
    from m2wr_sim.geometry import Vector

PARAM_GROUP_2 = 0x100                   # of libode's parameter numbers, for the second axis of a joint
HINGE, UNIVERSAL_1, UNIVERSAL_2, PISTON = range(4)      # readings of angles, for compiled code


class AxisAccess:
    """How libode reads and drives one axis of a joint.

    Parameters
    ----------
    reading : int or None
        One of HINGE, UNIVERSAL_1, UNIVERSAL_2, PISTON; None if it does not rotate.
    group : int
        Offset of libode's parameter numbers.
    position, rate : callable
        Return the position [rad, in (-pi, pi], or m] and its rate.
    push : callable
        Applies an effort [N m or N] in the next step.
    """

    __slots__ = ("reading", "rotates", "group", "position", "rate", "push")

    def __init__(self, reading: Optional[int], group: int, position: Callable[[], float], rate: Callable[[], float],
                 push: Callable[[float], object]) -> None:
        self.reading, self.rotates, self.group = reading, reading is not None, group
        self.position, self.rate, self.push = position, rate, push


def _still() -> float:
    return 0.0


def axis_access(kind: str, joint: Any, index: int) -> AxisAccess:
    """Return how to read and drive an axis.

    Parameters
    ----------
    kind : str
        Type of the joint.
    joint : ode.Joint or NativePiston
    index : int
        Index of the axis.

    Returns
    -------
    AxisAccess
        For a joint without axes, its position is always 0, and an effort has no effect.
    """
    if kind == "revolute":
        return AxisAccess(HINGE, 0, joint.getAngle, joint.getAngleRate, joint.addTorque)
    if kind == "prismatic":
        return AxisAccess(None, 0, joint.getPosition, joint.getPositionRate, joint.addForce)
    if kind == "screw":
        return AxisAccess(PISTON, PARAM_GROUP_2, joint.getAngle, joint.getAngleRate, joint.addTorque)
    if kind == "universal" and index == 0:
        return AxisAccess(UNIVERSAL_2, PARAM_GROUP_2, joint.getAngle2, joint.getAngle2Rate,
                          lambda effort: joint.addTorques(0.0, effort))
    if kind == "universal":
        return AxisAccess(UNIVERSAL_1, 0, joint.getAngle1, joint.getAngle1Rate,
                          lambda effort: joint.addTorques(effort, 0.0))
    return AxisAccess(None, 0, _still, _still, lambda effort: None)


class NativePiston:
    """libode's piston, which rotates about an axis and slides along it, with the methods of the binding's joints.

    Parameters
    ----------
    world : ode.World
        Kept, because it must outlive the joint.
    """

    def __init__(self, world: ode.World) -> None:
        self._world, self._library = world, _signatures()
        self._bodies: Tuple[Optional[ode.Body], Optional[ode.Body]] = (None, None)
        self._feedback: Any = None
        probe = ode.Body(world)
        self._joint = self._library.dJointCreatePiston(self._library.dBodyGetWorld(body_handle(self._library, probe)),
                                                       None)

    def __del__(self) -> None:
        if getattr(self, "_joint", None):
            self._library.dJointDestroy(self._joint)

    def attach(self, first: Any, second: Any) -> None:
        """Attach the joint to two bodies.

        Parameters
        ----------
        first, second : ode.Body, ode.environment or None
            ``ode.environment`` is the world, None detaches.
        """
        self._bodies = tuple(None if body is ode.environment else body for body in (first, second))     # type: ignore
        self._library.dJointAttach(self._joint, *(None if body is None else body_handle(self._library, body)
                                                  for body in self._bodies))

    def getBody(self, index: int) -> Optional[ode.Body]:        # noqa: N802 - as the binding's joints
        """Return one of the two bodies."""
        return self._bodies[index]

    def setAnchor(self, anchor: Sequence[float]) -> None:       # noqa: N802
        """Set the anchor in the world [m]."""
        self._library.dJointSetPistonAnchor(self._joint, *anchor)

    def setAxis(self, axis: Sequence[float]) -> None:           # noqa: N802
        """Set the axis in the world."""
        self._library.dJointSetPistonAxis(self._joint, *axis)

    def getAxis(self) -> Vector:                                # noqa: N802
        """Return the axis in the world."""
        axis = (ctypes.c_double * 4)()
        self._library.dJointGetPistonAxis(self._joint, axis)
        return axis[0], axis[1], axis[2]

    def getAngle(self) -> float:                                # noqa: N802
        """Return the angle [rad]."""
        return float(self._library.dJointGetPistonAngle(self._joint))

    def getAngleRate(self) -> float:                            # noqa: N802
        """Return the rate of the angle [rad/s]."""
        return float(self._library.dJointGetPistonAngleRate(self._joint))

    def getPosition(self) -> float:                             # noqa: N802
        """Return the way along the axis [m]."""
        return float(self._library.dJointGetPistonPosition(self._joint))

    def setParam(self, number: int, value: float) -> None:      # noqa: N802
        """Set a parameter of libode.

        Parameters
        ----------
        number : int
        value : float
        """
        self._library.dJointSetPistonParam(self._joint, number, value)

    def getParam(self, number: int) -> float:                   # noqa: N802
        """Return a parameter of libode."""
        return float(self._library.dJointGetPistonParam(self._joint, number))

    def addTorque(self, torque: float) -> None:                 # noqa: N802
        """Apply a torque about the axis [N m] in the next step."""
        axis = self.getAxis()
        for body, sign in zip(self._bodies, (torque, -torque)):
            if body is not None:
                body.addTorque((sign * axis[0], sign * axis[1], sign * axis[2]))

    def setFeedback(self, on: bool = True) -> None:             # noqa: N802
        """Have the forces of the joint stored in each step, or not."""
        self._feedback = (ctypes.c_double * 16)() if on else None
        self._library.dJointSetFeedback(self._joint, self._feedback)

    def getFeedback(self) -> Optional[Tuple[Vector, Vector, Vector, Vector]]:       # noqa: N802
        """Return force and torque on the first body and on the second [N, N m]; None if they are not stored."""
        if self._feedback is None:
            return None
        force, torque, other_force, other_torque = (tuple(self._feedback[at:at + 3]) for at in (0, 4, 8, 12))
        return force, torque, other_force, other_torque         # type: ignore[return-value]


def _signatures() -> Any:
    """Return libode with the signatures of a piston's functions."""
    known = library()
    if known is None:
        raise ImportError("libode cannot be loaded by name; screw joints need it")
    handle, number = ctypes.c_void_p, ctypes.c_double
    for name, result, arguments in (
            ("dJointCreatePiston", handle, [handle, handle]), ("dJointDestroy", None, [handle]),
            ("dJointAttach", None, [handle, handle, handle]), ("dJointSetFeedback", None, [handle, handle]),
            ("dJointSetPistonAnchor", None, [handle] + 3 * [number]),
            ("dJointSetPistonAxis", None, [handle] + 3 * [number]),
            ("dJointGetPistonAxis", None, [handle, handle]), ("dJointGetPistonAngle", number, [handle]),
            ("dJointGetPistonAngleRate", number, [handle]), ("dJointGetPistonPosition", number, [handle]),
            ("dJointSetPistonParam", None, [handle, ctypes.c_int, number]),
            ("dJointGetPistonParam", number, [handle, ctypes.c_int])):
        function = getattr(known, name)
        function.restype, function.argtypes = result, arguments
    return known

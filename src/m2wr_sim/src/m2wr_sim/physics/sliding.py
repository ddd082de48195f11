# SPDX-License-Identifier: BSD-3-Clause
"""Friction of wheels that slide: Coulomb's law with an ellipse, which the pyramid of libode circumscribes.

libode bounds the friction of a contact in its two directions separately: ``|F1| <= mu1 N`` and ``|F2| <= mu2 N``.  A
wheel that slides sideways could then still push along with its full grip, and in other directions friction would be
greater by sqrt(2).  A robot with skid steering, whose wheels slide in every turn, would turn as its wheels roll, or not
at all, and would move away from where it turns.

Coulomb's law, for a slip velocity (v1, v2) and the ellipse of the forces (Goyal, Ruina and Papadopoulos, "Planar
sliding with dry friction", Wear 143, 1991), is

    F_i = -N mu_i^2 v_i / S,    S = sqrt(mu1^2 v1^2 + mu2^2 v2^2).

With S of the step before this is a viscous force, which libode solves implicitly: a force-dependent slip of
S / (N mu_i^2) in direction i, see "slip1" and "slip2" in its manual.  Without slip these are zero, and the pyramid
holds the wheel.  The friction of a wheel with a constant slip is exact; one that brakes has less by mu g h / v, in a
step h.

A wheel that also slips by a compliance of its surface, v = c F, has the greater of the two slips: c while c F is less
than the velocity at which the force reaches its limit, and the other beyond.

Only a wheel has such contacts, one in a step: the normal force N is that of its contact in the last step.  A model
whose wheels share one axle, such as m2wr, turns without sliding and keeps the pyramid, see ``skids`` in wheels.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, Optional, Sequence, Tuple

from m2wr_sim.geometry import cross

if TYPE_CHECKING:
    import ode

    from m2wr_sim.geometry import Vector

    #: Name of a wheel's collision -> number of the last step in which it had a contact, name of the other collision,
    #: normal force [N].
    Loads = Dict[str, Tuple[int, str, float]]

SLOWEST = 1e-6          # m/s; S below that has no effect, and is an error of rounding


def first_direction(normal: Sequence[float]) -> Vector:
    """Return the first direction of friction that libode chooses if none is given (its ``dPlaneSpace``).

    Parameters
    ----------
    normal : (3,) sequence of float
        Unit vector.

    Returns
    -------
    tuple of 3 floats
        Unit vector.
    """
    if abs(normal[2]) > math.sqrt(0.5):
        scale = 1.0 / math.sqrt(normal[1] * normal[1] + normal[2] * normal[2])
        return (0.0, -normal[2] * scale, normal[1] * scale)
    scale = 1.0 / math.sqrt(normal[0] * normal[0] + normal[1] * normal[1])
    return (-normal[1] * scale, normal[0] * scale, 0.0)


def slip_velocity(position: Sequence[float], one: Optional[ode.Body], two: Optional[ode.Body]) -> Vector:
    """Return the velocity of a point of the first body relative to that of the second one.

    Parameters
    ----------
    position : (3,) sequence of float
        In the world [m].
    one, two : ode.Body or None
        None is the world.

    Returns
    -------
    tuple of 3 floats
        [m/s].
    """
    x = y = z = 0.0
    for body, sign in ((one, 1.0), (two, -1.0)):
        if body is None:
            continue
        centre, linear = body.getPosition(), body.getLinearVel()
        turn = cross(body.getAngularVel(), (position[0] - centre[0], position[1] - centre[1], position[2] - centre[2]))
        x += sign * (linear[0] + turn[0])
        y += sign * (linear[1] + turn[1])
        z += sign * (linear[2] + turn[2])
    return (x, y, z)


def sliding_slips(velocity: Sequence[float], normal: Sequence[float], first: Sequence[float], mu: float, mu2: float,
                  load: float) -> Tuple[float, float]:
    """Return the force-dependent slips that make libode's friction that of the ellipse.

    Parameters
    ----------
    velocity : (3,) sequence of float
        Of the slip [m/s].
    normal, first : (3,) sequence of float
        Unit vectors: normal of the contact, direction of ``mu``.
    mu, mu2 : float
        Coefficients in that direction, and in the one across it.
    load : float
        Normal force [N].

    Returns
    -------
    (float, float)
        [m/s/N]; zeros if the wheel does not slide.
    """
    along = velocity[0] * first[0] + velocity[1] * first[1] + velocity[2] * first[2]
    second = cross(normal, first)
    across = velocity[0] * second[0] + velocity[1] * second[1] + velocity[2] * second[2]
    dissipation = math.sqrt(mu * mu * along * along + mu2 * mu2 * across * across)
    if not dissipation > SLOWEST or not load > 0.0:
        return 0.0, 0.0
    return dissipation / (load * mu * mu), dissipation / (load * mu2 * mu2)

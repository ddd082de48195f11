# SPDX-License-Identifier: BSD-3-Clause
"""Single rows of the solver between two links, which libode has no joint for: gears and screws.

A row demands that a point of the first link moves along one direction at a given speed, as seen from the second link.
It is the frictional row of a contact whose friction has practically no limit.  The normal row of this contact is so
soft that it has no effect.
"""
from __future__ import annotations

from typing import Optional, Sequence

import ode

from m2wr_sim.physics.contacts import MODE_FDIR1, MODE_MU2, MODE_SLIP1, MODE_SOFT_CFM
from m2wr_sim.physics.limits import SOFTEST

_STRONGEST = 1e12       # N; with no limit at all libode orders the two rows of a contact wrongly
_MODE_MOTION1 = 0x20    # dContactMotion1
_COMPLIANCE = 1e-9      # m/(N s), of the row


class Row:
    """One row of the solver; it acts until it is replaced or removed.

    Parameters
    ----------
    world : ode.World
    """

    def __init__(self, world: ode.World) -> None:
        self._world, self._group = world, ode.JointGroup()

    def set(self, first: Optional[ode.Body], second: Optional[ode.Body], point: Sequence[float],
            direction: Sequence[float], across: Sequence[float], speed: float) -> None:
        """Set what the next steps demand.

        Parameters
        ----------
        first, second : ode.Body or None
            None for the world.
        point : (3,) of float
            In the world [m].
        direction : (3,) of float
            Unit vector in the world.
        across : (3,) of float
            A unit vector at right angles to it.
        speed : float
            Of the point on the first body against the point on the second one, along the direction [m/s].
        """
        self._group.empty()
        contact = ode.Contact()
        contact.setMode(MODE_FDIR1 | MODE_MU2 | MODE_SLIP1 | MODE_SOFT_CFM | _MODE_MOTION1)
        contact.setMu(_STRONGEST)
        contact.setMu2(0.0)
        contact.setSlip1(_COMPLIANCE)
        contact.setSoftCFM(SOFTEST)
        contact.setContactGeomParams(tuple(point), tuple(across), 0.0)
        contact.setFDir1(tuple(direction))
        contact.setMotion1(speed)
        joint = ode.ContactJoint(self._world, self._group, contact)
        joint.attach(ode.environment if first is None else first, ode.environment if second is None else second)

    def remove(self) -> None:
        """Remove the row from the solver."""
        self._group.empty()

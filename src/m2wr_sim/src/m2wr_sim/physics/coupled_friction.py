# SPDX-License-Identifier: BSD-3-Clause
"""Coupled friction: friction limits that agree with the normal forces, with the direct solver.

The direct solver limits friction to mu times the normal forces of a world without friction.  For a robot that stands on
the ground these forces are its weight.  If its motors press it against a wall they are zero, which violates Coulomb's
law.  Such a step starts with limits from the normal forces of the last step.  It is undone and solved again, with
limits from the computed forces, until limits and forces agree.

Only islands with such a contact are solved again, each until it agrees; all others are disabled meanwhile.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Callable, Dict, List, Optional, Set, Tuple

import ode

from m2wr_sim.physics.contacts import AGREED, MODE_APPROX1, next_limit

if TYPE_CHECKING:
    from m2wr_sim.geometry import Vector
    from m2wr_sim.physics.contacts import PairSurface

    #: Names of the two collisions, sorted, and the number of the contact.
    Key = Tuple[str, str, int]

UNKNOWN = -1.0          # N; stands for a normal force that is not computed yet


class Memory:
    """Normal forces [N] at the end of the last coupled step, by contact, and the number of that step."""

    __slots__ = ("step", "forces")

    def __init__(self, step: int = 0, forces: Optional[Dict[Key, float]] = None) -> None:
        self.step = step
        self.forces: Dict[Key, float] = forces or {}


class Grip:
    """One contact of a step: its parameters, and the normal force [N] that limits its friction.

    Parameters
    ----------
    joint : ode.ContactJoint
    contact : ode.Contact
    one, two : ode.Body or None
        Bodies of the two geoms.
    surface : PairSurface
    mode : int
        Mode flags of the contact.
    normal : (3,) of float
        Unit vector in the world.
    model : str
        Name of one of its moving models.
    coupled : bool
        Whether its normal force depends on friction.
    key : (str, str, int)
        Identifies the contact in later steps: names of the two collisions, number of the contact.
    """

    __slots__ = ("joint", "contact", "one", "two", "surface", "mode", "normal", "force", "model", "coupled", "key",
                 "island")

    def __init__(self, joint: ode.ContactJoint, contact: ode.Contact, one: Optional[ode.Body], two: Optional[ode.Body],
                 surface: PairSurface, mode: int, normal: Vector, model: str, coupled: bool, key: Key) -> None:
        self.joint, self.contact, self.one, self.two = joint, contact, one, two
        self.surface, self.mode, self.normal, self.force = surface, mode, normal, UNKNOWN
        self.model, self.coupled, self.key, self.island = model, coupled, key, model

    def normal_force(self) -> float:
        """Return the normal force [N] from the last solution; 0 between sleeping bodies, which are not solved."""
        if not any(body is not None and body.isEnabled() for body in (self.one, self.two)):
            return 0.0
        force, normal = self.joint.getFeedback()[0], self.normal
        return abs(force[0] * normal[0] + force[1] * normal[1] + force[2] * normal[2])

    def replace(self, world: ode.World, group: ode.JointGroup) -> None:
        """Replace the contact joint by one with friction limited by :attr:`force`.

        The old joint stays in the group, detached.

        Parameters
        ----------
        world : ode.World
        group : ode.JointGroup
            Group of the contact joints.
        """
        force, surface = self.force, self.surface
        self.joint.setFeedback(False)           # else the binding does it after the joint is freed, and aborts
        self.joint.attach(None, None)
        self.contact.setMode(self.mode & ~MODE_APPROX1)
        self.contact.setMu(surface.mu * force if force > 0.0 else 0.0)
        self.contact.setMu2(surface.mu2 * force if force > 0.0 else 0.0)
        self.joint = ode.ContactJoint(world, group, self.contact)
        self.joint.attach(self.one, self.two)
        self.joint.setFeedback(True)


class _State:
    """State of a body before a solution, to restore it."""

    def __init__(self, body: ode.Body) -> None:
        self._body = body
        self._kept = ((body.setPosition, body.getPosition()), (body.setQuaternion, body.getQuaternion()),
                      (body.setLinearVel, body.getLinearVel()), (body.setAngularVel, body.getAngularVel()),
                      (body.setForce, body.getForce()), (body.setTorque, body.getTorque()))

    def restore(self) -> None:
        """Restore the state."""
        for put, value in self._kept:
            put(value)


def solve_coupled(world: ode.World, group: ode.JointGroup, grips: List[Grip], models: Dict[str, List[ode.Body]],
                  stands_for: Callable[[str], str], dt: float, solves: int,
                  forces: Dict[Key, float]) -> Dict[Key, float]:
    """Make one step; islands with a coupled contact are solved repeatedly until limits and forces agree.

    Parameters
    ----------
    world : ode.World
    group : ode.JointGroup
        Group of the contact joints.
    grips : list of Grip
        All contacts of the step.
    models : dict
        Name of each moving model -> list of its bodies.
    stands_for : callable
        Returns, for a model's name, the name of the model that represents its island.
    dt : float
        Step size [s].
    solves : int
        Greatest number of solutions.
    forces : dict
        Key of a contact -> normal force [N] of the last step.

    Returns
    -------
    dict
        The same for the next step.
    """
    for grip in grips:
        grip.island = stands_for(grip.model)
    again = {grip.island for grip in grips if grip.coupled}
    grips = [grip for grip in grips if grip.island in again]
    reported = [grip.joint.getFeedback() is not None for grip in grips]
    for grip in grips:
        grip.joint.setFeedback(True)
        if grip.key in forces:
            grip.force = forces[grip.key]
            grip.replace(world, group)
    states = {name: [_State(body) for body in bodies] for name, bodies in models.items() if stands_for(name) in again}
    frozen: List[ode.Body] = []
    for solve in range(solves):
        world.step(dt)
        again = _disagreeing([grip for grip in grips if grip.island in again])
        if not again or solve + 1 == solves:
            break
        for name, bodies in models.items():
            if stands_for(name) in again:
                for state in states[name]:
                    state.restore()
            else:
                frozen += _disable(bodies)
        for grip in grips:
            if grip.island in again:
                grip.replace(world, group)
    for body in frozen:
        body.enable()
    for grip, wanted in zip(grips, reported):
        if not wanted:
            grip.joint.setFeedback(False)
    return {grip.key: grip.force for grip in grips}


def _disable(bodies: List[ode.Body]) -> List[ode.Body]:
    """Disable bodies, which libode then does not solve; return those that were enabled."""
    awake = [body for body in bodies if body.isEnabled()]
    for body in awake:
        body.disable()
    return awake


def _disagreeing(grips: List[Grip]) -> Set[str]:
    """Compute the limits from the normal forces; return the islands whose limits have changed."""
    change: Dict[str, float] = {}
    greatest: Dict[str, float] = {}
    for grip in grips:
        felt, used, island = grip.normal_force(), grip.force, grip.island
        grip.force = next_limit(used, felt)
        change[island] = max(change.get(island, 0.0), abs(felt - max(used, 0.0)))
        greatest[island] = max(greatest.get(island, 0.0), felt)
    return {island for island in change if change[island] > AGREED * greatest[island]}

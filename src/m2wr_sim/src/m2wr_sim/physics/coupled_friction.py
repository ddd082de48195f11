# SPDX-License-Identifier: BSD-3-Clause
"""Friction where a step holds more than standing, with the direct solver: limits that agree with the normal forces.

That solver limits friction to mu times the normal forces of a world without friction.  Standing on the ground those are
the weight; where a motor's grip on the ground presses a wheel against a wall they are nothing, and Coulomb's law does
not hold there.  So such a step begins with mu times the normal forces of the step before as limits, and is taken back
and solved again, with those of the solve before, until limits and forces agree.

That is done for islands (models that touch one another, directly or not) with such a contact, for each until it agrees;
all others sleep meanwhile.
"""
import ode

from m2wr_sim.physics.contacts import AGREED, MODE_APPROX1, next_limit

UNKNOWN = -1.0          # N: a normal force that nobody has found yet


class Memory:
    """Normal forces [N] that the last coupled step ended with, by contact, and the number of that step."""

    __slots__ = ("step", "forces")

    def __init__(self, step=0, forces=None):
        self.step, self.forces = step, forces or {}


class Grip:
    """One contact of a step: how it was made, and the normal force [N] that its limits of friction are taken from.

    ``model`` is one of those in it that move; ``key`` says which contact it is, from step to step: the names of the two
    collisions, and which of their contacts.
    """

    __slots__ = ("joint", "contact", "one", "two", "surface", "mode", "normal", "force", "model", "coupled", "key",
                 "island")

    def __init__(self, joint, contact, one, two, surface, mode, normal, model, coupled, key):
        self.joint, self.contact, self.one, self.two = joint, contact, one, two
        self.surface, self.mode, self.normal, self.force = surface, mode, normal, UNKNOWN
        self.model, self.coupled, self.key, self.island = model, coupled, key, None

    def felt(self):
        """Return the normal force [N] that the last solve found; none between sleeping bodies, which are not solved."""
        if not any(body is not None and body.isEnabled() for body in (self.one, self.two)):
            return 0.0
        force, normal = self.joint.getFeedback()[0], self.normal
        return abs(force[0] * normal[0] + force[1] * normal[1] + force[2] * normal[2])

    def renew(self, world, group):
        """Make the contact anew, friction limited by :attr:`force`; the old joint stays in the group, holding nothing.
        """
        force, surface = self.force, self.surface
        self.joint.setFeedback(False)           # the binding would do it later, to a joint that is gone, and abort
        self.joint.attach(None, None)
        self.contact.setMode(self.mode & ~MODE_APPROX1)
        self.contact.setMu(surface.mu * force if force > 0.0 else 0.0)
        self.contact.setMu2(surface.mu2 * force if force > 0.0 else 0.0)
        self.joint = ode.ContactJoint(world, group, self.contact)
        self.joint.attach(self.one, self.two)
        self.joint.setFeedback(True)


class _State:
    """What a solve changes of a body."""

    def __init__(self, body):
        self._body = body
        self._kept = ((body.setPosition, body.getPosition()), (body.setQuaternion, body.getQuaternion()),
                      (body.setLinearVel, body.getLinearVel()), (body.setAngularVel, body.getAngularVel()),
                      (body.setForce, body.getForce()), (body.setTorque, body.getTorque()))

    def bring_back(self):
        for put, value in self._kept:
            put(value)


def solve_coupled(world, group, grips, models, stands_for, dt, solves, forces):
    """Take one step of ``dt`` [s], the islands with a coupled contact at most ``solves`` times, until they agree.

    Parameters
    ----------
    world : ode.World
    group : ode.JointGroup
        Of the contacts.
    grips : list of Grip
        All contacts of the step.
    models : dict
        Name of each model that moves to the list of its bodies.
    stands_for : callable
        Returns, for a model's name, one that is the same for all models that touch one another.
    dt : float
    solves : int
    forces : dict
        Key of each contact to the normal force [N] to begin with, where one is known.

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
            grip.renew(world, group)
    states = {name: [_State(body) for body in bodies] for name, bodies in models.items() if stands_for(name) in again}
    frozen = []
    for solve in range(solves):
        world.step(dt)
        again = _disagreeing([grip for grip in grips if grip.island in again])
        if not again or solve + 1 == solves:
            break
        for name, bodies in models.items():
            if stands_for(name) in again:
                for state in states[name]:
                    state.bring_back()
            else:
                for body in bodies:
                    if body.isEnabled():
                        body.disable()          # libode leaves out what sleeps
                        frozen.append(body)
        for grip in grips:
            if grip.island in again:
                grip.renew(world, group)
    for body in frozen:
        body.enable()
    for grip, wanted in zip(grips, reported):
        if not wanted:
            grip.joint.setFeedback(False)
    return {grip.key: grip.force for grip in grips}


def _disagreeing(grips):
    """Take the limits from the forces felt; returns the islands where they were others."""
    change, greatest = {}, {}
    for grip in grips:
        felt, used, island = grip.felt(), grip.force, grip.island
        grip.force = next_limit(used, felt)
        change[island] = max(change.get(island, 0.0), abs(felt - max(used, 0.0)))
        greatest[island] = max(greatest.get(island, 0.0), felt)
    return {island for island in change if change[island] > AGREED * greatest[island]}

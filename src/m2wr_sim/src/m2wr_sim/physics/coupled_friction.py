"""Friction where a step holds more than standing, with the direct solver: limits that agree with the normal forces.

That solver limits friction to mu times the normal forces of a world without friction.  Standing on the ground those are
the weight; where a motor's grip on the ground presses a wheel against a wall they are nothing, and Coulomb's law does
not hold there.  So the step is taken back and solved again, with mu times the forces of the solve before as limits.
"""
import ode

from m2wr_sim.physics.contacts import AGREED, MODE_APPROX1, next_limit


class Grip:
    """One contact of a step: how it was made, and the normal force [N] that its limits of friction are taken from."""

    __slots__ = ("joint", "contact", "one", "two", "surface", "mode", "normal", "force")

    def __init__(self, joint, contact, one, two, surface, mode, normal):
        self.joint, self.contact, self.one, self.two = joint, contact, one, two
        self.surface, self.mode, self.normal, self.force = surface, mode, normal, 0.0

    def felt(self):
        """Return the normal force [N] that the last solve found; none between sleeping bodies, which are not solved."""
        if not any(body is not None and body.isEnabled() for body in (self.one, self.two)):
            return 0.0
        force, normal = self.joint.getFeedback()[0], self.normal
        return abs(force[0] * normal[0] + force[1] * normal[1] + force[2] * normal[2])

    def renew(self, world, group):
        """Make the contact anew, friction limited by :attr:`force`."""
        force, surface = self.force, self.surface
        self.contact.setMode(self.mode & ~MODE_APPROX1)
        self.contact.setMu(surface.mu * force if force > 0.0 else 0.0)
        self.contact.setMu2(surface.mu2 * force if force > 0.0 else 0.0)
        self.joint = ode.ContactJoint(world, group, self.contact)
        self.joint.attach(self.one, self.two)
        self.joint.setFeedback(True)


def solve_coupled(world, group, grips, bodies, dt, solves):
    """Take one step of ``dt`` [s]: at most ``solves`` times, until the limits of friction agree to 0.1 %.

    ``bodies`` are all that may move; the group holds nothing but the joints of ``grips``.
    """
    reported = [grip.joint.getFeedback() is not None for grip in grips]
    for grip in grips:
        grip.joint.setFeedback(True)
    states = [(body.getPosition(), body.getQuaternion(), body.getLinearVel(), body.getAngularVel(), body.getForce(),
               body.getTorque()) for body in bodies]
    for solve in range(solves):
        world.step(dt)
        if solve + 1 == solves or _agree(grips, solve):
            break
        for body, (position, quaternion, linear, angular, force, torque) in zip(bodies, states):
            body.setPosition(position)
            body.setQuaternion(quaternion)
            body.setLinearVel(linear)
            body.setAngularVel(angular)
            body.setForce(force)
            body.setTorque(torque)
        for grip in grips:
            grip.joint.setFeedback(False)       # the binding would do it later, to a joint that is gone, and abort
        group.empty()
        for grip in grips:
            grip.renew(world, group)
    for grip, wanted in zip(grips, reported):
        if not wanted:
            grip.joint.setFeedback(False)


def _agree(grips, solve):
    """Take the limits from the forces felt; returns whether they were those already."""
    change = greatest = 0.0
    for grip in grips:
        felt = grip.felt()
        change, greatest = max(change, abs(felt - grip.force)), max(greatest, felt)
        grip.force = next_limit(grip.force, felt, solve)
    return solve > 0 and change <= AGREED * greatest

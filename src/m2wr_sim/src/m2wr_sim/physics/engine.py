# SPDX-License-Identifier: BSD-3-Clause
"""What a physics engine offers to the rest of the simulator; engines differ in speed, never in meaning.

Links and joints are addressed by the integers that :meth:`Engine.add_model` hands out, so that nothing in the loop
looks up names.  Positions, orientations ``(x, y, z, w)`` and velocities are in the world frame, SI units.
"""
import abc
import logging
from collections import namedtuple
from dataclasses import dataclass, replace
from typing import Dict, Tuple

from m2wr_sim.errors import WorldError
from m2wr_sim.geometry import compose
from m2wr_sim.physics.islands import ITERATIVE_ABOVE

log = logging.getLogger(__name__)

# Beyond these ODE loses its numbers and ends the process without a word of ours; see physics/limits.py.
LEAST_MASS, LEAST_INERTIA, FARTHEST, FASTEST = 1e-6, 1e-12, 1e6, 1e4      # kg, kg m^2, m, m/s and rad/s

LEAST_SIZE = 1e-7       # m, of a shape: doubles near TOO_FAR are 1.5e-8 m apart, and corners must stay apart there

TOO_FAST = 1e9          # m/s and rad/s, in all directions together: only a world that has come apart gets there
TOO_FAR = 1e8           # m, in all directions together: at 2^31 cells of 1/8 m ODE's hash space ends the process

MOST_ITERATIONS, MOST_CONTACTS = 10000, 1000     # of the iterative solver, and per pair: more only takes time

SHORTEST_STEP, LONGEST_STEP, TRUSTED_STEP = 1e-5, 0.1, 0.02     # s; up to the last one robots drive true

JOINT_PARAMETERS = ("lower", "upper", "rate", "max_force", "fudge_factor", "cfm", "stop_erp", "stop_cfm", "erp")

ModelHandle = namedtuple("ModelHandle", "name links joints")
"""``links`` and ``joints`` map names to the integers the engine knows them by."""

LinkState = namedtuple("LinkState", "position orientation linear_velocity angular_velocity")
"""State of a link's own frame (not of its centre of mass), in the world frame."""

Touch = namedtuple("Touch", "step first second position depth")
"""The first step of a contact other than standing on the ground: two ``model::link::collision`` names, where, depth."""


@dataclass(frozen=True)
class EngineSettings:
    """How a world is stepped.

    The defaults drive wheeled robots to 0.1 % at 1 to 10 ms: the direct solver with a little compliance (``cfm``,
    which keeps the redundant constraints of several ground contacts solvable), a thin ``surface_layer`` that keeps
    resting contacts closed, and a bounded correcting velocity so that depth jumps never kick a robot.

    libode's direct solver limits friction by the normal forces of a world without friction.  Where a robot stands those
    are its weight; where its wheels press it against a wall they are nothing, and so would the wall's friction be.
    An island with such a contact (between two models, or on a face steeper than 37 degrees) therefore begins a step
    with the limits that the normal forces of the step before give, and is solved again, with limits half way to what
    the solve before has found, until they agree to 0.1 %, at most ``friction_solves`` times.  A robot that rubs along
    walls (m2wr in world02 with the printed rule, 16 800 such steps) takes one solve in 86 % of them, 2 to 5 in 9 %, and
    in 5 % forces and limits are still apart then; eight solves leave 3 %.  Begun without the step before, and with the
    forces taken in full at first, 95 % were apart after five.  What is left apart goes on in the step after.
    """

    step_ns: int = 1000000
    solver: str = "step"                    # "step": direct, "quick": iterative
    iterations: int = 50                    # quick only
    gravity: Tuple[float, float, float] = (0.0, 0.0, -9.8)
    erp: float = 0.2
    cfm: float = 1e-5
    surface_layer: float = 1e-4             # m
    max_correcting_velocity: float = 0.1    # m/s
    friction_solves: int = 5                # direct only: at most so many for what does more than stand
    max_contacts: int = 20                  # world limit per pair; pairs with a box keep at most four


class Engine(abc.ABC):
    """A world of rigid bodies.

    A step with an island of more than ``iterative_above`` contacts between movable models is solved iteratively,
    whatever the solver, and such a step alone: the direct solver would take seconds for robots spawned into one
    another.  After each of those ``between``, if it is set, is called without arguments; what it raises ends
    :meth:`step` early.

    The poses of links live here and nowhere else.  ``placements`` counts the calls of :meth:`set_link_pose`;
    ``version`` grows with each of them and with each stretch of steps, so that poses asked for earlier hold while it
    stays the same.
    """

    settings: EngineSettings
    solver_messages = 0
    placements = 0
    version = 0
    iterative_above = ITERATIVE_ABOVE
    between = None

    @abc.abstractmethod
    def add_model(self, model, pose, name=None):
        """Build ``model`` (:class:`~m2wr_sim.model.types.Model`) at ``pose``; returns its :class:`ModelHandle`."""

    @abc.abstractmethod
    def remove_model(self, handle):
        """Take a model out of the world and free everything it owned."""

    @abc.abstractmethod
    def abandon_model(self, handle):
        """Free a model's bodies, geoms and joints at once, but go on answering for its links and joints.

        Its links rest where they were built, its joints at 0, and nothing acts on either any more.  For a model that is
        lost in the middle of a stretch of steps; :meth:`remove_model` has to follow.
        """

    @abc.abstractmethod
    def step(self, count):
        """Advance the world by ``count`` steps of ``settings.step_ns``.

        Raises
        ------
        LostError
            If a body is nowhere, farther than ``TOO_FAR`` or faster than ``TOO_FAST``: before ODE, which ends the
            process for it, sees it again.  Stepping may go on once the models it names have been abandoned.
        """

    @abc.abstractmethod
    def link_pose(self, link):
        """Return ``(position, orientation)`` of a link frame."""

    @abc.abstractmethod
    def link_state(self, link):
        """Return the :class:`LinkState` of a link frame."""

    @abc.abstractmethod
    def set_link_pose(self, link, pose):
        """Put a link frame somewhere; velocities stay, joints are not consulted.

        There is no other way to put a link somewhere, and poses are kept nowhere else: who derives something from them
        compares ``placements`` and ``version``, and asks :meth:`placed_since`.
        """

    @abc.abstractmethod
    def placed_since(self, version):
        """Return the static links that were put somewhere after the engine had that ``version``; the latest first."""

    @abc.abstractmethod
    def set_link_velocity(self, link, linear, angular):
        """Set the velocity of a link's centre of mass and its angular velocity; nothing happens to a static link.

        Raises ModelError where a number is not finite: ODE would end the process.
        """

    @abc.abstractmethod
    def joint_angle(self, joint):
        """Return a joint's position [rad or m]; hinges count full turns."""

    @abc.abstractmethod
    def joint_rate(self, joint):
        """Return a joint's velocity [rad/s or m/s]."""

    @abc.abstractmethod
    def set_joint_motor(self, joint, rate, max_force):
        """Drive a joint towards ``rate`` with at most ``max_force`` [N m or N]; 0 releases it."""

    @abc.abstractmethod
    def set_joint_motor_force(self, joint, max_force):
        """Change only the force limit of a joint's motor."""

    @abc.abstractmethod
    def add_link_force(self, link, force, torque):
        """Push a link at its centre of mass during the next step [N, N m, world axes]; nothing for a static link."""

    @abc.abstractmethod
    def add_joint_force(self, joint, force):
        """Push along a joint's axis during the next step [N m or N]; nothing for a joint without an axis."""

    @abc.abstractmethod
    def set_link_gravity(self, link, acts):
        """Choose whether gravity acts on a link."""

    @abc.abstractmethod
    def set_link_inertial(self, link, inertial):
        """Give a link another mass, inertia and centre of mass; it stays where it is and moves on as it did.

        Raises
        ------
        ModelError
            If they are not those of a physical body.
        """

    @abc.abstractmethod
    def change_joint(self, joint, axis, parameters, index=0):
        """Give one axis of a joint other numbers.

        Parameters
        ----------
        joint : int
            Of a kind that has axes: see :meth:`~m2wr_sim.model.types.Joint.axes`.
        axis : Axis
            Taken from it: damping.
        parameters : dict
            Of :data:`JOINT_PARAMETERS`, name to value, for what the solver keeps itself.
        index : int
            Which of the joint's axes.
        """

    @abc.abstractmethod
    def set_joint_angle(self, joint, angle):
        """Tell what a joint's position counts as, after its links have been placed accordingly."""

    @abc.abstractmethod
    def collisions(self, handle):
        """Return ``[(link, Collision, movable), ...]`` of a model, in load order."""

    def pose_reader(self, parts, poses):
        """Return a function that writes the present world poses of shapes fixed to links.

        Parameters
        ----------
        parts : list of (int, pose)
            Link, and the pose of the shape in the link frame.
        poses : (n, 7) float64
            Written by the function, C-contiguous: position x y z [m], orientation x y z w.

        Returns
        -------
        callable
            ``read()``.  It is of no use once one of the links has been removed.
        """
        def read():
            known = {}
            for index, (link, offset) in enumerate(parts):
                if link not in known:
                    known[link] = self.link_pose(link)
                poses[index, :3], poses[index, 3:] = compose(known[link], offset)

        return read

    @abc.abstractmethod
    def drain_touches(self):
        """Return the list of :class:`Touch` since the last call and forget it."""

    @abc.abstractmethod
    def watch_contacts(self, names):
        """Report the contacts of some collisions from the next step on, the forces in them included.

        Parameters
        ----------
        names : iterable of str
            ``model::link::collision``; names of nothing report nothing.

        Returns
        -------
        ContactWatch
            Of :mod:`m2wr_sim.physics.contact_watch`; to be given to :meth:`end_watch` when it is no longer read.
        """

    @abc.abstractmethod
    def end_watch(self, watch):
        """Stop reporting to a watch."""

    @abc.abstractmethod
    def feel_joint(self, joint):
        """Let the solver note, from the next step on, what a joint does to its links."""

    @abc.abstractmethod
    def joint_wrench(self, joint):
        """Return what a joint did to its child link in the last step; needs :meth:`feel_joint` before.

        Returns
        -------
        (force, torque)
            [N] and [N m] about the link's centre of mass, world axes, the joint's motor included; zeros before the
            first step.
        """

    @abc.abstractmethod
    def configure(self, settings):
        """Go on with other :class:`EngineSettings`; the solver cannot be changed."""

    def set_gravity(self, gravity):
        """Change gravity [m/s^2]."""
        self.configure(replace(self.settings, gravity=tuple(gravity)))

    @abc.abstractmethod
    def reseed(self, seed):
        """Restart whatever random sequence the solver draws from."""

    @abc.abstractmethod
    def forget(self):
        """Forget the past: which pairs touch, the count of steps, the order in which things last moved.

        Poses and velocities stay.  Afterwards the world steps as a new one in the same state would, to the last bit.
        """

    @abc.abstractmethod
    def close(self):
        """Free the world; the engine cannot be used afterwards."""


def whole_step(step, where):
    """Return a physics step in whole nanoseconds; one above :data:`TRUSTED_STEP` is taken with a warning.

    Parameters
    ----------
    step : float
        In seconds.
    where : str
        What asks for it, for the message.

    Raises
    ------
    WorldError
        If the step is none that a world can be stepped with.
    """
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        raise WorldError("%s: physics step of %g s; expected %g to %g s" % (where, step, SHORTEST_STEP, LONGEST_STEP))
    if step > TRUSTED_STEP:
        log.warning("%s: physics step of %g ms; above %g ms robots bump through things and drive untrue",
                    where, 1e3 * step, 1e3 * TRUSTED_STEP)
    return int(round(step * 1e9))


def settings_from_physics(physics, step_ns, solver="step"):
    """Make :class:`EngineSettings` of a world's physics block.

    The world's ``erp`` (within the range that drives well), gravity, iteration count and contact limit are taken.
    Its contact layer, CFM and correcting velocity are not: Gazebo's values suit its own fork of ODE and make robots
    on stock ODE shake or slide.
    """
    limits: Dict[str, float] = {"erp": min(0.8, max(0.2, physics.erp))}
    return EngineSettings(step_ns=step_ns, solver=solver, iterations=min(max(1, physics.iters), MOST_ITERATIONS),
                          gravity=physics.gravity, max_contacts=min(max(1, physics.max_contacts), MOST_CONTACTS),
                          **limits)

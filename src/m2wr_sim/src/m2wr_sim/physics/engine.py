# SPDX-License-Identifier: BSD-3-Clause
"""Interface of the physics engines; they differ in speed, but not in their results.

Links and joints are addressed by the integers that :meth:`Engine.add_model` returns, so that the loop never looks up
names.  Positions, orientations ``(x, y, z, w)`` and velocities are in the world frame, SI units.
"""
from __future__ import annotations

import abc
import logging
from collections import namedtuple
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Callable, Dict, Iterable, List, Optional, Sequence, Tuple

from m2wr_sim.errors import WorldError
from m2wr_sim.geometry import compose
from m2wr_sim.physics.islands import ITERATIVE_ABOVE
from m2wr_sim.physics.moved_links import move_links

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.types import Axis, Collision, Inertial, Joint, Model, Physics
    from m2wr_sim.physics.contact_watch import ContactWatch
    from m2wr_sim.physics.moved_links import MovedLink

log = logging.getLogger(__name__)

# Beyond these, numerical errors make ODE abort the process; see physics/limits.py.
LEAST_MASS, LEAST_INERTIA, FARTHEST, FASTEST = 1e-6, 1e-12, 1e6, 1e4      # kg, kg m^2, m, m/s and rad/s

LEAST_SIZE = 1e-7       # m, of a shape; near TOO_FAR the resolution of doubles is 1.5e-8 m, and corners must differ

TOO_FAST = 1e9          # m/s and rad/s, sum over the axes; only a diverged simulation reaches it
TOO_FAR = 1e8           # m, sum over the axes; at 2^31 cells of 1/8 m ODE's hash space aborts the process

MOST_ITERATIONS, MOST_CONTACTS = 10000, 1000     # of the iterative solver, and per pair; more only takes more time

SHORTEST_STEP, LONGEST_STEP, TRUSTED_STEP = 1e-5, 0.1, 0.02     # s; up to the last one robots move accurately

JOINT_PARAMETERS = ("lower", "upper", "rate", "max_force", "fudge_factor", "cfm", "stop_erp", "stop_cfm", "erp")

ModelHandle = namedtuple("ModelHandle", "name links joints")
"""``links`` and ``joints`` map names to the integers the engine knows them by."""

LinkState = namedtuple("LinkState", "position orientation linear_velocity angular_velocity")
"""State of a link's own frame (not of its centre of mass), in the world frame."""

ContactEvent = namedtuple("ContactEvent", "step first second position depth")
"""First step of a contact, except with the ground: two ``model::link::collision`` names, position [m], depth [m]."""


@dataclass(frozen=True)
class EngineSettings:
    """Parameters of the solver and the step.

    With the defaults and steps of 1 to 10 ms the motion of wheeled robots is accurate to 0.1 %.  They are: the direct
    solver with a small compliance (``cfm``), which makes the redundant constraints of several ground contacts solvable;
    a thin ``surface_layer`` that maintains resting contacts; and a bounded correcting velocity, so that a sudden
    contact depth does not accelerate a robot.

    The direct solver limits friction by the normal forces of a world without friction.  For a robot that stands on the
    ground these forces are its weight.  If its wheels press it against a wall they are zero, and so would be the
    friction at the wall.  An island with such a contact (between two models, or on a face steeper than 37 degrees) is
    solved repeatedly until limits and forces agree within 0.1 %, at most ``friction_solves`` times; see
    :mod:`m2wr_sim.physics.coupled_friction`.  For a robot that slides along walls (m2wr in world02 with the printed
    rule, 16 800 such steps), 86 % of these steps need one solution, 9 % need 2 to 5, and 5 % do not agree after 5.
    Eight solutions reduce that to 3 %.  Without the forces of the last step as a start, and without averaging, 95 % did
    not agree after five.  The next step continues with the forces reached.
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

    A step with an island of more than ``iterative_above`` contacts is solved iteratively with either solver, because
    the direct solver would take seconds.  After each such step ``between``, if set, is called without arguments; an
    exception that it raises ends :meth:`step` early.

    Only the engine stores the poses of links.  ``placements`` counts the calls of :meth:`set_link_pose`.  ``version``
    increases with each of these calls and with each call of :meth:`step`; poses are valid while it stays the same.
    ``compiled`` says whether it is a :class:`~m2wr_sim.physics.native_engine.NativeEngine`, whose loop other compiled
    code can call.
    """

    settings: EngineSettings
    placements = 0
    version = 0
    compiled = False
    iterative_above = ITERATIVE_ABOVE
    between: Optional[Callable[[], None]] = None

    @abc.abstractmethod
    def add_model(self, model: Model, pose: Pose, name: Optional[str] = None) -> ModelHandle:
        """Add a model to the world.

        Parameters
        ----------
        model : m2wr_sim.model.types.Model
        pose : pose
            Pose of the model frame in the world.
        name : str, optional
            Name in the world; default: that of the model.

        Returns
        -------
        ModelHandle

        Raises
        ------
        ModelError
            If the model has values that ODE cannot use.
        """

    @abc.abstractmethod
    def remove_model(self, handle: ModelHandle) -> None:
        """Remove a model from the world and free its objects."""

    @abc.abstractmethod
    def abandon_model(self, handle: ModelHandle) -> None:
        """Free the bodies, geoms and joints of a model that left the world, but keep its links and joints readable.

        Its links have their initial poses, its joints are at 0, and forces and demands have no effect.
        :meth:`remove_model` must be called later.
        """

    @abc.abstractmethod
    def step(self, count: int) -> None:
        """Advance the world by ``count`` steps of ``settings.step_ns``.

        Raises
        ------
        LostError
            If the position of a body is not finite or beyond ``TOO_FAR``, or its velocity beyond ``TOO_FAST``.  ODE
            would abort the process in the next step.  After the models in the exception have been abandoned, stepping
            can continue.
        """

    @abc.abstractmethod
    def link_pose(self, link: int) -> Pose:
        """Return ``(position, orientation)`` of a link frame."""

    @abc.abstractmethod
    def link_state(self, link: int) -> LinkState:
        """Return the :class:`LinkState` of a link frame."""

    @abc.abstractmethod
    def set_link_pose(self, link: int, pose: Pose) -> None:
        """Move a link. Its velocity does not change, and joints are ignored.

        This is the only way to move a link from outside.  Values derived from poses can be checked with ``placements``,
        ``version`` and :meth:`placed_since`.

        Parameters
        ----------
        link : int
        pose : pose
            Of the link frame in the world.
        """

    @abc.abstractmethod
    def placed_since(self, version: int) -> List[int]:
        """Return the static links that were moved after the engine had that ``version``; the latest first."""

    @abc.abstractmethod
    def set_link_velocity(self, link: int, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Set the velocity of a link; no effect on a static link.

        Parameters
        ----------
        link : int
        linear : (3,) sequence of float
            Velocity of the centre of mass in the world [m/s].
        angular : (3,) sequence of float
            Angular velocity in the world [rad/s].

        Raises
        ------
        ModelError
            If a number is not finite; ODE would abort the process.
        """

    @abc.abstractmethod
    def joint_angle(self, joint: int) -> float:
        """Return the position of a joint [rad or m]; hinges count full rotations."""

    @abc.abstractmethod
    def joint_rate(self, joint: int) -> float:
        """Return the velocity of a joint [rad/s or m/s]."""

    @abc.abstractmethod
    def set_joint_motor(self, joint: int, rate: float, max_force: float) -> None:
        """Drive a joint towards a velocity.

        Parameters
        ----------
        joint : int
        rate : float
            Target velocity [rad/s or m/s].
        max_force : float
            Force limit [N m or N]; 0 switches the motor off.
        """

    @abc.abstractmethod
    def set_joint_motor_force(self, joint: int, max_force: float) -> None:
        """Change only the force limit of a joint's motor.

        Parameters
        ----------
        joint : int
        max_force : float
            [N m or N].
        """

    @abc.abstractmethod
    def add_link_force(self, link: int, force: Sequence[float], torque: Sequence[float]) -> None:
        """Apply a force and a torque to a link in the next step; no effect on a static link.

        Parameters
        ----------
        link : int
        force : (3,) sequence of float
            At the centre of mass, in the world frame [N].
        torque : (3,) sequence of float
            In the world frame [N m].
        """

    @abc.abstractmethod
    def add_joint_force(self, joint: int, force: float) -> None:
        """Apply an effort along the axis of a joint in the next step; no effect on a joint without axis.

        Parameters
        ----------
        joint : int
        force : float
            [N m or N].
        """

    @abc.abstractmethod
    def couple(self, first: int, second: Optional[int], point: Sequence[float], direction: Sequence[float],
               across: Sequence[float], speed: float) -> None:
        """Demand of two links, from the next step on, a speed of a common point along one direction.

        It replaces the former demand for this pair of links.  Point and direction do not move with the links, so it has
        to be called before every step.

        Parameters
        ----------
        first, second : int or None
            Two links of one model; None for the world.  No effect on static links.
        point : (3,) sequence of float
            In the world [m].
        direction : (3,) sequence of float
            Unit vector in the world.
        across : (3,) sequence of float
            A unit vector at right angles to it; best one along which the point can move.
        speed : float
            Of the point on the first link against the point on the second one [m/s].
        """

    @abc.abstractmethod
    def join(self, handle: ModelHandle, joint: Joint) -> int:
        """Add a joint to a model in the world, with its links as they are; its position is 0.

        Parameters
        ----------
        handle : ModelHandle
            Gets the joint, under its name.
        joint : m2wr_sim.model.types.Joint

        Returns
        -------
        int
            The engine's number of the joint.

        Raises
        ------
        ModelError
            If the model has a joint of that name, not its links, or is static.
        """

    @abc.abstractmethod
    def part(self, joint: int) -> None:
        """Detach a joint from its links for good; it stays readable, its position is 0."""

    @abc.abstractmethod
    def let_slip(self, link: int, axis: Sequence[float]) -> None:
        """Let the contacts of a link slip under load, as :meth:`set_slip` says; no effect on a static link.

        Parameters
        ----------
        link : int
        axis : (3,) sequence of float
            Unit vector in the link frame, which becomes the first direction of friction: the axis of a wheel.
        """

    @abc.abstractmethod
    def set_slip(self, link: int, along: float, across: float) -> None:
        """Set by how much the contacts of a link slip: slip velocity = compliance x force of friction.

        Parameters
        ----------
        link : int
            After :meth:`let_slip`.
        along, across : float
            Compliance [m/s/N] along the axis of the link, and across it; added to those of the two surfaces.
        """

    @abc.abstractmethod
    def set_link_gravity(self, link: int, acts: bool) -> None:
        """Switch gravity on or off for a link.

        Parameters
        ----------
        link : int
        acts : bool
        """

    @abc.abstractmethod
    def set_link_inertial(self, link: int, inertial: Inertial) -> None:
        """Change mass, inertia and centre of mass of a link. Its pose and motion do not change.

        Parameters
        ----------
        link : int
        inertial : m2wr_sim.model.types.Inertial

        Raises
        ------
        ModelError
            If they are not those of a physical body.
        """

    @abc.abstractmethod
    def change_joint(self, joint: int, axis: Axis, parameters: Dict[str, float], index: int = 0) -> None:
        """Change the parameters of one axis of a joint.

        Parameters
        ----------
        joint : int
            A joint with axes, see :meth:`~m2wr_sim.model.types.Joint.axes`.
        axis : Axis
            Its damping is used.
        parameters : dict
            Parameters of the solver: name, one of :data:`JOINT_PARAMETERS`, -> value.
        index : int
            Index of the axis.
        """

    @abc.abstractmethod
    def set_joint_angle(self, joint: int, angle: float) -> None:
        """Set the position of a joint after its links have been moved accordingly.

        Parameters
        ----------
        joint : int
        angle : float
            [rad or m].
        """

    @abc.abstractmethod
    def collisions(self, handle: ModelHandle) -> List[Tuple[int, Collision, bool]]:
        """Return ``[(link, Collision, movable), ...]`` of a model, in load order."""

    def pose_reader(self, parts: Sequence[Tuple[int, Pose]], poses: NDArray[np.float64]) -> Callable[[], None]:
        """Return a function that writes the present poses of shapes that are fixed to links.

        Parameters
        ----------
        parts : list of (int, pose)
            Link, and the pose of the shape in the link frame.
        poses : (n, 7) float64
            Written by the function, C-contiguous: position x y z [m], orientation x y z w.

        Returns
        -------
        callable
            ``read()``.  Must not be used after one of the links has been removed.
        """
        def read() -> None:
            known = {}
            for index, (link, offset) in enumerate(parts):
                if link not in known:
                    known[link] = self.link_pose(link)
                poses[index, :3], poses[index, 3:] = compose(known[link], offset)

        return read

    def motion_reader(self, link: int, offset: Pose, motion: NDArray[np.float64]) -> Callable[[], None]:
        """Return a function that writes the present pose of a frame that is fixed to a link, and the link's velocity.

        Parameters
        ----------
        link : int
        offset : pose
            Pose of the frame in the link frame.
        motion : (13,) float64
            Written by the function, C-contiguous: position x y z [m], orientation x y z w; linear velocity of the
            origin of the link [m/s] and angular velocity [rad/s], in the world.

        Returns
        -------
        callable
            ``read()``.  Must not be used after the link has been removed.
        """
        def read() -> None:
            state = self.link_state(link)
            motion[:3], motion[3:7] = compose((state.position, state.orientation), offset)
            motion[7:10], motion[10:] = state.linear_velocity, state.angular_velocity

        return read

    def link_mover(self, parts: Sequence[MovedLink], motions: NDArray[np.float64],
                   chosen: NDArray[np.int64]) -> Callable[[], None]:
        """Return a function that places the links of models and sets their velocities, as rigid motions.

        Parameters
        ----------
        parts : list of MovedLink
        motions : (n, 13) float64
            Read by the function, C-contiguous: of the frame of each model in the world the position x y z [m], the
            orientation x y z w, the linear velocity [m/s] and the angular velocity [rad/s].  All must be finite.
        chosen : (n,) int64
            Read by the function: 1 for the models to be moved.

        Returns
        -------
        callable
            ``move()``.  Must not be used after one of the links has been removed.
        """
        return lambda: move_links(self, parts, motions, chosen)

    @abc.abstractmethod
    def drain_contact_events(self) -> List[ContactEvent]:
        """Return the list of :class:`ContactEvent` since the last call."""

    @abc.abstractmethod
    def watch_contacts(self, names: Iterable[str]) -> ContactWatch:
        """Report the contacts of some collisions from the next step on, the forces in them included.

        Parameters
        ----------
        names : iterable of str
            ``model::link::collision``; unknown names are ignored.

        Returns
        -------
        ContactWatch
            See :mod:`m2wr_sim.physics.contact_watch`.  Pass it to :meth:`end_watch` when it is no longer used.
        """

    @abc.abstractmethod
    def end_watch(self, watch: ContactWatch) -> None:
        """Stop reporting to a watch."""

    @abc.abstractmethod
    def feel_joint(self, joint: int) -> None:
        """Measure the forces of a joint on its links from the next step on."""

    @abc.abstractmethod
    def joint_wrench(self, joint: int) -> Tuple[Vector, Vector]:
        """Return the wrench of a joint on its child link in the last step; call :meth:`feel_joint` before.

        Returns
        -------
        (force, torque)
            [N] and [N m] about the centre of mass of the link, in the world frame, including the joint's motor; zeros
            before the first step.
        """

    @property
    @abc.abstractmethod
    def solver_messages(self) -> int:
        """Number of messages of ODE's solver in this process; a constant stream means an ill-conditioned world."""

    @abc.abstractmethod
    def configure(self, settings: EngineSettings) -> None:
        """Change the :class:`EngineSettings`; the solver must stay the same."""

    def set_gravity(self, gravity: Sequence[float]) -> None:
        """Change gravity [m/s^2]."""
        x, y, z = gravity
        self.configure(replace(self.settings, gravity=(x, y, z)))

    @abc.abstractmethod
    def reseed(self, seed: int) -> None:
        """Restart the random sequence of the solver."""

    @abc.abstractmethod
    def forget(self) -> None:
        """Reset the history: which pairs are in contact, the number of steps, the order in which bodies last moved.

        Poses and velocities do not change.  Afterwards the results are those of a new world in the same state, to the
        last bit.
        """

    @abc.abstractmethod
    def close(self) -> None:
        """Free the world; the engine cannot be used afterwards."""


def whole_step(step: float, where: str) -> int:
    """Return a physics step in whole nanoseconds; above :data:`TRUSTED_STEP` a warning is logged.

    Parameters
    ----------
    step : float
        [s].
    where : str
        Where the step was read, for messages.

    Returns
    -------
    int
        [ns].

    Raises
    ------
    WorldError
        If the step is outside of the range that ODE can use.
    """
    if not SHORTEST_STEP <= step <= LONGEST_STEP:
        raise WorldError("%s: physics step of %g s; expected %g to %g s" % (where, step, SHORTEST_STEP, LONGEST_STEP))
    if step > TRUSTED_STEP:
        log.warning("%s: physics step of %g ms; above %g ms expect tunnelling and inaccurate motion",
                    where, 1e3 * step, 1e3 * TRUSTED_STEP)
    return int(round(step * 1e9))


def settings_from_physics(physics: Physics, step_ns: int, solver: str = "step") -> EngineSettings:
    """Return the settings for the physics element of a world.

    Used are ``erp`` (clipped to the range in which robots move well), gravity, number of iterations and contact limit.
    Contact layer, CFM and correcting velocity are ignored.  Gazebo's values are meant for its own fork of ODE; with
    unmodified ODE they make robots shake or slide.

    Parameters
    ----------
    physics : m2wr_sim.model.types.Physics
    step_ns : int
        Step size [ns].
    solver : str
        ``step`` (direct) or ``quick`` (iterative).

    Returns
    -------
    EngineSettings
    """
    return EngineSettings(step_ns=step_ns, solver=solver, iterations=min(max(1, physics.iters), MOST_ITERATIONS),
                          gravity=physics.gravity, max_contacts=min(max(1, physics.max_contacts), MOST_CONTACTS),
                          erp=min(0.8, max(0.2, physics.erp)))

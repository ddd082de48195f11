# SPDX-License-Identifier: BSD-3-Clause
"""Models in a running world; finds models, links and joints by name."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.errors import NotFoundError
from m2wr_sim.geometry import (
    Pose,
    Quaternion,
    Vector,
    compose,
    conjugate,
    invert,
    multiply,
    normalise_quaternion,
    rotate_inverse,
)
from m2wr_sim.model.types import SECOND_AXIS

if TYPE_CHECKING:
    from m2wr_sim.model.types import Inertial, Joint, Link, Model
    from m2wr_sim.physics.engine import Engine, LinkState, ModelHandle
    from m2wr_sim.runtime.event_queue import Entry

INERTIAL_FRAMES = ("", "world", "map", "/map")

_MOST_NAMES = 8         # in a message


class Relative(NamedTuple):
    """Pose [m] and velocity [m/s, rad/s] of a model or link relative to a frame, in the axes of that frame."""

    position: Vector
    orientation: Quaternion
    linear: Vector
    angular: Vector


def list_names(names: Iterable[str]) -> str:
    """Return names for a message; of a long list only the first few."""
    names = list(names)
    if not names:
        return "none"
    more = len(names) - _MOST_NAMES
    return ", ".join(names[:_MOST_NAMES]) + (" and %d more" % more if more > 0 else "")


def kinematic(record: Model) -> Model:
    """Return a model that moves others, but that forces and contacts do not move."""
    return replace(record, static=False, joints=(), allow_auto_disable=False, links=tuple(
        replace(link, kinematic=True, gravity=False) for link in record.links))


class LiveModel:
    """A model in the world.

    Parameters
    ----------
    record : Model
    handle : ModelHandle
        The engine's numbers of its links and joints.
    pose : pose
        Pose of the model frame in the world after a reset.

    Attributes
    ----------
    plugins : list of Entry
        The plugins that were started, also those that were switched off later.
    kept_inertials : dict
        Link -> Inertial that the physics uses, if the record has another.
    """

    def __init__(self, record: Model, handle: ModelHandle, pose: Pose) -> None:
        self.record, self.handle, self.reset_pose = record, handle, pose
        self.name: str = handle.name
        self.plugins: List[Entry] = []
        self.kept_inertials: Dict[str, Inertial] = {}
        self._root = record.links[0]
        self._root_offset = invert(self._root.pose)
        self._initial: Optional[Tuple[Pose, List[Pose]]] = None     # a reset pose, and the poses of the links for it

    @property
    def root(self) -> int:
        """The engine's number of the first link, which defines pose and velocity of the model."""
        return self.handle.links[self._root.name]

    def link_record(self, name: str) -> Link:
        """Return the record of a link."""
        return next(link for link in self.record.links if link.name == name)

    def acting_inertial(self, name: str) -> Inertial:
        """Return the Inertial of a link that the physics uses."""
        return self.kept_inertials.get(name) or self.link_record(name).inertial

    def joint_record(self, name: str) -> Joint:
        """Return the record of a joint."""
        return record_of_joint(self.record, name)

    def pose(self, engine: Engine) -> Pose:
        """Return the model frame's ``(position, orientation)`` in the world."""
        return compose(engine.link_pose(self.root), self._root_offset)

    def state(self, engine: Engine) -> LinkState:
        """Return the LinkState of the model: the pose of its frame, and the velocities of its root link."""
        state = engine.link_state(self.root)
        position, orientation = compose((state.position, state.orientation), self._root_offset)
        return state._replace(position=position, orientation=orientation)

    def place(self, engine: Engine, pose: Pose) -> None:
        """Move the model as a rigid body. Joint positions do not change.

        Parameters
        ----------
        engine : Engine
        pose : pose
            New pose of the model frame in the world; the quaternion need not be normalised.
        """
        now_from_world = invert(self.pose(engine))
        target = (pose[0], normalise_quaternion(pose[1]))
        for link in self.handle.links.values():
            position, orientation = compose(target, compose(now_from_world, engine.link_pose(link)))
            engine.set_link_pose(link, (position, normalise_quaternion(orientation)))

    def restore(self, engine: Engine) -> None:
        """Move all links to the initial configuration at the reset pose."""
        if self._initial is None or self._initial[0] is not self.reset_pose:
            poses = [compose(self.reset_pose, link.pose) for link in self.record.links]
            self._initial = self.reset_pose, [(position, normalise_quaternion(turn)) for position, turn in poses]
        for link, pose in zip(self.record.links, self._initial[1]):
            number = self.handle.links[link.name]
            if not self.record.static or engine.link_pose(number) != pose:
                engine.set_link_pose(number, pose)
        for joint in self.handle.joints.values():
            engine.set_joint_angle(joint, 0.0)

    def set_joint_position(self, engine: Engine, name: str, position: float) -> None:
        """Set the position of a joint by moving all links beyond it.

        Parameters
        ----------
        engine : Engine
        name : str
            Name of the joint.
        position : float
            [rad or m]; clipped to the limits of the joint.
        """
        joint = self.joint_record(name)
        position = min(joint.axis.upper, max(joint.axis.lower, position))
        number, child = self.handle.joints[name], self.handle.links[joint.child]
        joint_pose = compose(engine.link_pose(child), joint.pose)
        delta = position - engine.joint_angle(number)
        axis = np.asarray(joint.axis.xyz, dtype=float) / np.linalg.norm(joint.axis.xyz)
        if joint.kind == "prismatic":
            change = (tuple(delta * axis), (0.0, 0.0, 0.0, 1.0))
        else:
            change = ((0.0, 0.0, 0.0), tuple(math.sin(0.5 * delta) * axis) + (math.cos(0.5 * delta),))
        world_change = compose(compose(joint_pose, change), invert(joint_pose))
        for link in (self.handle.links[name] for name in self.links_beyond(joint.child)):
            engine.set_link_pose(link, compose(world_change, engine.link_pose(link)))
        engine.set_joint_angle(number, position)

    def links_beyond(self, link: str) -> List[str]:
        """Return the names of a link and of all its descendants."""
        found: List[str] = []
        waiting = [link]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.append(name)
                waiting.extend(joint.child for joint in self.record.joints if joint.parent == name)
        return found

    def set_velocity(self, engine: Engine, linear: Sequence[float], angular: Sequence[float]) -> None:
        """Set the same velocities for all links, as Gazebo's set_model_state does.

        Parameters
        ----------
        engine : Engine
        linear, angular : (3,) sequences of float
            In the world [m/s, rad/s].
        """
        for link in self.handle.links.values():
            engine.set_link_velocity(link, linear, angular)


def relative(state: LinkState, reference: Optional[LinkState]) -> Relative:
    """Return a state relative to a frame.

    Velocities are the difference of the velocities in the world, rotated into the frame.  The rotation rate of the
    frame is ignored, as in Gazebo.

    Parameters
    ----------
    state : LinkState
    reference : LinkState or None
        State of the frame; None for the world.

    Returns
    -------
    Relative
    """
    if reference is None:
        return Relative(*state)
    offset = tuple(a - b for a, b in zip(state.position, reference.position))
    back = reference.orientation
    linear = tuple(a - b for a, b in zip(state.linear_velocity, reference.linear_velocity))
    angular = tuple(a - b for a, b in zip(state.angular_velocity, reference.angular_velocity))
    return Relative(rotate_inverse(back, offset), multiply(conjugate(back), state.orientation),
                    rotate_inverse(back, linear), rotate_inverse(back, angular))


def _find(models: Iterable[LiveModel], parts_of: Callable[[Model], Sequence[Any]],
          name: str) -> Optional[Tuple[LiveModel, str]]:
    """Return the first model with a part of that name, and the part's name in it; None if there is none."""
    for model in models:
        for part in parts_of(model.record):
            if name in (part.name, part.name.rsplit("::", 1)[-1], "%s::%s" % (model.name, part.name)):
                return model, part.name
    return None


def find_link(models: Iterable[LiveModel], name: str) -> Optional[Tuple[LiveModel, str]]:
    """Find a link by scoped (``model::link``) or plain name; the first match in load order is used.

    Parameters
    ----------
    models : iterable of LiveModel
    name : str

    Returns
    -------
    (LiveModel, str) or None
        The model, and the name of the link in it.
    """
    return _find(models, lambda record: record.links, name)


def find_joint(models: Iterable[LiveModel], name: str) -> Optional[Tuple[LiveModel, str]]:
    """Find a joint by scoped or plain name; the first match in load order is used.

    Parameters
    ----------
    models : iterable of LiveModel
    name : str

    Returns
    -------
    (LiveModel, str) or None
        The model, and the name of the joint in it.
    """
    plain, second = plain_joint_name(name)
    found = _find(models, lambda record: [joint for joint in record.joints if not second or len(joint.axes()) > 1],
                  plain)
    return (found[0], found[1] + SECOND_AXIS) if found is not None and second else found


def plain_joint_name(name: str) -> Tuple[str, bool]:
    """Return the name of a joint without :data:`SECOND_AXIS`, and whether it had it."""
    second = name.endswith(SECOND_AXIS)
    return (name[:-len(SECOND_AXIS)] if second else name), second


def record_of_joint(record: Model, name: str) -> Joint:
    """Return the record of a joint, or of the second axis of one.

    Parameters
    ----------
    record : Model
    name : str

    Returns
    -------
    Joint
    """
    plain, second = plain_joint_name(name)
    joint = next(joint for joint in record.joints if joint.name == plain)
    return joint.along_second() if second else joint


def find_frame(models: Iterable[LiveModel], engine: Engine, name: str) -> Optional[LinkState]:
    """Return the state of a reference frame.

    Parameters
    ----------
    models : iterable of LiveModel
    engine : Engine
    name : str
        Name of a model or link, or one of :data:`INERTIAL_FRAMES`.

    Returns
    -------
    LinkState or None
        None for the world.

    Raises
    ------
    NotFoundError
        If there is no such model or link.
    """
    if name in INERTIAL_FRAMES:
        return None
    for model in models:
        if model.name == name:
            return model.state(engine)
        found = find_link([model], name)
        if found is not None:
            return engine.link_state(model.handle.links[found[1]])
    names = list_names(model.name for model in models)
    raise NotFoundError("no model or link is called \"%s\"; models: %s" % (name, names))

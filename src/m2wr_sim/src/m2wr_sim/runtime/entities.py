# SPDX-License-Identifier: BSD-3-Clause
"""Models that live in a running world, and finding them and their links by name."""
import math
from collections import namedtuple

import numpy as np

from m2wr_sim.errors import NotFoundError
from m2wr_sim.geometry import compose, conjugate, invert, multiply, normalise_quaternion, rotate_inverse

Relative = namedtuple("Relative", "position orientation linear angular")
"""Pose and velocity of a model or link relative to some frame."""

INERTIAL_FRAMES = ("", "world", "map", "/map")


_NAMES_TOLD = 8


def tell(names):
    """Return names for a message; of a long list only the first few."""
    names = list(names)
    if not names:
        return "none"
    more = len(names) - _NAMES_TOLD
    return ", ".join(names[:_NAMES_TOLD]) + (" and %d more" % more if more > 0 else "")


class LiveModel:
    """A model in the world: its record, the engine's numbers for its parts, its plugins, and where a reset puts it."""

    def __init__(self, record, handle, pose):
        self.record, self.handle, self.reset_pose = record, handle, pose
        self.name = handle.name
        self.plugins = []
        self.sight = None               # SceneRows of what can move by itself
        self.kept_inertials = {}        # link -> Inertial that still acts where the record tells another
        self._root = record.links[0]
        self._root_offset = invert(self._root.pose)

    @property
    def root(self):
        """The engine's number of the first link, whose frame and velocity stand for the model."""
        return self.handle.links[self._root.name]

    def link_record(self, name):
        """Return the record of a link."""
        return next(link for link in self.record.links if link.name == name)

    def acting_inertial(self, name):
        """Return the Inertial with which a link moves."""
        return self.kept_inertials.get(name) or self.link_record(name).inertial

    def joint_record(self, name):
        """Return the record of a joint."""
        return next(joint for joint in self.record.joints if joint.name == name)

    def pose(self, engine):
        """Return the model frame's ``(position, orientation)`` in the world."""
        return compose(engine.link_pose(self.root), self._root_offset)

    def state(self, engine):
        """Return the LinkState of the model: its frame's pose with the root link's velocities."""
        state = engine.link_state(self.root)
        position, orientation = compose((state.position, state.orientation), self._root_offset)
        return state._replace(position=position, orientation=orientation)

    def place(self, engine, pose):
        """Move the model rigidly so that its frame stands at ``pose``; joint positions do not change."""
        now_from_world = invert(self.pose(engine))
        target = (pose[0], normalise_quaternion(pose[1]))
        for link in self.handle.links.values():
            position, orientation = compose(target, compose(now_from_world, engine.link_pose(link)))
            engine.set_link_pose(link, (position, normalise_quaternion(orientation)))

    def restore(self, engine):
        """Put every link back to the initial configuration at the reset pose."""
        for link in self.record.links:
            position, orientation = compose(self.reset_pose, link.pose)
            engine.set_link_pose(self.handle.links[link.name], (position, normalise_quaternion(orientation)))
        for joint in self.handle.joints.values():
            engine.set_joint_angle(joint, 0.0)

    def bend(self, engine, name, position):
        """Move everything beyond a joint so that the joint stands at ``position`` [rad or m], within its limits."""
        joint = self.joint_record(name)
        position = min(joint.axis.upper, max(joint.axis.lower, position))
        number, child = self.handle.joints[name], self.handle.links[joint.child]
        joint_pose = compose(engine.link_pose(child), joint.pose)
        by = position - engine.joint_angle(number)
        axis = np.asarray(joint.axis.xyz, dtype=float) / np.linalg.norm(joint.axis.xyz)
        if joint.kind == "prismatic":
            change = (tuple(by * axis), (0.0, 0.0, 0.0, 1.0))
        else:
            change = ((0.0, 0.0, 0.0), tuple(math.sin(0.5 * by) * axis) + (math.cos(0.5 * by),))
        world_change = compose(compose(joint_pose, change), invert(joint_pose))
        for link in (self.handle.links[name] for name in self.links_beyond(joint.child)):
            engine.set_link_pose(link, compose(world_change, engine.link_pose(link)))
        engine.set_joint_angle(number, position)

    def links_beyond(self, link):
        """Return the names of a link and of all links that hang on it."""
        found, waiting = [], [link]
        while waiting:
            name = waiting.pop()
            if name not in found:
                found.append(name)
                waiting.extend(joint.child for joint in self.record.joints if joint.parent == name)
        return found

    def set_velocity(self, engine, linear, angular):
        """Give every link the same linear and angular velocity, as Gazebo's set_model_state does."""
        for link in self.handle.links.values():
            engine.set_link_velocity(link, linear, angular)


class SceneRows:
    """Rows in the scene that rays see, and how to bring them up to date.

    Parameters
    ----------
    parts : list of (int, int, pose)
        Row, engine's link number, pose of the shape in the link frame.
    """

    def __init__(self, parts):
        self.parts = parts
        self._read = self._move = None

    def refresh(self, engine, scene):
        """Write the present poses into the scene."""
        if self._read is None:
            poses = np.zeros((len(self.parts), 7))
            self._read = engine.pose_reader([part[1:] for part in self.parts], poses)
            self._move = scene.mover(np.array([part[0] for part in self.parts], dtype=np.int64), poses)
        self._read()
        self._move()


def relative(state, reference):
    """Return a LinkState as :class:`Relative` to that of a frame; to the world itself where that is None.

    Velocities are the difference of the world velocities, turned into the frame, without the term of a turning
    frame, as in Gazebo.
    """
    if reference is None:
        return Relative(*state)
    offset = tuple(a - b for a, b in zip(state.position, reference.position))
    back = reference.orientation
    linear = tuple(a - b for a, b in zip(state.linear_velocity, reference.linear_velocity))
    angular = tuple(a - b for a, b in zip(state.angular_velocity, reference.angular_velocity))
    return Relative(rotate_inverse(back, offset), multiply(conjugate(back), state.orientation),
                    rotate_inverse(back, linear), rotate_inverse(back, angular))


def _find(models, parts_of, name):
    for model in models:
        for part in parts_of(model.record):
            if name in (part.name, part.name.rsplit("::", 1)[-1], "%s::%s" % (model.name, part.name)):
                return model, part.name
    return None


def find_link(models, name):
    """Find a link by scoped (``model::link``) or plain name; the first match in load order wins.

    Returns
    -------
    (LiveModel, str) or None
    """
    return _find(models, lambda record: record.links, name)


def find_joint(models, name):
    """Find a joint as :func:`find_link` finds a link."""
    return _find(models, lambda record: record.joints, name)


def find_frame(models, engine, name):
    """Return the LinkState of a reference frame: a model or a link; None stands for the world itself.

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
    raise NotFoundError("no model or link is called \"%s\"; models: %s" % (name, tell(model.name for model in models)))

# SPDX-License-Identifier: BSD-3-Clause
"""Poses that are given relative to other elements of a model or world (``relative_to``), brought to one frame."""
import math

from m2wr_sim.geometry import IDENTITY, compose, invert, normalise_quaternion, quaternion_from_rpy
from m2wr_sim.model.xml.safe import XmlError, fail, parse_float, shorten


def _numbers(leaf, count, expected):
    """Return the numbers of a pose; missing ones are 0 with a warning, as in Gazebo."""
    text = leaf.own_text()
    try:
        numbers = tuple(parse_float(leaf.element, word, "pose") for word in text.split())
    except XmlError as error:
        leaf.notes.add("{}; using a zero pose.".format(error))
        numbers = (0.0,) * count
    if len(numbers) != count:
        leaf.notes.add('{}: pose is "{}"; expected {}; {}.'.format(
            leaf.place, shorten(text), expected, "using 0 for the missing ones" if len(numbers) < count else
            "using the first {}".format(count)))
    return (numbers + (0.0,) * count)[:count]


def raw_pose(node):
    """Return an element's own ``<pose>`` and the name it is relative to.

    Parameters
    ----------
    node : Node

    Returns
    -------
    pose : Pose
        Identity where there is no ``<pose>``, or one that holds no numbers.
    relative_to : str or None
        From ``relative_to``, or from ``frame`` of older files; empty text counts as not given.
    """
    leaf = node.child("pose")
    if not leaf:
        return IDENTITY, None
    relative_to = leaf.attribute("relative_to") or leaf.attribute("frame") or None
    degrees = leaf.attribute("degrees").lower() in ("true", "1")
    if not leaf.own_text():
        return IDENTITY, relative_to
    if leaf.attribute("rotation_format") == "quat_xyzw":
        numbers = _numbers(leaf, 7, "seven numbers: x y z and a quaternion x y z w")
        return (numbers[:3], normalise_quaternion(numbers[3:])), relative_to
    numbers = _numbers(leaf, 6, "six numbers: x y z roll pitch yaw")
    turn = tuple(math.radians(value) for value in numbers[3:]) if degrees else numbers[3:]
    return (numbers[:3], quaternion_from_rpy(*turn)), relative_to


class Frames:
    """The named frames of one model (or world), each given relative to another one.

    Parameters
    ----------
    notes : Notes
        Receives the names that do not exist here.
    roots : tuple of str
        Names of the frame that everything is resolved to.
    """

    def __init__(self, notes, roots=("__model__",)):
        self._notes = notes
        self._roots = roots
        self._given = {}
        self._resolved = {}

    def add(self, name, pose, relative_to, node):
        """Name a frame: its pose and what that is relative to (None: the root frame).  The first of a name wins."""
        self._given.setdefault(name, (pose, relative_to, node))

    def has(self, name):
        """Return whether there is a frame of this name."""
        return name in self._given or name in self._roots

    def resolve(self, name, node=None, asking=()):
        """Return the pose of a named frame in the root frame.

        For an unknown name there is a warning and the root frame is used.

        Raises
        ------
        XmlError
            If the frames form a cycle.
        """
        if name is None or name in self._roots:
            return IDENTITY
        if name not in self._given:
            if node is not None:
                self._notes.add('{}: the pose is relative to "{}", which is not a frame of it (frames: {}); using '
                                'the enclosing model.'.format(node.line, name, _some(self._given)))
            return IDENTITY
        if name not in self._resolved:
            pose, relative_to, given_at = self._given[name]
            if name in asking:
                fail(given_at.element, "poses relative to each other form a cycle ({})".format(
                    " -> ".join(asking + (name,))), "frames that end at the model")
            self._resolved[name] = compose(self.resolve(relative_to, given_at, asking + (name,)), pose)
        return self._resolved[name]

    def settle(self):
        """Break cycles of frames with a warning: the first of a cycle is placed in the root frame."""
        for name, (pose, _, node) in self._given.items():
            try:
                self.resolve(name)
            except (XmlError, RecursionError) as error:
                what = str(error) if isinstance(error, XmlError) else "{}: poses are relative to each other through " \
                    "too many frames; expected fewer".format(node.line)
                self._notes.add("{}; using the pose of {} in the enclosing frame.".format(what, name))
                self._resolved[name] = pose

    def pose_in(self, node, carrier):
        """Return an element's pose in the frame ``carrier``, to which it is relative by default."""
        pose, relative_to = raw_pose(node)
        if relative_to is None or relative_to == carrier:
            return pose
        return compose(invert(self.resolve(carrier)), compose(self.resolve(relative_to, node), pose))


def _some(names, limit=8):
    """Return names for a message, not more than a few."""
    listed = sorted(names)
    return ", ".join(listed[:limit]) + (", ..." if len(listed) > limit else "") if listed else "none"

# SPDX-License-Identifier: BSD-3-Clause
"""Poses that are given relative to other elements of a model or world (``relative_to``), brought to one frame."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Dict, Iterable, Optional, Tuple

from m2wr_sim.geometry import IDENTITY, compose, invert, normalise_quaternion, quaternion_from_rpy
from m2wr_sim.model.xml.safe import XmlError, fail, parse_float, shorten

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.notes import Notes
    from m2wr_sim.model.sdf.node import Node


def _numbers(leaf: Node, count: int, expected: str) -> Tuple[float, ...]:
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


def raw_pose(node: Node) -> Tuple[Pose, Optional[str]]:
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
    if leaf.raw_pose is None:
        leaf.raw_pose = _read_pose(leaf)
    return leaf.raw_pose


def _read_pose(leaf: Node) -> Tuple[Pose, Optional[str]]:
    """Return what :func:`raw_pose` does, from the ``<pose>``."""
    relative_to = leaf.attribute("relative_to") or leaf.attribute("frame") or None
    degrees = leaf.attribute("degrees").lower() in ("true", "1")
    if not leaf.own_text():
        return IDENTITY, relative_to
    if leaf.attribute("rotation_format") == "quat_xyzw":
        x, y, z, *quaternion = _numbers(leaf, 7, "seven numbers: x y z and a quaternion x y z w")
        return ((x, y, z), normalise_quaternion(quaternion)), relative_to
    x, y, z, roll, pitch, yaw = _numbers(leaf, 6, "six numbers: x y z roll pitch yaw")
    if degrees:
        roll, pitch, yaw = math.radians(roll), math.radians(pitch), math.radians(yaw)
    return ((x, y, z), quaternion_from_rpy(roll, pitch, yaw)), relative_to


class Frames:
    """The named frames of one model (or world), each given relative to another one.

    Parameters
    ----------
    notes : Notes
        Gets warnings about unknown names.
    roots : tuple of str
        Names of the frame that everything is resolved to.
    """

    def __init__(self, notes: Notes, roots: Tuple[str, ...] = ("__model__",)) -> None:
        self._notes = notes
        self._roots = roots
        self._given: Dict[str, Tuple[Pose, Optional[str], Node]] = {}
        self._resolved: Dict[str, Pose] = {}

    def add(self, name: str, pose: Pose, relative_to: Optional[str], node: Node) -> None:
        """Add a named frame, unless there is one of this name.

        Parameters
        ----------
        name : str
        pose : pose
            Pose of the frame in ``relative_to``.
        relative_to : str or None
            Name of another frame; None for the root frame.
        node : Node
            Its element, for messages.
        """
        self._given.setdefault(name, (pose, relative_to, node))

    def has(self, name: str) -> bool:
        """Return whether there is a frame of this name."""
        return name in self._given or name in self._roots

    def resolve(self, name: Optional[str], node: Optional[Node] = None, asking: Tuple[str, ...] = ()) -> Pose:
        """Return the pose of a named frame in the root frame.

        For an unknown name there is a warning and the root frame is used.

        Parameters
        ----------
        name : str or None
            None for the root frame.
        node : Node, optional
            The element with the name, for the warning; none without it.
        asking : tuple of str
            Names that are being resolved.

        Returns
        -------
        pose

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

    def settle(self) -> None:
        """Break cycles of frames with a warning: the first of a cycle is placed in the root frame."""
        for name, (pose, _, node) in self._given.items():
            try:
                self.resolve(name)
            except (XmlError, RecursionError) as error:
                what = str(error) if isinstance(error, XmlError) else "{}: poses are relative to each other through " \
                    "too many frames; expected fewer".format(node.line)
                self._notes.add("{}; using the pose of {} in the enclosing frame.".format(what, name))
                self._resolved[name] = pose

    def pose_in(self, node: Node, carrier: str) -> Pose:
        """Return an element's pose in the frame ``carrier``, to which it is relative by default.

        Parameters
        ----------
        node : Node
        carrier : str
            Name of a frame.

        Returns
        -------
        pose
        """
        pose, relative_to = raw_pose(node)
        if relative_to is None or relative_to == carrier:
            return pose
        return compose(invert(self.resolve(carrier)), compose(self.resolve(relative_to, node), pose))


def _some(names: Iterable[str], limit: int = 8) -> str:
    """Return names for a message, not more than a few."""
    listed = sorted(names)
    return ", ".join(listed[:limit]) + (", ..." if len(listed) > limit else "") if listed else "none"

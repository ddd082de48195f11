# SPDX-License-Identifier: BSD-3-Clause
"""``<joint>`` of SDF -> Joint, with the axis conventions of the SDF versions."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Callable, Collection, Mapping, Optional, Sequence, Tuple

from m2wr_sim.geometry import IDENTITY, compose, rotate, rotate_inverse
from m2wr_sim.model.types import Axis, Joint
from m2wr_sim.model.xml.safe import fail

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.sdf.frames import Frames
    from m2wr_sim.model.sdf.node import Node

NO_LIMIT = 1e16

_KINDS = ("revolute", "prismatic", "fixed", "ball", "universal")
_UNUSED_KINDS = ("revolute2", "screw", "gearbox")
_MOST_NAMES = 12        # of links in a message
_DYNAMICS = ("damping", "friction", "spring_stiffness", "spring_reference")


def unit(element: Any, vector: Sequence[float]) -> Vector:
    """Return a vector scaled to length one; XmlError if it has no length.

    Parameters
    ----------
    element : lxml element
        For the message.
    vector : (3,) sequence of float

    Returns
    -------
    tuple of 3 floats

    Raises
    ------
    XmlError
        If the length is 0.
    """
    x, y, z = vector
    length = math.sqrt(sum(value * value for value in vector))
    if length < 1e-9:
        fail(element, "the axis has no length", "a direction such as 0 0 1")
    return (x / length, y / length, z / length)


def clamp_limit(value: float) -> float:
    """Return a joint limit with infinity replaced by +-1e16, which means no limit."""
    return max(-NO_LIMIT, min(NO_LIMIT, value))


def _axis(node: Node, joint: Node, model_from_joint: Pose, frames: Frames, version: Tuple[int, ...]) -> Axis:
    """Read one axis; ``model_from_joint`` is the joint frame in the model frame."""
    solver, defaults = joint.child("physics").child("ode"), Axis()
    stop = solver.child("limit")
    dynamics, limit = node.child("dynamics"), node.child("limit")
    xyz = node.vector("xyz", 3, defaults.xyz)
    if node:
        xyz = unit(node.element, xyz)
    in_model_frame = node.flag("use_parent_model_frame", version <= (1, 4))
    if node:        # without one the default direction is along the joint's own z
        expressed_in = node.child("xyz").attribute("expressed_in")
        if expressed_in:
            xyz = rotate_inverse(model_from_joint[1], rotate(frames.resolve(expressed_in, node.child("xyz"))[1], xyz))
        elif in_model_frame:
            xyz = rotate_inverse(model_from_joint[1], xyz)
    lower = clamp_limit(limit.number("lower", defaults.lower, allow_infinite=True))
    upper = clamp_limit(limit.number("upper", defaults.upper, allow_infinite=True))
    if lower > upper:
        joint.notes.add("{}: the lower limit {:g} is above the upper limit {:g}; they are exchanged.".format(
            limit.line, lower, upper))
        lower, upper = upper, lower
    return Axis(xyz=xyz, lower=lower, upper=upper,
                effort=_no_limit(limit.number("effort", -1.0, allow_infinite=True)),
                velocity=_no_limit(limit.number("velocity", -1.0, allow_infinite=True)),
                stop_erp=stop.number("erp", defaults.stop_erp), stop_cfm=stop.number("cfm", defaults.stop_cfm),
                fudge_factor=solver.number("fudge_factor", None, 0.0),
                **{name: dynamics.number(name, 0.0) for name in _DYNAMICS})


def _no_limit(value: float) -> float:
    return -1.0 if math.isinf(value) else value


def named_end(node: Node, tag: str, model: str, known: Callable[[str], bool]) -> str:
    """Return the name of a joint's parent or child; empty where it has none.

    If a name is not ``known(name)``, the prefix of the joint's model is removed.

    Parameters
    ----------
    node : Node
        The joint.
    tag : str
        ``parent`` or ``child``.
    model : str
        Name of the model.
    known : callable
        ``known(name)`` returns whether the model has a link or frame of this name.

    Returns
    -------
    str
    """
    end = node.text(tag) or node.child(tag).text("link") or ""
    return end[len(model) + 2:] if end.startswith(model + "::") and not known(end) else end


def _end(node: Node, tag: str, links: Collection[str], model: str) -> str:
    """Return the name of a joint's parent or child; XmlError where it names no link."""
    end = named_end(node, tag, model, links.__contains__)
    if not end:
        node.fail("<{}> is missing".format(tag), "the name of a link there")
    if end not in links and end != "world":
        listed = sorted(links)
        fail(node.child(tag).element, '{} "{}" is no link of the model'.format(tag, end),
             "one of " + ", ".join(listed[:_MOST_NAMES]) + (", ..." if len(listed) > _MOST_NAMES else "")
             + (" or world" if tag == "parent" else ""))
    return end


def read_joint(node: Node, links: Mapping[str, Pose], frames: Frames, version: Tuple[int, ...],
               model: str = "") -> Optional[Joint]:
    """Read one ``<joint>``.

    Parameters
    ----------
    node : Node
    links : dict
        Link name -> pose in the model frame; nested links under scoped names.
    frames : Frames
        The model's frames, for ``relative_to`` and ``expressed_in``.
    version : tuple of int
        SDF version; up to 1.4 axes are given in the model frame.
    model : str
        Name of the model; link names may begin with it.

    Returns
    -------
    Joint or None
        None for a type that is not supported (a warning is added).

    Raises
    ------
    XmlError
        If type, parent or child are missing or name no link, or the axis has no length.
    """
    name, kind = node.name(), node.attribute("type")
    if kind == "continuous":
        kind = "revolute"
    if kind in _UNUSED_KINDS:
        node.ignore()
        node.notes.add('{}: joint "{}" of type {} is not supported; its links stay unconnected.'.format(
            node.line, name, kind))
        return None
    if kind not in _KINDS:
        node.fail('joint type is "{}"'.format(kind), "one of " + ", ".join(_KINDS))
    parent, child = _end(node, "parent", links, model), _end(node, "child", links, model)
    to_world = kind == "fixed" and child == "world" and parent != "world"
    if to_world:                # exchanged, this is the same joint; its place on the link does not matter
        parent, child = child, parent
    if child == parent:
        node.fail('parent and child are both "{}"'.format(child), "two different links")
    if child == "world":
        fail(node.child("child").element, "child is the world", "the moving link as child and the world as parent")
    pose = IDENTITY if to_world else frames.pose_in(node, child)
    model_from_joint = compose(links[child], pose)
    axis = _axis(node.child("axis"), node, model_from_joint, frames, version)
    second = node.child("axis2")
    axis2 = None
    if kind == "universal":
        axis2 = _axis(second, node, model_from_joint, frames, version)
    elif second:
        second.ignore()
        node.notes.add("{}: <axis2> of a {} joint ignored; expected it in a joint of type universal.".format(
            second.line, kind), ("unread", kind, "axis2"))
    node.done()
    return Joint(name=name, kind=kind, parent=parent, child=child, pose=pose, axis=axis, axis2=axis2)

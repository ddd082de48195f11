# SPDX-License-Identifier: BSD-3-Clause
"""``<joint>`` of SDF -> Joint, with the axis conventions of the SDF versions."""
from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Callable, Collection, List, Mapping, Sequence, Tuple

from m2wr_sim.geometry import IDENTITY, compose, rotate, rotate_inverse
from m2wr_sim.model.types import MIMIC_LIBRARY, SECOND_AXIS, Axis, Joint, PluginSpec
from m2wr_sim.model.xml.safe import fail

if TYPE_CHECKING:
    from m2wr_sim.geometry import Pose, Vector
    from m2wr_sim.model.sdf.frames import Frames
    from m2wr_sim.model.sdf.node import Node

NO_LIMIT = 1e16

_KINDS = ("revolute", "prismatic", "fixed", "ball", "universal", "screw")
_LEAST_PITCH, _GREATEST_PITCH = 1e-5, 100.0      # m for each rotation of a screw
_RIGHT = 0.02            # sine of the greatest error of a right angle between the axes of a revolute2 joint
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
               model: str = "") -> Tuple[Joint, List[PluginSpec]]:
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
    joint : Joint
    plugins : list of PluginSpec
        Those that it needs: of a screw, and of axes with ``<mimic>``.

    Raises
    ------
    XmlError
        If type, parent or child are missing or name no link, or the axis has no length.
    """
    name, kind = node.name(), node.attribute("type")
    if kind == "continuous":
        kind = "revolute"
    wheel, kind = kind == "revolute2", "universal" if kind == "revolute2" else kind
    if kind not in _KINDS:
        node.fail('joint type is "{}"'.format(kind), "one of " + ", ".join(_KINDS + ("revolute2", "gearbox")))
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
        if wheel:
            axis2 = _at_right_angles(node, axis, axis2)
    elif second:
        second.ignore()
        node.notes.add("{}: <axis2> of a {} joint ignored; expected it in a joint of type universal or "
                       "revolute2.".format(second.line, kind), ("unread", kind, "axis2"))
    pitch = _pitch(node) if kind == "screw" else 0.0
    joint = Joint(name=name, kind=kind, parent=parent, child=child, pose=pose, axis=axis, axis2=axis2, pitch=pitch)
    plugins = _couplings(node, joint)
    node.done()
    return joint, plugins


def _couplings(node: Node, joint: Joint) -> List[PluginSpec]:
    """Return the plugins that a joint needs: of a screw, and of axes with ``<mimic>``."""
    found = []
    if joint.kind == "screw":
        found.append(PluginSpec("screw_" + joint.name, "libm2wr_screw.so", (("joint", joint.name),), where=node.line))
    for tag, suffix in (("axis", ""), ("axis2", SECOND_AXIS)):
        mimic = node.child(tag).child("mimic")
        if not mimic:
            continue
        leader = mimic.attribute("joint")
        if not leader:
            mimic.fail("<mimic> without the attribute joint", "the name of the joint to follow")
        if mimic.attribute("axis") == "axis2":
            leader += SECOND_AXIS
        multiplier = mimic.number("multiplier", 1.0)
        offset = mimic.number("offset", 0.0) - multiplier * mimic.number("reference", 0.0)
        found.append(PluginSpec("mimic_" + joint.name + suffix, MIMIC_LIBRARY, (
            ("joint", leader), ("mimicJoint", joint.name + suffix), ("multiplier", repr(multiplier)),
            ("offset", repr(offset))), where=mimic.line))
    return found


def _pitch(node: Node) -> float:
    """Return the way of a screw along its axis by angle [m/rad]; a positive one has a right-handed thread.

    ``screw_thread_pitch`` is the way of a rotation [m]; the older ``thread_pitch`` is the angle by way [rad/m], and
    positive for a left-handed thread.
    """
    way, steepness = node.number("screw_thread_pitch", None), node.number("thread_pitch", 1.0)
    if way is None and steepness:
        way = -math.tau / steepness
    if way is None or not _LEAST_PITCH <= abs(way) <= _GREATEST_PITCH:
        node.fail("a screw with a pitch of {:g} m".format(way or 0.0), "{:g} to {:g} m for each rotation".format(
            _LEAST_PITCH, _GREATEST_PITCH))
    return way / math.tau


def _at_right_angles(node: Node, first: Axis, second: Axis) -> Axis:
    """Return the second axis of a revolute2 joint, turned to a right angle with the first one; its spring is rigid."""
    dot = sum(a * b for a, b in zip(first.xyz, second.xyz))
    if node.child("physics").child("ode").child("suspension"):
        node.notes.add('{}: the suspension of joint "{}" is rigid here.'.format(node.line, node.name()))
    if abs(dot) <= 1e-9:
        return second
    if abs(dot) > _RIGHT:
        node.notes.add('{}: the axes of joint "{}" are not at right angles; <axis2> is turned.'.format(
            node.line, node.name()))
    return replace(second, xyz=unit(node.element, [b - dot * a for a, b in zip(first.xyz, second.xyz)]))

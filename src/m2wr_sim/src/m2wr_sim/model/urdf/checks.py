# SPDX-License-Identifier: BSD-3-Clause
"""Checks a URDF document before it is converted, while line numbers are known.

The rules are those of urdfdom, which rejects the whole document at the first error, and a few more for the physics
(finite numbers).
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Collection, Dict, Iterable, Sequence, Set, Tuple

from m2wr_sim.model.xml.safe import fail, parse_float, parse_vector, path_of, place, required_name

if TYPE_CHECKING:
    from m2wr_sim.model.notes import Notes

JOINT_KINDS = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
SHAPES = ("box", "cylinder", "sphere", "mesh")

_INERTIA = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_NUMBERS: Dict[str, Dict[str, int]] = {   # tag -> attribute -> how many numbers
    "origin": {"xyz": 3, "rpy": 3}, "axis": {"xyz": 3}, "box": {"size": 3}, "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1}, "mesh": {"scale": 3}, "mass": {"value": 1}, "inertia": dict.fromkeys(_INERTIA, 1),
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1), "dynamics": {"damping": 1, "friction": 1},
    "mimic": {"multiplier": 1, "offset": 1}, "color": {"rgba": 4},
}
_REQUIRED = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("filename",),
             "mass": ("value",), "inertia": _INERTIA, "limit": ("effort", "velocity")}
_MOST_NAMES = 12        # of links in a message
_POSITIVE = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",)}


def attribute_numbers(element: Any, attribute: str, count: int) -> Tuple[float, ...]:
    """Return the ``count`` finite numbers in an attribute.

    Parameters
    ----------
    element : lxml element
    attribute : str
    count : int

    Returns
    -------
    tuple of float
    """
    what = "attribute " + attribute
    text = element.get(attribute)
    if count == 1:
        return (parse_float(element, text, what, element.tag == "limit"),)
    return parse_vector(element, text, count, what)


def _check_numbers(parent: Any) -> None:
    for element in parent.iter("*"):
        for attribute in _REQUIRED.get(element.tag, ()):
            if element.get(attribute) is None:
                known = "one" if element.tag != "limit" else "effort and velocity with every <limit>"
                fail(element, "attribute {} is missing".format(attribute), known)
        for attribute, count in _NUMBERS.get(element.tag, {}).items():
            if element.get(attribute) is None:
                continue
            attribute_numbers(element, attribute, count)


def check_size(shape: Any) -> None:
    """Raise XmlError unless a box, cylinder or sphere has an extent; a mesh may have any scale.

    It is not part of :func:`check_urdf`, because only such a shape is left out, not the robot.
    """
    for attribute in _POSITIVE.get(shape.tag, ()):
        values = attribute_numbers(shape, attribute, _NUMBERS[shape.tag][attribute])
        if min(values) <= 0.0:
            fail(shape, 'attribute {} is "{}"'.format(attribute, shape.get(attribute)),
                 "positive numbers" if len(values) > 1 else "a positive number")


def _check_inertial(link: Any) -> None:
    for inertial in link.findall("inertial"):
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        if mass is None:
            fail(inertial, "<mass> is missing", "<mass value=.../> there")
        if tensor is None:
            fail(inertial, "<inertia> is missing", "<inertia ixx=... ixy=... ixz=... iyy=... iyz=... izz=.../> there")


def _check_geometry(link: Any, notes: Notes) -> None:
    for tag in ("visual", "collision"):
        for part in link.findall(tag):
            geometry = part.find("geometry")
            expected = "one of {} in it".format(", ".join(SHAPES))
            if geometry is None:
                fail(part, "<geometry> is missing", expected)
            if len(geometry) == 0:
                fail(geometry, "<geometry> holds 0 elements", expected)
            if geometry[0].tag not in SHAPES:
                fail(geometry[0], 'unknown geometry "{}"'.format(geometry[0].tag), expected)
            for further in geometry[1:]:                # Gazebo's reader uses the first and ignores the others
                notes.add("{}: <{}> ignored; the first element of <geometry> is the shape{}.".format(
                    place(further), further.tag,
                    ", and a material belongs after </geometry>" if further.tag == "material" else ""))
                geometry.remove(further)


def _check_joint(joint: Any, links: Collection[str]) -> None:
    kind = (joint.get("type") or "").strip()
    if kind not in JOINT_KINDS:
        fail(joint, 'joint type is "{}"'.format(kind), "one of " + ", ".join(JOINT_KINDS))
    for tag in ("parent", "child"):
        end = joint.find(tag)
        if end is None or not end.get("link"):
            fail(joint if end is None else end, "the {} link is missing".format(tag), '<{} link="..."/>'.format(tag))
        if end.get("link") not in links:
            fail(end, '{} link "{}" is no link of the robot'.format(tag, end.get("link")),
                 "one of " + ", ".join(sorted(links)))
    if joint.find("parent").get("link") == joint.find("child").get("link"):
        fail(joint, 'parent and child are both "{}"'.format(joint.find("child").get("link")), "two different links")
    if kind in ("revolute", "prismatic") and joint.find("limit") is None:
        fail(joint, "<limit> is missing", "<limit lower=... upper=... effort=... velocity=.../> for a {} joint".format(
            kind))
    axis = joint.find("axis")
    if axis is not None and axis.get("xyz") is not None and kind not in ("fixed", "floating"):
        if math.hypot(*attribute_numbers(axis, "xyz", 3)) < 1e-9:
            fail(axis, 'the axis "{}" has no length'.format(axis.get("xyz")), "a direction such as 0 0 1")


def _unique(elements: Iterable[Any], kind: str) -> Dict[str, Any]:
    found: Dict[str, Any] = {}
    for element in elements:
        name = required_name(element)
        if name in found:
            fail(element, 'there is another {} "{}" in line {}'.format(kind, name, found[name].sourceline),
                 "a name of its own for every {}".format(kind))
        found[name] = element
    return found


def some_names(names: Sequence[str]) -> str:
    """Return names as a text for a message; of many names only the first ones."""
    return ", ".join(names[:_MOST_NAMES]) + (", ..." if len(names) > _MOST_NAMES else "")


def _check_tree(root: Any, links: Dict[str, Any], joints: Dict[str, Any]) -> str:
    """Return the name of the root link; raise XmlError unless links and joints form one tree."""
    parent_joint: Dict[str, Any] = {}
    for joint in joints.values():
        child = joint.find("child").get("link")
        if child in parent_joint:
            fail(joint, 'link "{}" is already the child of joint "{}"'.format(child, parent_joint[child].get("name")),
                 "one parent for every link")
        parent_joint[child] = joint
    roots = [name for name in links if name not in parent_joint]
    if len(roots) != 1:
        fail(root, "there is no root link, the joints form a ring" if not roots else
             "there are {} root links ({})".format(len(roots), some_names(roots)), "one link that is no joint's child")
    safe: Set[str] = set()              # links from which the root is reached
    for name in links:
        seen = {name}
        while name in parent_joint and name not in safe:
            name = parent_joint[name].find("parent").get("link")
            if name in seen:
                fail(parent_joint[name], "the joints form a ring through {}".format(some_names(sorted(seen))),
                     "a tree of links")
            seen.add(name)
        safe |= seen
    return roots[0]


def check_urdf(root: Any, notes: Notes) -> Tuple[Dict[str, Any], Dict[str, Any], str]:
    """Check a parsed URDF document.

    Parameters
    ----------
    root : lxml element
        The document's root; elements after the shape in a ``<geometry>`` are removed.
    notes : Notes
        Gets warnings about them.

    Returns
    -------
    links, joints : dict
        Name -> element, in document order.
    root_link : str
        Name of the one link without a parent.

    Raises
    ------
    XmlError
        With file, line, element, what was found and what was expected.
    """
    if root.tag != "robot":
        fail(root, "entity format is invalid: the root element is <{}>".format(path_of(root)), "<robot> for a URDF")
    required_name(root)
    links, joints = _unique(root.findall("link"), "link"), _unique(root.findall("joint"), "joint")
    if not links:
        fail(root, "the robot has no link", "at least one <link>")
    for link in links.values():
        _check_geometry(link, notes)
        _check_numbers(link)
        _check_inertial(link)
    for joint in joints.values():
        _check_joint(joint, links)
        _check_numbers(joint)
    for material in root.findall("material"):
        _check_numbers(material)
    return links, joints, _check_tree(root, links, joints)

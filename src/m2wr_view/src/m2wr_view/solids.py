# SPDX-License-Identifier: BSD-3-Clause
"""Obstacles of a world and shape of a robot from above, read from markers and from a robot description."""
from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.errors import ViewError
from m2wr_view.frames import matrix_from_rpy, rotation_of
from m2wr_view.outlines import FLOOR, ROBOT_HEIGHT, box_outline, cylinder_outline, sphere_outline, triangle_outlines

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray
    from m2wr_view.outlines import Outline

_HIGH = float("inf")
_CUBE, _SPHERE, _CYLINDER, _CUBES, _SPHERES, _TRIANGLES = 1, 2, 3, 6, 7, 11     # of visualization_msgs/Marker
_DELETE, _DELETE_ALL = 2, 3


class Robot(NamedTuple):
    """``footprint``: outlines in the root link's frame; ``mounts``: {link: transform (4, 4) to the root link}."""

    footprint: List[Outline]
    mounts: Dict[str, FloatArray]
    root: str


class Ground(NamedTuple):
    """Triangles from above: ``corners`` (n, 3, 2) in world [m], the lowest first; ``colours`` (n, 3), 0 to 1."""

    corners: FloatArray
    colours: FloatArray


def ground_of(marker: Any) -> Optional[Ground]:
    """Return the ground of a marker; None for one that is no list of triangles."""
    count = len(marker.points) // 3
    if marker.type != _TRIANGLES or marker.action != 0 or not count:
        return None
    place, turn, plain = marker.pose.position, marker.pose.orientation, marker.color
    corners = np.array([(point.x, point.y, point.z) for point in marker.points[:3 * count]], dtype=float)
    corners = corners * (marker.scale.x, marker.scale.y, marker.scale.z)
    corners = corners.dot(rotation_of((turn.x, turn.y, turn.z, turn.w)).T) + (place.x, place.y, place.z)
    colours = np.array([(colour.r, colour.g, colour.b) for colour in marker.colors] if len(marker.colors) >= 3 * count
                       else [(plain.r, plain.g, plain.b)] * (3 * count), dtype=float)[:3 * count]
    if not np.all(np.isfinite(corners)):
        return None
    corners, colours = corners.reshape(-1, 3, 3), colours.reshape(-1, 3, 3).mean(axis=1)
    order = np.argsort(corners[..., 2].max(axis=1), kind="stable")
    return Ground(corners[order][..., :2], np.clip(colours[order], 0.0, 1.0))


class Solids:
    """The shapes of all markers, as outlines.

    Attributes
    ----------
    blocking, hanging : list of Outline
        Shapes between the floor and the robot's top, and shapes that are only above it.
    """

    def __init__(self) -> None:
        #: {(ns, id): (content, outlines at the robot's height, outlines at any height)}
        self._shapes: Dict[Tuple[str, int], Tuple[object, List[Outline], List[Outline]]] = {}
        self.blocking: List[Outline] = []
        self.hanging: List[Outline] = []

    def update(self, markers: Iterable[Any]) -> None:
        """Update from a sequence of markers, as rviz does: add, modify, delete, delete all.

        All markers are published when one of them moves; outlines of unchanged markers are kept.
        """
        before = self._shapes.copy()
        for marker in markers:
            if marker.action == _DELETE_ALL:
                self._shapes = {}
            elif marker.action == _DELETE:
                self._shapes.pop((marker.ns, marker.id), None)
            else:
                name, content = (marker.ns, marker.id), _content(marker)
                known = before.get(name)
                self._shapes[name] = known if known is not None and known[0] == content else (
                    content,) + marker_outlines(marker)
        self.blocking = [outline for _, low, _ in self._shapes.values() for outline in low]
        self.hanging = [outline for _, low, high in self._shapes.values() if not low for outline in high]


def _content(marker: Any) -> Tuple[object, ...]:
    """Return all of a marker that its outlines depend on."""
    place, turn, scale = marker.pose.position, marker.pose.orientation, marker.scale
    return (marker.type, place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w, scale.x, scale.y, scale.z,
            [(point.x, point.y, point.z) for point in marker.points])


def marker_outlines(marker: Any) -> Tuple[List[Outline], List[Outline]]:
    """Return the outlines (at the robot's height, at any height) of a marker; kinds without a volume have none."""
    place, turn = marker.pose.position, marker.pose.orientation
    centre = np.array((place.x, place.y, place.z))
    rotation, name = rotation_of((turn.x, turn.y, turn.z, turn.w)), marker.ns
    scale = np.array((marker.scale.x, marker.scale.y, marker.scale.z))
    centres = [centre + rotation.dot((point.x, point.y, point.z)) for point in marker.points] \
        if marker.type in (_CUBES, _SPHERES) else [centre]

    def within(low: float, high: float) -> List[Outline]:
        found: Sequence[Optional[Outline]]
        if marker.type in (_CUBE, _CUBES):
            found = [box_outline(scale, middle, rotation, low, high, name) for middle in centres]
        elif marker.type in (_SPHERE, _SPHERES):
            found = [sphere_outline(0.5 * scale[0], middle, low, high, name) for middle in centres]
        elif marker.type == _CYLINDER:
            found = [cylinder_outline(0.5 * scale[0], scale[2], centre, rotation, low, high, name)]
        elif marker.type == _TRIANGLES:
            corners = np.array([(point.x, point.y, point.z) for point in marker.points]).reshape(-1, 3, 3) * scale
            found = triangle_outlines(corners.dot(rotation.T) + centre, low, high, name)
        else:
            found = []
        return [outline for outline in found if outline is not None]

    return within(FLOOR, ROBOT_HEIGHT), within(FLOOR, _HIGH)


def read_numbers(text: Optional[str], count: int, default: Sequence[float]) -> Tuple[float, ...]:
    """Return the numbers of a URDF attribute.

    Parameters
    ----------
    text : str or None
        Numbers separated by blanks.
    count : int
        How many there must be.
    default : sequence of float
        Returned where there is another number of them, or one is not finite.

    Raises
    ------
    ValueError
        If a word is no number.
    """
    values = tuple(float(word) for word in (text or "").split())
    return values if len(values) == count and np.all(np.isfinite(values)) else tuple(default)


def read_origin(element: ElementTree.Element) -> FloatArray:
    """Return the transform (4, 4) of a URDF element's ``<origin>``; the identity where there is none."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    return matrix_from_rpy(read_numbers(origin.get("xyz"), 3, (0, 0, 0)),
                           read_numbers(origin.get("rpy"), 3, (0, 0, 0)))


def _seen(shape: ElementTree.Element, matrix: FloatArray, name: str) -> Optional[Outline]:
    """Return the outline of a URDF shape whose frame is at ``matrix``, or None for one that is not drawn."""
    centre, rotation = matrix[:3, 3], matrix[:3, :3]
    limits = (-_HIGH, _HIGH, name)
    if shape.tag == "box":
        return box_outline(np.array(read_numbers(shape.get("size"), 3, (0, 0, 0))), centre, rotation, *limits)
    if shape.tag == "sphere":
        return sphere_outline(float(shape.get("radius", 0.0)), centre, *limits)
    if shape.tag == "cylinder":
        return cylinder_outline(float(shape.get("radius", 0.0)), float(shape.get("length", 0.0)), centre, rotation,
                                *limits)
    return None


def _name_of(link: ElementTree.Element) -> str:
    name = link.get("name")
    if name is None:
        raise ViewError("robot_description: a <link> has no name; expected a name for each link")
    return name


def _joints(robot: ElementTree.Element) -> Dict[str, Tuple[str, ElementTree.Element]]:
    """Return {child link: (parent link, joint)} of the joints that name both."""
    found = {}
    for joint in robot.findall("joint"):
        names = [end.get("link") for end in (joint.find("parent"), joint.find("child")) if end is not None]
        if len(names) == 2 and names[0] is not None and names[1] is not None:
            found[names[1]] = names[0], joint
    return found


def read_robot(text: str) -> Robot:
    """Return the :class:`Robot` of a URDF; collisions and visuals count, meshes are ignored, joints are at 0.

    Raises
    ------
    ViewError
        If the text is no URDF.
    """
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ViewError("robot_description: %s; expected a URDF, after xacro" % error) from error
    links = {_name_of(link): link for link in robot.findall("link")}
    joints = _joints(robot)
    roots = [name for name in links if name not in joints]
    if robot.tag != "robot" or not roots:
        raise ViewError("robot_description: the element is <%s> with %d links; expected a URDF <robot> with a root link"
                        % (robot.tag, len(links)))
    mounts: Dict[str, FloatArray] = {}
    footprint: List[Outline] = []
    for name in links:
        matrix, at = np.eye(4), name
        for _ in links:                     # ends also if joints form a loop
            if at not in joints:
                break
            at, joint = joints[at]
            matrix = read_origin(joint).dot(matrix)
        mounts[name] = matrix
    try:
        for name, link in links.items():
            for part in link.findall("collision") + link.findall("visual"):
                outlines = [_seen(shape, mounts[name].dot(read_origin(part)), name)
                            for shape in part.findall("geometry/*")]
                footprint += [outline for outline in outlines if outline is not None]
    except ValueError as error:
        raise ViewError("robot_description: %s; expected numbers in origins and shapes" % error) from error
    return Robot(footprint, mounts, roots[0])

# SPDX-License-Identifier: BSD-3-Clause
"""What a robot looks like: the visuals of a URDF by link, and how its links are joined."""
from __future__ import annotations

import logging
import math
import os
import re
import xml.etree.ElementTree as ElementTree
from typing import TYPE_CHECKING, Any, Callable, Dict, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np
import trimesh

from m2wr_live.scene.shapes import Geometry, Shape, placed, shapes_of
from m2wr_view.errors import ViewError
from m2wr_view.solids import read_numbers, read_origin

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray

log = logging.getLogger("m2wr_live")

LARGEST_TEXT = 8388608      # characters of a description, as the simulator's services accept
LARGEST_MESH = 1 << 26      # bytes of a mesh file; larger ones would take a browser minutes
MOST_FACES = 200000         # of one mesh
_UNIT = re.compile(rb"<unit\b[^>]*\bmeter\s*=\s*[\"']\s*([0-9.eE+-]+)")
_HEAD = 1 << 16             # bytes of a COLLADA file in which its unit is
MESH_RESOURCE = 10          # of visualization_msgs/Marker
_GREY = (0.6, 0.6, 0.6, 1.0)
#: Colours of Gazebo's materials that descriptions use.
GAZEBO = {"black": (0.0, 0.0, 0.0), "blue": (0.0, 0.0, 1.0), "green": (0.0, 1.0, 0.0), "grey": (0.7, 0.7, 0.7),
          "darkgrey": (0.175, 0.175, 0.175), "orange": (1.0, 0.5, 0.0), "purple": (1.0, 0.0, 1.0),
          "red": (1.0, 0.0, 0.0), "turquoise": (0.0, 1.0, 1.0), "white": (1.0, 1.0, 1.0), "yellow": (1.0, 1.0, 0.0)}
#: Returns the path of a mesh that a description names, or None.
FindMesh = Callable[[str], Optional[str]]


class Mount(NamedTuple):
    """``parent`` link of a link, ``origin`` (4, 4) in it at joint position 0, and whether the joint is ``fixed``."""

    parent: str
    origin: FloatArray
    fixed: bool


class RobotModel(NamedTuple):
    """A robot's looks.

    Attributes
    ----------
    name, root : str
        Of the robot and of its root link.
    mounts : dict of str to Mount
        By link; the root link has none.
    shapes : list of Shape
        Their owner is a link, their pose is in its frame.
    geometries : dict of str to Geometry
        The meshes among them.
    problems : list of str
        Visuals that are left out, with the reason.
    """

    name: str
    root: str
    mounts: Dict[str, Mount]
    shapes: List[Shape]
    geometries: Dict[str, Geometry]
    problems: List[str]

    @property
    def links(self) -> List[str]:
        """Names of all links, parents before their children."""
        return [self.root] + list(self.mounts)


def load_mesh(path: str, own_colours: bool = False) -> Geometry:
    """Return the triangles of a mesh file.

    Parameters
    ----------
    path : str
    own_colours : bool
        With the colours and textures of the file, if it has any.

    Raises
    ------
    ViewError
        If it cannot be read or is too large.
    """
    try:
        size = os.path.getsize(path)
        if size > LARGEST_MESH:
            raise ViewError("mesh %s: it has %d bytes; expected at most %d" % (path, size, LARGEST_MESH))
        scene = trimesh.load(path, force="scene")
        if path.lower().endswith(".dae"):
            scene.apply_scale(_unit(path))
        mesh = scene.to_mesh()
        vertices, faces = np.asarray(mesh.vertices, dtype=float), np.asarray(mesh.faces, dtype=np.uint32)
    except ViewError:
        raise
    except Exception as error:      # readers of meshes raise errors of any kind
        raise ViewError("mesh %s: it cannot be read (%s: %s)" % (path, type(error).__name__, error)) from error
    if not len(faces) or len(faces) > MOST_FACES or not np.all(np.isfinite(vertices)):
        raise ViewError("mesh %s: it has %d triangles; expected 1 to %d, with finite corners"
                        % (path, len(faces), MOST_FACES))
    return Geometry(vertices, faces, coloured=_coloured(scene) if own_colours else b"")


def _unit(path: str) -> float:
    """Return the unit of a COLLADA file [m], which trimesh leaves to its caller."""
    with open(path, "rb") as stream:
        found = _UNIT.search(stream.read(_HEAD))
    size = float(found.group(1)) if found else 1.0
    return size if 0.0 < size < math.inf else 1.0


def _matt(material: Any) -> Any:
    """Return a material without a metallic sheen, which is black where there is no environment map to be reflected."""
    found = material.to_pbr() if hasattr(material, "to_pbr") else material
    found.metallicFactor, found.roughnessFactor, found.metallicRoughnessTexture = 0.0, 1.0, None
    return found


def _coloured(scene: trimesh.Scene) -> bytes:
    """Return a scene with its colours as binary glTF; empty if it has none, or is too large with its textures."""
    if not any(getattr(part.visual, "kind", None) for part in scene.geometry.values()):
        return b""
    try:
        for part in scene.geometry.values():
            if getattr(part.visual, "kind", None) == "texture":
                part.visual.material = _matt(part.visual.material)
        content: bytes = scene.export(file_type="glb")
    except Exception as error:      # a texture may be of any kind; the mesh is shown in one colour
        log.debug("mesh: its colours cannot be used (%s: %s)", type(error).__name__, error)
        return b""
    return content if len(content) <= LARGEST_MESH else b""


class _Reader:
    """Reads one description; the meshes found are kept by their URI."""

    def __init__(self, robot: ElementTree.Element, find_mesh: FindMesh) -> None:
        self._robot, self._find = robot, find_mesh
        self.geometries: Dict[str, Geometry] = {}
        self.problems: List[str] = []
        self._colours = {material.get("name"): self._rgba(material) for material in robot.iter("material")
                         if material.find("color") is not None}
        self._gazebo = {entry.get("reference"): (entry.findtext("material") or "").strip()
                        for entry in robot.findall("gazebo") if entry.find("material") is not None}

    @staticmethod
    def _rgba(material: ElementTree.Element) -> Tuple[float, ...]:
        colour = material.find("color")
        return read_numbers(None if colour is None else colour.get("rgba"), 4, _GREY)

    def _colour(self, link: str, visual: ElementTree.Element) -> Optional[Tuple[float, ...]]:
        """Return the colour of a visual: its own, that of the named material, or that of Gazebo's material, or None."""
        material = visual.find("material")
        if material is not None:
            if material.find("color") is not None:
                return self._rgba(material)
            if material.get("name") in self._colours:
                return self._colours[material.get("name")]
        known = GAZEBO.get(self._gazebo.get(link, "").rsplit("/", 1)[-1].lower())
        return None if known is None else known + (1.0,)

    def shape(self, link: str, visual: ElementTree.Element) -> Optional[Shape]:
        """Return the shape of a visual, or None and a line in ``problems``."""
        pose, colour = read_origin(visual), self._colour(link, visual)
        red, green, blue, opacity = colour or _GREY
        rgba = (red, green, blue, opacity)
        for element in visual.findall("geometry/*"):
            if element.tag == "box":
                x, y, z = read_numbers(element.get("size"), 3, (0, 0, 0))
                return Shape("box", pose, (x, y, z), rgba, link)
            if element.tag in ("sphere", "cylinder"):
                width = 2.0 * float(element.get("radius", 0.0))
                length = width if element.tag == "sphere" else float(element.get("length", 0.0))
                return Shape(element.tag, pose, (width, width, length), rgba, link)
            if element.tag == "mesh":
                key = self._mesh(link, element.get("filename") or "", colour is None)
                x, y, z = read_numbers(element.get("scale"), 3, (1, 1, 1))
                return None if key is None else Shape(key, pose, (x, y, z), rgba, link)
        return None

    def _mesh(self, link: str, uri: str, own_colours: bool) -> Optional[str]:
        try:
            return add_mesh(self.geometries, uri, link, self._find, own_colours)
        except ViewError as error:
            self.problems.append(str(error))
            return None


def add_mesh(geometries: Dict[str, Geometry], uri: str, link: str, find_mesh: FindMesh, own_colours: bool) -> str:
    """Read a mesh if it is not known yet; return its key.

    Parameters
    ----------
    geometries : dict of str to Geometry
        The mesh is added to them.
    uri, link : str
        Of the mesh, and of the link that has it.
    find_mesh : callable
        URI of a mesh -> path of its file, or None.
    own_colours : bool
        With the colours of the file.

    Returns
    -------
    str

    Raises
    ------
    ViewError
        If there is no such file, or it cannot be read.
    """
    key = ("own_" if own_colours else "mesh_") + uri
    if key not in geometries:
        path = find_mesh(uri)
        if path is None:
            raise ViewError("mesh %s of link %s: no such file" % (uri, link))
        geometries[key] = load_mesh(path, own_colours)
    return key


def read_robot_model(text: str, find_mesh: FindMesh) -> RobotModel:
    """Return the looks of a URDF.

    Parameters
    ----------
    text : str
        The URDF, after xacro.
    find_mesh : callable
        URI of a mesh -> path of its file, or None.

    Raises
    ------
    ViewError
        If it is no URDF.
    """
    if len(text) > LARGEST_TEXT:
        raise ViewError("robot_description: it has %d characters; expected at most %d" % (len(text), LARGEST_TEXT))
    try:
        robot = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise ViewError("robot_description: %s; expected a URDF, after xacro" % error) from error
    names = [link.get("name") for link in robot.findall("link")]
    try:
        joints = _mounts(robot)
        roots = [name for name in names if name and name not in joints]
        if robot.tag != "robot" or not roots:
            raise ViewError("robot_description: the element is <%s> with %d links; expected a URDF <robot> with a root "
                            "link" % (robot.tag, len(names)))
        reader = _Reader(robot, find_mesh)
        shapes = [shape for link in robot.findall("link") for visual in link.findall("visual")
                  for shape in [reader.shape(link.get("name") or "", visual)] if shape is not None]
    except ValueError as error:
        raise ViewError("robot_description: %s; expected numbers in origins and shapes" % error) from error
    return RobotModel(robot.get("name") or "robot", roots[0], _sorted_mounts(roots[0], joints), shapes,
                      reader.geometries, reader.problems)


def _mounts(robot: ElementTree.Element) -> Dict[str, Mount]:
    found = {}
    for joint in robot.findall("joint"):
        parent, child = joint.find("parent"), joint.find("child")
        ends = [end.get("link") for end in (parent, child) if end is not None]
        if len(ends) == 2 and ends[0] and ends[1]:
            found[ends[1]] = Mount(ends[0], read_origin(joint), joint.get("type") == "fixed")
    return found


def _sorted_mounts(root: str, mounts: Dict[str, Mount]) -> Dict[str, Mount]:
    """Return the mounts of all links below the root, parents first; links in a loop are left out."""
    children: Dict[str, List[str]] = {}
    for name, mount in mounts.items():
        children.setdefault(mount.parent, []).append(name)
    found, waiting = {}, [root]
    while waiting:
        for child in children.pop(waiting.pop(0), []):
            found[child] = mounts[child]
            waiting.append(child)
    return found


def read_looks(name: str, markers: Sequence[Any], find_mesh: FindMesh) -> RobotModel:
    """Return the looks of a robot from its markers.

    Parameters
    ----------
    name : str
        Of the robot.
    markers : sequence of visualization_msgs.msg.Marker
        Each in a frame ``robot::link``; others are left out.
    find_mesh : callable
        URI of a mesh -> path of its file, or None.
    """
    scope = name + "::"
    owned = [(marker.header.frame_id[len(scope):], marker) for marker in markers
             if marker.header.frame_id.startswith(scope)]
    root = owned[0][0] if owned else ""
    mounts = {link: Mount(root, np.eye(4), False) for link, _ in owned if link != root}
    model = RobotModel(name, root, mounts, [], {}, [])
    for link, marker in owned:
        if marker.type == MESH_RESOURCE:
            shape = _mesh_of(marker, link, model, find_mesh)
            model.shapes.extend([] if shape is None else [shape])
        else:
            shapes, geometries = shapes_of(marker)
            model.geometries.update(geometries)
            model.shapes.extend(shape._replace(owner=link) for shape in shapes)
    return model


def _mesh_of(marker: Any, link: str, model: RobotModel, find_mesh: FindMesh) -> Optional[Shape]:
    """Return the shape of a marker with a mesh, or None and a line in the problems of the model."""
    base = placed(marker)
    try:
        key = add_mesh(model.geometries, marker.mesh_resource, link, find_mesh, marker.mesh_use_embedded_materials)
    except ViewError as error:
        model.problems.append(str(error))
        return None
    return None if base is None else base._replace(geometry=key, owner=link)

# SPDX-License-Identifier: BSD-3-Clause
"""Reads mesh files (.stl, .obj, .dae) as triangles in metres, z up; independent of URDF and SDF.

The formats are read by trimesh and pycollada, which are imported with the first mesh.
"""
from __future__ import annotations

import io
import logging
import os
import re
import stat
import warnings
from collections import OrderedDict, namedtuple
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Tuple

import numpy as np
from lxml import etree

from m2wr_sim.model.source_files import note_file
from m2wr_sim.model.xml.safe import XmlError, parse_xml, shorten

if TYPE_CHECKING:
    from numpy.typing import NDArray

    #: Names, vertices, triangles.
    _Part = Tuple[Tuple[str, ...], NDArray[Any], NDArray[Any]]

log = logging.getLogger(__name__)

MAX_TRIANGLES = 2000000
MAX_MESH_BYTES = 512 * 1024 * 1024
FARTHEST_VERTEX = 1e6           # m
_SLOW_BYTES = 8 * 1024 * 1024   # for larger files a log message is written
_KEPT_FILES = 64
_FORMATS = (".stl", ".obj", ".dae")

MeshPart = namedtuple("MeshPart", "names vertices triangles")
"""One part of a mesh file: its names, vertices (n, 3) [m], triangles (m, 3) int32."""

# (path, size, time of change) -> parts; many models share files
_files: OrderedDict[Tuple[str, int, int], Tuple[MeshPart, ...]] = OrderedDict()


def read_mesh_file(path: str) -> Tuple[MeshPart, ...]:
    """Read a mesh file.

    Parameters
    ----------
    path : str
        A file called ``.stl`` (text or binary), ``.obj`` or ``.dae``.  STL and OBJ are taken as metres with z up; the
        unit, the up axis and the node transforms of a COLLADA file are applied.

    Returns
    -------
    tuple of MeshPart
        At least one; triangles without area are left out, numbers are finite.

    Raises
    ------
    XmlError
        If the file is missing, of another kind, too large, broken or holds no triangle.
    """
    kind = os.path.splitext(path)[1].lower()
    if kind not in _FORMATS:
        raise XmlError("{}: mesh format is not supported; expected one of {}".format(path, ", ".join(_FORMATS)))
    note_file(path)
    try:
        status = os.stat(path)
        key = (os.path.realpath(path), status.st_size, status.st_mtime_ns)
        if key in _files:
            _files.move_to_end(key)
            return _files[key]
        if not stat.S_ISREG(status.st_mode):        # a pipe would make the reader wait, a device never end
            raise XmlError("{}: is no regular file; expected a mesh file".format(path))
        if status.st_size > MAX_MESH_BYTES:
            raise XmlError("{}: the file has {} MB; expected at most {} MB".format(
                path, status.st_size // 2 ** 20, MAX_MESH_BYTES // 2 ** 20))
        if status.st_size > _SLOW_BYTES:
            log.info("reading the mesh %s (%d MB)", path, status.st_size // 2 ** 20)
        with open(path, "rb") as stream:
            content = stream.read()
    except (OSError, ValueError) as error:
        raise XmlError("{}: cannot be read: {}; expected a mesh file".format(
            shorten(path, 300), getattr(error, "strerror", None) or error)) from None
    parts = _checked(path, _read_collada(content, path) if kind == ".dae" else _read_plain(content, path, kind[1:]))
    if status.st_size > _SLOW_BYTES:
        log.info("%s: %d triangles", path, sum(len(part.triangles) for part in parts))
    _files[key] = parts
    while len(_files) > _KEPT_FILES:
        _files.popitem(last=False)
    return parts


def _checked(path: str, parts: Iterable[Tuple[Iterable[str], Any, Any]]) -> Tuple[MeshPart, ...]:
    """Return the parts with triangles that have an area; raise XmlError if there are none or a number is invalid."""
    kept: List[MeshPart] = []
    count = 0
    for names, vertices, triangles in parts:
        vertices = _rows_of_three(vertices, np.float64, path, "vertices", "three coordinates")
        triangles = _rows_of_three(triangles, np.int64, path, "faces", "three corners")
        if triangles.size and (triangles.min() < 0 or triangles.max() >= len(vertices)):
            raise XmlError("{}: a triangle names vertex {}, but there are {}; expected a mesh that is whole".format(
                path, int(triangles.max()), len(vertices)))
        used = vertices[triangles]
        if not np.all(np.abs(used) <= FARTHEST_VERTEX):
            raise XmlError("{}: a vertex lies at {}; expected finite numbers of at most {:g} m".format(
                path, used[~(np.abs(used) <= FARTHEST_VERTEX)][0], FARTHEST_VERTEX))
        triangles = triangles[has_area(used)]
        count += len(triangles)
        if len(triangles):
            kept.append(MeshPart(tuple(names), vertices, triangles.astype(np.int32)))
    if not kept:
        raise XmlError("{}: there is no triangle in it; expected a mesh".format(path))
    if count > MAX_TRIANGLES:
        raise XmlError("{}: the mesh has {} triangles; expected at most {}".format(path, count, MAX_TRIANGLES))
    return tuple(kept)


def _rows_of_three(rows: Any, kind: type, path: str, what: str, expected: str) -> NDArray[Any]:
    """Return an array (n, 3); raise XmlError if a file has rows of another length."""
    rows = np.ascontiguousarray(rows, dtype=kind)
    if rows.size and (rows.ndim != 2 or rows.shape[1] != 3):
        raise XmlError("{}: {} of the shape {}; expected {} each".format(path, what, rows.shape, expected))
    return rows.reshape(-1, 3)


def has_area(corners: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which of the triangles (m, 3 corners, 3) have an area, and so a normal."""
    one, two = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    three = two - one
    longest = np.maximum(np.maximum((one * one).sum(axis=1), (two * two).sum(axis=1)), (three * three).sum(axis=1))
    normal = np.cross(one, two)
    return np.sqrt((normal * normal).sum(axis=1)) > 1e-12 * longest


def _read_plain(content: bytes, path: str, kind: str) -> List[_Part]:
    """Return [(names, vertices, triangles)] of an STL or OBJ file."""
    trimesh = _trimesh(path)
    options: Dict[str, bool] = dict(process=False)
    if kind == "obj":
        options.update(split_object=True, group_material=False, skip_materials=True, maintain_order=True)
    if kind == "obj" or _is_text_stl(content):
        content = _as_utf8(content)
    elif len(content) >= 84:
        content = _whole_binary_stl(content, path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")     # about textures, which are not used
            loaded = trimesh.load(io.BytesIO(content), file_type=kind, **options)
        geometries = getattr(loaded, "geometry", None)
        meshes = [("", loaded)] if geometries is None else sorted(geometries.items())
        return [((name,), mesh.vertices, mesh.faces) for name, mesh in meshes if hasattr(mesh, "faces")]
    except Exception as error:      # any error of the parser in a broken file
        raise XmlError("{}: cannot be read as {}: {}; expected a whole mesh file".format(
            path, kind.upper(), shorten(str(error) or repr(error), 200))) from None


def _is_text_stl(content: bytes) -> bool:
    """Return whether an STL is text; the header of a binary one may begin with "solid", too."""
    begin = content[:4000].lower()
    return begin.lstrip().startswith(b"solid") and (b"facet" in begin or b"endsolid" in begin)


def _as_utf8(content: bytes) -> bytes:
    """Return a text as UTF-8; names and comments in it may be in any encoding."""
    try:
        content.decode("utf-8")
        return content
    except UnicodeDecodeError:
        return content.decode("latin-1").encode("utf-8")


def _whole_binary_stl(content: bytes, path: str) -> bytes:
    """Return header and triangles of a binary STL, without the bytes after them."""
    stated = int.from_bytes(content[80:84], "little")
    if stated * 50 + 84 > len(content):
        raise XmlError("{}: the header states {} triangles, which would take {} bytes, but the file has {}; expected a "
                       "whole STL file".format(path, stated, stated * 50 + 84, len(content)))
    if not stated:
        raise XmlError("{}: the header states 0 triangles; expected a whole STL file".format(path))
    return content[:stated * 50 + 84]


_NO_SHAPES = ("library_materials", "library_effects", "library_images", "library_cameras", "library_lights",
              "library_animations", "bind_material", "instance_camera", "instance_light", "extra")
_SCHEMA = b'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"'


def _shapes_of_collada(content: bytes, path: str) -> bytes:
    """Return a COLLADA file without colours, pictures, cameras and lights, where references often lead nowhere."""
    root = parse_xml(content, path)
    if etree.QName(root).localname != "COLLADA":
        raise XmlError("{}: the root element is <{}>; expected <COLLADA>".format(path, etree.QName(root).localname))
    for element in list(root.iter(*_NO_SHAPES)):
        if element.getparent() is not None:
            element.getparent().remove(element)
    text = etree.tostring(root)
    begin, end, rest = text.partition(b">")
    return _SCHEMA + re.sub(br"""^<[^\s>]*|\sxmlns=("[^"]*"|'[^']*')""", b"", begin) + end + rest


def _read_collada(content: bytes, path: str) -> List[_Part]:
    """Return [(names, vertices, triangles)] of a COLLADA file, one for each instance of a geometry."""
    content = _shapes_of_collada(content, path)
    collada = _collada(path)
    try:
        document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeError])
        # Gazebo's loader reads the unit and ignores <up_axis>
        to_metres = np.diag([float(document.assetInfo.unitmeter or 1.0)] * 3 + [1.0])
        found: List[_Part] = []
        scene = document.scene or (document.scenes[0] if len(document.scenes) else None)
        if scene is None:
            for geometry in document.geometries:
                found.extend(_collada_parts(geometry, to_metres, ()))
        else:
            for node in scene.nodes:
                _walk(collada, node, to_metres, (), found)
        if not found and document.errors:
            raise ValueError(document.errors[0])
        return found
    except Exception as error:      # any error of the parser in a broken file
        raise XmlError("{}: cannot be read as COLLADA: {}; expected a whole mesh file".format(
            path, shorten(str(error) or repr(error), 200))) from None


def _walk(collada: Any, node: Any, matrix: NDArray[np.float64], names: Tuple[str, ...], found: List[_Part]) -> None:
    """Collect the geometries below a node; ``matrix`` (4, 4) takes its parent's coordinates to metres."""
    if isinstance(node, collada.scene.GeometryNode):
        found.extend(_collada_parts(node.geometry, matrix, names))
    elif isinstance(node, collada.scene.ControllerNode):
        found.extend(_collada_parts(node.controller.geometry, matrix, names))
    elif isinstance(node, collada.scene.NodeNode):
        _walk(collada, node.node, matrix @ node.matrix, names, found)
    elif isinstance(node, collada.scene.Node):
        own = tuple(name for name in (node.xmlnode.get("name"), node.xmlnode.get("id")) if name)
        for child in node.children:
            _walk(collada, child, matrix @ node.matrix, own or names, found)


def _collada_parts(geometry: Any, matrix: NDArray[np.float64], names: Tuple[str, ...]) -> List[_Part]:
    names = names + tuple(name for name in (geometry.name, geometry.id) if name)
    parts = []
    for primitive in geometry.primitives:
        triangles = primitive if hasattr(primitive, "ntriangles") else getattr(primitive, "triangleset", lambda: None)()
        if triangles is None or not triangles.ntriangles:
            continue        # lines and points
        index = np.array(triangles.vertex_index)
        if np.linalg.det(matrix[:3, :3]) < 0.0:     # a mirror turns the faces inside out
            index = index[:, ::-1]
        parts.append((names, np.asarray(triangles.vertex) @ matrix[:3, :3].T + matrix[:3, 3], index))
    return parts


def _trimesh(path: str) -> Any:
    try:
        import trimesh
    except ImportError as error:
        raise XmlError("{}: {}; expected the Python package trimesh, which reads it".format(path, error)) from None
    return trimesh


def _collada(path: str) -> Any:
    try:
        import collada
    except ImportError as error:
        raise XmlError("{}: {}; expected the Python package pycollada, which reads it".format(path, error)) from None
    return collada

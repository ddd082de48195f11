# SPDX-License-Identifier: BSD-3-Clause
"""Mesh files with colours and textures, for cameras; :mod:`m2wr_sim.model.mesh.files` reads shapes alone."""
from __future__ import annotations

import io
import os
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence, Tuple
from urllib.parse import unquote

import numpy as np

from m2wr_sim.model.mesh.files import FARTHEST_VERTEX, MAX_TRIANGLES, has_area, read_mesh_file
from m2wr_sim.model.mesh.textures import Texture, read_texture
from m2wr_sim.model.source_files import note_file, stamp_of
from m2wr_sim.model.xml.safe import XmlError, parse_xml

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.types import MeshFile

    Floats = NDArray[np.float64]

WITHOUT_COLOUR = (1.0, 1.0, 1.0)
_KEPT = 64


@dataclass(frozen=True, eq=False)
class Surface:
    """A triangle mesh with colours.

    ``corners`` is (n, 3 corners, 3) [m], counter-clockwise seen from outside; ``colours`` (n, 3) from 0 to 1;
    ``uv`` (n, 3 corners, 2), where (0, 0) is the upper left corner of a texture; ``textures`` holds the textures,
    ``uses`` (n,) int which of them a triangle shows, -1 for none.
    """

    corners: Floats
    colours: Floats
    uv: Optional[Floats] = None
    textures: Tuple[Texture, ...] = ()
    uses: Optional[NDArray[np.int64]] = None


@dataclass
class _Piece:
    """Triangles of one material: names, (n, 3, 3) corners [m], colour, (n, 3, 2) uv or None, path of a texture."""

    names: Tuple[str, ...]
    corners: Floats
    colour: Tuple[float, float, float] = WITHOUT_COLOUR
    uv: Optional[Floats] = None
    picture: str = ""


_surfaces: Dict[Any, Tuple[Surface, Tuple[str, ...]]] = {}


def read_surface_file(file: MeshFile) -> Tuple[Surface, Tuple[str, ...]]:
    """Read the mesh of a visual with its colours and textures.

    Parameters
    ----------
    file : MeshFile

    Returns
    -------
    surface : Surface
        The same one for the same file.
    problems : tuple of str
        What could not be read besides.

    Raises
    ------
    XmlError
        If the file cannot be read, or lacks the submesh.
    """
    if not file.path:
        raise XmlError("mesh {}: there is no such file; expected one that is on this machine".format(file.uri))
    key = file, stamp_of(file.path)
    if key not in _surfaces:
        while len(_surfaces) >= _KEPT:
            del _surfaces[next(iter(_surfaces))]
        _surfaces[key] = _read(file)
    return _surfaces[key]


def plain_surface(corners: Floats, colour: Tuple[float, float, float] = WITHOUT_COLOUR) -> Surface:
    """Return a Surface of one colour.

    Parameters
    ----------
    corners : (N, 3, 3) float64
        Corners of N triangles [m].
    colour : (3,) float
        Red, green, blue, 0 to 1.
    """
    return Surface(corners, np.tile(np.array(colour, float), (len(corners), 1)))


def _read(file: MeshFile) -> Tuple[Surface, Tuple[str, ...]]:
    problems: List[str] = []
    pieces: List[_Piece] = []
    try:
        kind = os.path.splitext(file.path)[1].lower()
        if kind == ".dae":
            pieces = _collada_pieces(file.path)
        elif kind == ".obj":
            pieces = _obj_pieces(file.path)
    except Exception as error:      # any error of the parsers; the shape may still be read
        problems.append("{}: its colours cannot be read: {}".format(file.path, error))
    if not pieces:
        pieces = [_Piece(part.names, part.vertices[part.triangles]) for part in read_mesh_file(file.path)]
    if file.submesh is not None:
        known = sorted({name for piece in pieces for name in piece.names})
        pieces = [piece for piece in pieces if file.submesh in piece.names]
        if not pieces:
            raise XmlError('{}: it has no submesh "{}"; expected one of {}'.format(
                file.path, file.submesh, ", ".join(known) or "none"))
    return _joined(file, pieces, problems), tuple(problems)


def _joined(file: MeshFile, pieces: Sequence[_Piece], problems: List[str]) -> Surface:
    corners = np.concatenate([piece.corners for piece in pieces])
    colours = np.concatenate([np.tile(np.array(piece.colour, float), (len(piece.corners), 1)) for piece in pieces])
    uv = np.concatenate([np.zeros((len(piece.corners), 3, 2)) if piece.uv is None else piece.uv for piece in pieces])
    textures: List[Texture] = []
    numbers: Dict[str, int] = {}
    uses = []
    for piece in pieces:
        if piece.picture and piece.uv is not None and piece.picture not in numbers:
            numbers[piece.picture] = -1
            try:
                textures.append(read_texture(piece.picture))
                numbers[piece.picture] = len(textures) - 1
            except XmlError as error:
                problems.append(str(error))
        use = numbers.get(piece.picture, -1) if piece.uv is not None else -1
        uses.append(np.full(len(piece.corners), use, np.int64))
    if file.centred:
        corners = corners - 0.5 * (corners.min(axis=(0, 1)) + corners.max(axis=(0, 1)))
    corners = corners * np.array(file.scale)
    if np.prod(np.sign(file.scale)) < 0.0:      # a mirror turns the faces inside out
        corners, uv = corners[:, ::-1], uv[:, ::-1]
    good = np.all(np.abs(corners) <= FARTHEST_VERTEX, axis=(1, 2)) & np.all(np.isfinite(uv), axis=(1, 2))
    good &= has_area(np.where(good[:, None, None], corners, 0.0))
    if not good.any():
        raise XmlError("{}: there is no triangle in it; expected a mesh".format(file.path))
    if good.sum() > MAX_TRIANGLES:
        raise XmlError("{}: the mesh has {} triangles; expected at most {}".format(
            file.path, int(good.sum()), MAX_TRIANGLES))
    return Surface(np.ascontiguousarray(corners[good]), colours[good], uv[good], tuple(textures),
                   np.concatenate(uses)[good])


def _beside(path: str, name: str) -> str:
    """Return the path of a picture that a mesh file names; models keep pictures beside it or in folders near it."""
    name = unquote(name.replace("\\", "/"))
    name = name[7:] if name.startswith("file://") else name
    folder = os.path.dirname(path)
    candidates = [name] if os.path.isabs(name) else [os.path.join(folder, name)]
    candidates += [os.path.join(folder, where, os.path.basename(name))
                   for where in (".", "../materials/textures", "../../materials/textures", "../textures", "textures")]
    return next((candidate for candidate in candidates if os.path.isfile(candidate)), candidates[0])


# ---- COLLADA ---------------------------------------------------------------------------------------------------


def _collada_pieces(path: str) -> List[_Piece]:
    import collada

    note_file(path)
    read_mesh_file(path)            # checks its size and numbers
    with open(path, "rb") as stream:
        content = stream.read()
    parse_xml(content, path)        # refuses what could expand
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        document = collada.Collada(io.BytesIO(content), ignore=[collada.common.DaeError])
    scene = document.scene or (document.scenes[0] if len(document.scenes) else None)
    found: List[_Piece] = []
    to_metres = np.diag([float(document.assetInfo.unitmeter or 1.0)] * 3 + [1.0])    # the up axis is not applied
    for node in [] if scene is None else scene.nodes:
        _walk(collada, node, to_metres, (), path, found)
    return found


def _walk(collada: Any, node: Any, matrix: Floats, names: Tuple[str, ...], path: str, found: List[_Piece]) -> None:
    if isinstance(node, (collada.scene.GeometryNode, collada.scene.ControllerNode)):
        geometry = node.geometry if isinstance(node, collada.scene.GeometryNode) else node.controller.geometry
        bound = {material.symbol: material.target for material in node.materials}
        for primitive in geometry.primitives:
            piece = _primitive(primitive, bound, matrix, path)
            if piece is not None:
                piece.names = names + tuple(name for name in (geometry.name, geometry.id) if name)
                found.append(piece)
    elif isinstance(node, collada.scene.NodeNode):
        _walk(collada, node.node, matrix @ node.matrix, names, path, found)
    elif isinstance(node, collada.scene.Node):
        own = tuple(name for name in (node.xmlnode.get("name"), node.xmlnode.get("id")) if name)
        for child in node.children:
            _walk(collada, child, matrix @ node.matrix, own or names, path, found)


def _primitive(primitive: Any, bound: Dict[Any, Any], matrix: Floats, path: str) -> Optional[_Piece]:
    """Return the triangles of a primitive, None if it has none."""
    triangles = primitive if hasattr(primitive, "ntriangles") else getattr(primitive, "triangleset", lambda: None)()
    if triangles is None or not triangles.ntriangles:
        return None
    corners = np.asarray(triangles.vertex, float)[np.asarray(triangles.vertex_index)]
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    uv: Optional[Floats] = None
    if triangles.texcoordset:
        given = np.asarray(triangles.texcoordset[0], float)[np.asarray(triangles.texcoord_indexset[0])]
        uv = np.stack((given[:, :, 0], 1.0 - given[:, :, 1]), axis=2)
    if np.linalg.det(matrix[:3, :3]) < 0.0:
        corners, uv = corners[:, ::-1], None if uv is None else uv[:, ::-1]
    colour, picture = _effect(bound.get(primitive.material), path)
    return _Piece((), corners, colour, uv, picture)


def _effect(material: Any, path: str) -> Tuple[Tuple[float, float, float], str]:
    """Return the diffuse colour of a material and the path of its picture."""
    diffuse = getattr(getattr(material, "effect", None), "diffuse", None)
    if diffuse is None:
        return WITHOUT_COLOUR, ""
    sampler = getattr(diffuse, "sampler", None)
    if sampler is not None:
        return WITHOUT_COLOUR, _beside(path, sampler.surface.image.path)
    red, green, blue = (min(max(float(value), 0.0), 1.0) for value in tuple(diffuse)[:3])
    return (red, green, blue), ""


# ---- OBJ -------------------------------------------------------------------------------------------------------


def _obj_pieces(path: str) -> List[_Piece]:
    """Return the triangles of an OBJ file by material; its material files are read from its folder."""
    read_mesh_file(path)            # checks its size and numbers
    materials: Dict[str, Tuple[Tuple[float, float, float], str]] = {}
    points: List[Tuple[float, ...]] = []
    uvs: List[Tuple[float, ...]] = []
    faces: Dict[Tuple[str, str], List[Any]] = {}
    group, material = "", ""
    with open(path, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if not words:
                continue
            if words[0] == "v":
                points.append((float(words[1]), float(words[2]), float(words[3])))
            elif words[0] == "vt":
                uvs.append((float(words[1]), 1.0 - float(words[2]) if len(words) > 2 else 0.0))
            elif words[0] in ("o", "g"):
                group = " ".join(words[1:])
            elif words[0] == "usemtl":
                material = " ".join(words[1:])
            elif words[0] == "mtllib":
                materials.update(_mtl(path, line.split(None, 1)[1].strip()))
            elif words[0] == "f":
                corners = [word.split("/") for word in words[1:]]
                kept = faces.setdefault((group, material), [])
                kept.extend((corners[0], corners[k], corners[k + 1]) for k in range(1, len(corners) - 1))
    return [_obj_piece(group, materials.get(name, (WITHOUT_COLOUR, "")), triangles, points, uvs)
            for (group, name), triangles in faces.items()]


def _obj_piece(group: str, look: Tuple[Tuple[float, float, float], str], triangles: List[Any],
               points: List[Tuple[float, ...]], uvs: List[Tuple[float, ...]]) -> _Piece:
    def index(text: str, count: int) -> int:
        number = int(text)
        return number - 1 if number > 0 else count + number

    corners = np.array([[points[index(corner[0], len(points))] for corner in triangle] for triangle in triangles])
    textured = look[1] and all(len(corner) > 1 and corner[1] for triangle in triangles for corner in triangle)
    uv = np.array([[uvs[index(corner[1], len(uvs))] for corner in triangle] for triangle in triangles]) \
        if textured else None
    return _Piece((group,), corners, look[0], uv, look[1])


def _mtl(path: str, name: str) -> Dict[str, Tuple[Tuple[float, float, float], str]]:
    """Return ``{material: (colour, path of its picture)}`` of a material file; empty if there is none."""
    found: Dict[str, Tuple[Tuple[float, float, float], str]] = {}
    own = os.path.join(os.path.dirname(path), os.path.basename(name))
    note_file(own)
    current = ""
    if not os.path.isfile(own):
        return found
    with open(own, encoding="utf-8", errors="replace") as stream:
        for line in stream:
            words = line.split()
            if len(words) > 1 and words[0] == "newmtl":
                current = " ".join(words[1:])
                found[current] = WITHOUT_COLOUR, ""
            elif len(words) > 3 and words[0] == "Kd" and current:
                red, green, blue = (min(max(float(word), 0.0), 1.0) for word in words[1:4])
                found[current] = (red, green, blue), found[current][1]
            elif len(words) > 1 and words[0] == "map_Kd" and current:
                found[current] = found[current][0], _beside(path, words[-1])
    return found

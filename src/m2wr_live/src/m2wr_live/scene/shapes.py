# SPDX-License-Identifier: BSD-3-Clause
"""Coloured shapes in space: unit shapes and meshes with a pose and a scale, read from markers."""
from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_view.frames import matrix_of

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Uint32Array

_CUBE, _SPHERE, _CYLINDER, _CUBES, _SPHERES, _TRIANGLES = 1, 2, 3, 6, 7, 11     # of visualization_msgs/Marker
_DELETE, _DELETE_ALL = 2, 3
_SIDES = 40                 # of a drawn cylinder
_RINGS, _SECTORS = 12, 24   # of a drawn sphere
MOST_SHAPES = 20000         # of a world; browsers become slow with more


class Geometry(NamedTuple):
    """Triangles.

    Attributes
    ----------
    vertices : (n, 3) float64
        [m]
    faces : (m, 3) uint32
    smooth : bool
        Without visible edges.
    closed : bool
        Encloses a volume, with the vertices of each face counterclockwise seen from outside: the back of its faces is
        never seen.
    coloured : bytes
        The same with colours and textures of its own, as binary glTF; empty: it has the colours of its shapes.
    """

    vertices: FloatArray
    faces: Uint32Array
    smooth: bool = False
    closed: bool = False
    coloured: bytes = b""


class Shape(NamedTuple):
    """One coloured body.

    Attributes
    ----------
    geometry : str
        A key of :attr:`Shapes.geometries`.
    pose : (4, 4) float64
        In the frame of its owner.
    scale : (3,) tuple of float
        Of the geometry along its axes.
    colour : (4,) tuple of float
        Red, green, blue and opacity, 0 to 1.
    owner : str
        The model, or the link, that it belongs to.
    """

    geometry: str
    pose: FloatArray
    scale: Tuple[float, float, float]
    colour: Tuple[float, float, float, float]
    owner: str


def _grid_faces(rows: int, columns: int) -> Uint32Array:
    """Return the triangles (n, 3) of a grid of vertices whose last column joins the first."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    here, right = row * columns + column, row * columns + (column + 1) % columns
    low = np.stack((here, right, right + columns), axis=-1)
    high = np.stack((here, right + columns, here + columns), axis=-1)
    return np.concatenate((low.reshape(-1, 3), high.reshape(-1, 3))).astype(np.uint32)


def unit_box() -> Geometry:
    """Return a cube with sides of 1 m around the origin."""
    vertices = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return Geometry(vertices, np.array(faces, dtype=np.uint32), closed=True)


def unit_cylinder() -> Geometry:
    """Return a cylinder of diameter 1 m and length 1 m along z, around the origin."""
    angle = np.linspace(0.0, 2.0 * np.pi, _SIDES, endpoint=False)
    rim = 0.5 * np.column_stack((np.cos(angle), np.sin(angle)))
    rings = [np.column_stack((rim, np.full(_SIDES, z))) for z in (-0.5, 0.5)]
    vertices = np.concatenate(rings + [np.array(((0.0, 0.0, -0.5), (0.0, 0.0, 0.5)))])
    side, ahead = np.arange(_SIDES), (np.arange(_SIDES) + 1) % _SIDES
    bottom = np.column_stack((np.full(_SIDES, 2 * _SIDES), ahead, side))
    top = np.column_stack((np.full(_SIDES, 2 * _SIDES + 1), side + _SIDES, ahead + _SIDES))
    return Geometry(vertices, np.concatenate((_grid_faces(2, _SIDES), bottom, top)).astype(np.uint32), closed=True)


def unit_sphere() -> Geometry:
    """Return a sphere of diameter 1 m around the origin."""
    height = np.linspace(-0.5 * np.pi, 0.5 * np.pi, _RINGS)
    angle = np.linspace(0.0, 2.0 * np.pi, _SECTORS, endpoint=False)
    up, around = np.meshgrid(height, angle, indexing="ij")
    vertices = 0.5 * np.stack((np.cos(up) * np.cos(around), np.cos(up) * np.sin(around), np.sin(up)), axis=-1)
    return Geometry(vertices.reshape(-1, 3), _grid_faces(_RINGS, _SECTORS), True, True)


#: The geometries that every scene has.
UNITS = {"box": unit_box(), "cylinder": unit_cylinder(), "sphere": unit_sphere()}


def quaternions_of(rotations: FloatArray) -> FloatArray:
    """Return quaternions w x y z (n, 4) of rotation matrices (n, 3, 3).

    Of the four components the largest is computed from the diagonal and the others by division (S. W. Shepperd 1978).
    """
    r = np.asarray(rotations, dtype=float).reshape(-1, 3, 3)
    xx, yy, zz = r[:, 0, 0], r[:, 1, 1], r[:, 2, 2]
    squares = np.stack((1 + xx + yy + zz, 1 + xx - yy - zz, 1 - xx + yy - zz, 1 - xx - yy + zz), axis=1)
    wx, wy, wz = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    xy, xz, yz = r[:, 0, 1] + r[:, 1, 0], r[:, 0, 2] + r[:, 2, 0], r[:, 1, 2] + r[:, 2, 1]
    products = np.stack((np.stack((squares[:, 0], wx, wy, wz), 1), np.stack((wx, squares[:, 1], xy, xz), 1),
                         np.stack((wy, xy, squares[:, 2], yz), 1), np.stack((wz, xz, yz, squares[:, 3]), 1)), axis=1)
    chosen = products[np.arange(len(r)), np.argmax(squares, axis=1)]
    return chosen / np.linalg.norm(chosen, axis=1, keepdims=True)


def triangles_key(vertices: FloatArray) -> str:
    """Return the name of a mesh: two meshes of equal content share it."""
    return "mesh_" + hashlib.sha1(np.ascontiguousarray(vertices, dtype=np.float32).tobytes()).hexdigest()[:16]


class MarkerShapes:
    """The shapes of all markers received, as rviz keeps them: add, modify, delete, delete all.

    Attributes
    ----------
    shapes : list of Shape
        Poses are in ``frame``.
    geometries : dict of str to Geometry
        The meshes among them.
    frame : str
        Of the newest marker.
    version : int
        Increases with each change.
    """

    def __init__(self) -> None:
        self._known: Dict[Tuple[str, int], Tuple[object, List[Shape]]] = {}
        self.shapes: List[Shape] = []
        self.geometries: Dict[str, Geometry] = {}
        self.frame, self.version, self.left_out = "", 0, 0

    def update(self, markers: Iterable[Any]) -> None:
        """Take the markers of a message."""
        before, known = self._known, self._known.copy()
        for marker in markers:
            name = (marker.ns, marker.id)
            self.frame = marker.header.frame_id.lstrip("/") or self.frame
            if marker.action == _DELETE_ALL:
                known = {}
            elif marker.action == _DELETE:
                known.pop(name, None)
            else:
                content, old = _content(marker), before.get(name)
                if old is None or old[0] != content:
                    shapes, geometries = shapes_of(marker)
                    self.geometries.update(geometries)
                    old = (content, shapes)
                known[name] = old
        self._known = known
        every = [shape for _, shapes in known.values() for shape in shapes]
        self.shapes, self.left_out = every[:MOST_SHAPES], max(0, len(every) - MOST_SHAPES)
        used = {shape.geometry for shape in self.shapes}
        self.geometries = {key: geometry for key, geometry in self.geometries.items() if key in used}
        self.version += 1


def placed(marker: Any) -> Optional[Shape]:
    """Return a shape with the pose, scale, colour and owner of a marker, or None if a number is not finite."""
    place, turn, scale = marker.pose.position, marker.pose.orientation, marker.scale
    colour = (marker.color.r, marker.color.g, marker.color.b, marker.color.a)
    size = (scale.x, scale.y, scale.z)
    pose = matrix_of((place.x, place.y, place.z), (turn.x, turn.y, turn.z, turn.w))
    if not (np.all(np.isfinite(pose)) and np.all(np.isfinite(size + colour))):
        return None
    return Shape("", pose, size, colour, marker.ns)


def shapes_of(marker: Any) -> Tuple[List[Shape], Dict[str, Geometry]]:
    """Return the shapes of a marker and their meshes; none for kinds without a volume, and for numbers not finite."""
    base, geometries = placed(marker), {}
    kind: Optional[str] = {_CUBE: "box", _SPHERE: "sphere", _CYLINDER: "cylinder", _CUBES: "box",
                           _SPHERES: "sphere"}.get(marker.type)
    if base is None:
        return [], {}
    centres: Sequence[Any] = [(0.0, 0.0, 0.0)]
    if marker.type in (_CUBES, _SPHERES):
        centres = [(point.x, point.y, point.z) for point in marker.points]
    elif marker.type == _TRIANGLES and len(marker.points) >= 3:
        corners = np.array([(point.x, point.y, point.z) for point in marker.points])[:len(marker.points) // 3 * 3]
        kind = triangles_key(corners)
        geometries[kind] = Geometry(corners, np.arange(len(corners), dtype=np.uint32).reshape(-1, 3))
    if kind is None:
        return [], {}
    found = []
    for centre in centres:
        moved = base.pose.copy()
        moved[:3, 3] += base.pose[:3, :3].dot(centre)
        found.append(base._replace(geometry=kind, pose=moved))
    return found, geometries


def _content(marker: Any) -> Tuple[object, ...]:
    """Return all of a marker that its shapes depend on."""
    place, turn, scale, colour = marker.pose.position, marker.pose.orientation, marker.scale, marker.color
    return (marker.type, place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w, scale.x, scale.y, scale.z,
            colour.r, colour.g, colour.b, colour.a, [(point.x, point.y, point.z) for point in marker.points])

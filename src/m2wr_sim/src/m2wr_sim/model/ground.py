# SPDX-License-Identifier: BSD-3-Clause
"""Ground that is not level, for viewers: which shapes it is made of, with few triangles, shaded."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, NamedTuple, Sequence, Tuple

import numpy as np

from m2wr_sim.geometry import matrix_from_quaternion
from m2wr_sim.model.types import Heightmap, Mesh

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose
    from m2wr_sim.model.types import Geometry

    Floats = NDArray[np.float64]
    Indices = NDArray[np.int64]

COLOUR = (0.45, 0.42, 0.36)         # red, green, blue of ground without a colour of its own
LIGHT = (-0.54, 0.54, 0.65)         # towards the light: from the upper left, as maps of mountains have it
DARKEST, RAISE = 0.30, 0.25         # share of a colour away from the light; what the highest place is brighter by
LEAST_UP = 1e-6                     # z of a unit normal, above which a triangle faces up


class Ground(NamedTuple):
    """Triangles of ground.

    Attributes
    ----------
    points : (n, 3) float64
        Corners in the world [m].
    triangles : (m, 3) int64
        Counter-clockwise from above.
    shades : (n,) float64
        By which the colour of a corner is multiplied.
    """

    points: Floats
    triangles: NDArray[np.int64]
    shades: Floats


def is_ground(geometry: Geometry, pose: Pose) -> bool:
    """Return whether a shape is ground: a heightmap, or a mesh of which every triangle faces up.

    Parameters
    ----------
    geometry : Geometry
    pose : Pose
        Of the shape in the world.
    """
    if isinstance(geometry, Heightmap):
        return True
    if not isinstance(geometry, Mesh) or not len(geometry.triangles):
        return False
    corners = geometry.vertices @ matrix_from_quaternion(pose[1]).T
    corners = corners[geometry.triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    return bool(np.all(normals[:, 2] >= LEAST_UP * lengths) and np.any(lengths > 0.0))


def ground_of(shapes: Sequence[Tuple[Geometry, Pose]], most: int) -> List[Ground]:
    """Return the ground that shapes make, with few triangles; meshes are simplified together, so that they still meet.

    Parameters
    ----------
    shapes : sequence of (Geometry, Pose)
        For which :func:`is_ground` holds, and their poses in the world.
    most : int
        Triangles of a heightmap, and of all meshes.

    Returns
    -------
    list of Ground
        One for each shape, in the world.
    """
    parts: List[Tuple[Floats, Indices]] = []
    for geometry, pose in shapes:
        if isinstance(geometry, Heightmap):
            points, triangles = sampled(geometry, most)
        else:
            assert isinstance(geometry, Mesh)
            points, triangles = geometry.vertices, geometry.triangles.astype(np.int64)
        parts.append((points @ matrix_from_quaternion(pose[1]).T + np.asarray(pose[0]), triangles))
    meshes = [index for index, (geometry, _) in enumerate(shapes) if isinstance(geometry, Mesh)]
    for index, part in zip(meshes, clustered([parts[index] for index in meshes], most)):
        parts[index] = part
    if not parts:
        return []
    starts = np.cumsum([0] + [len(points) for points, _ in parts])
    shades = _shades(np.concatenate([points for points, _ in parts]),
                     np.concatenate([triangles + start for (_, triangles), start in zip(parts, starts)]))
    return [Ground(points, triangles, shades[start:start + len(points)])
            for (points, triangles), start in zip(parts, starts)]


def sampled(field: Heightmap, most: int) -> Tuple[Floats, Indices]:
    """Return the triangles of every k-th sample of a heightmap, the last ones always.

    Parameters
    ----------
    field : Heightmap
    most : int
        Triangles, about.

    Returns
    -------
    (n, 3) float64, (m, 3) int64
        Corners in the frame of the collision [m], and triangles.
    """
    rows, columns = field.heights.shape
    step = 1
    while 2 * -(-(rows - 1) // step) * -(-(columns - 1) // step) > most:
        step += 1
    down = np.unique(np.append(np.arange(0, rows, step), rows - 1))
    right = np.unique(np.append(np.arange(0, columns, step), columns - 1))
    x = (right / (columns - 1) - 0.5) * field.size[0] + field.position[0]
    y = (0.5 - down / (rows - 1)) * field.size[1] + field.position[1]
    z = field.heights[np.ix_(down, right)] + field.position[2]
    points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], z), axis=2).reshape(-1, 3)
    number = np.arange(len(points)).reshape(z.shape)
    a, b, c, d = (part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    return points, np.concatenate((np.stack((a, c, b), axis=1), np.stack((b, c, d), axis=1)))


def clustered(meshes: Sequence[Tuple[Floats, Indices]], most: int) -> List[Tuple[Floats, Indices]]:
    """Return meshes with fewer triangles: corners in one cell of a grid become their mean (Rossignac and Borrel, 1993).

    Parameters
    ----------
    meshes : sequence of ((n, 3) float64, (m, 3) int64)
        Corners [m] and triangles.  What they share stays shared.
    most : int
        Triangles of all; no more remain as they are.

    Returns
    -------
    list of ((k, 3) float64, (l, 3) int64)
    """
    if sum(len(triangles) for _, triangles in meshes) <= most:
        return list(meshes)
    starts = np.cumsum([0] + [len(points) for points, _ in meshes])
    vertices = np.concatenate([points for points, _ in meshes])
    low, extent = vertices.min(axis=0), np.maximum(np.ptp(vertices, axis=0), 1e-9)
    cell = float(np.sqrt(2.0 * extent[0] * extent[1] / most))
    while True:
        places = np.floor((vertices - low) / cell).astype(np.int64)
        counts = places.max(axis=0) + 1
        _, where = np.unique((places[:, 0] * counts[1] + places[:, 1]) * counts[2] + places[:, 2], return_inverse=True)
        where = where.ravel()
        found = [where[triangles + start] for (_, triangles), start in zip(meshes, starts)]
        found = [part[(part[:, 0] != part[:, 1]) & (part[:, 1] != part[:, 2]) & (part[:, 2] != part[:, 0])]
                 for part in found]
        if sum(map(len, found)) <= most:
            means: Floats = np.stack([np.bincount(where, vertices[:, axis]) for axis in range(3)], axis=1) \
                / np.bincount(where)[:, None]
            return [(means, part) for part in found]
        cell *= 1.2


def _shades(points: Floats, triangles: NDArray[np.int64]) -> Floats:
    """Return by how much the light makes each corner darker or brighter; (n,)."""
    corners = points[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    sums = np.stack([sum(np.bincount(triangles[:, corner], normals[:, axis], len(points)) for corner in range(3))
                     for axis in range(3)], axis=1)
    sums /= np.maximum(np.linalg.norm(sums, axis=1), 1e-12)[:, None]
    lit = np.clip(sums @ (np.array(LIGHT) / np.linalg.norm(LIGHT)), 0.0, 1.0)
    height = points[:, 2]
    return DARKEST + lit + RAISE * (height - height.min()) / max(float(np.ptp(height)), 1e-9)


def tinted(shades: Floats, colour: Sequence[float] = COLOUR) -> Floats:
    """Return colours (n, 3) from 0 to 1 of shades (n,) and one colour (red, green, blue).

    Parameters
    ----------
    shades : (n,) float64
        Of a :class:`Ground`.
    colour : (3,) sequence of float
    """
    return np.clip(shades[:, None] * np.asarray(colour[:3]), 0.0, 1.0)

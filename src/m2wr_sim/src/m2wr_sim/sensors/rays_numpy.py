# SPDX-License-Identifier: BSD-3-Clause
"""Ray casting without numba, as array operations: each shape is intersected with all beams.

The results are those of :mod:`m2wr_sim.sensors.ray_kernels`, :mod:`m2wr_sim.sensors.mesh_kernels` and
:mod:`m2wr_sim.sensors.height_ray_kernels`.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from m2wr_sim.sensors.height_blocks import HeightBlocks, triangles_of
from m2wr_sim.sensors.mesh_kernels import EDGE, GRAZING
from m2wr_sim.sensors.ray_kernels import (
    BOX,
    COUNT,
    CYLINDER,
    HALF,
    IGNORED,
    KIND,
    MESH,
    ORIENTATION,
    OWNER,
    PLANE,
    RANGE_MAX,
    RANGE_MIN,
    TINY,
    TREE,
    rotation,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

_PAIRS_AT_ONCE = 2 ** 20        # rays times triangles


def _numpy_solid(kind: float, direction: Floats, origin: Floats, half: Floats, nearest: float) -> Floats:
    """Return the ranges to one shape along ``direction`` (B, 3) from ``origin`` (3,), both in the shape's frame."""
    direction = np.where(np.abs(direction) < TINY, TINY, direction)
    one, two = (-half - origin) / direction, (half - origin) / direction
    enter, leave = np.minimum(one, two), np.maximum(one, two)
    if kind == BOX:
        enter, leave = enter.max(axis=1), leave.min(axis=1)
    else:
        axes = 2 if kind == CYLINDER else 3
        flat, start = direction[:, :axes], origin[:axes]
        a, b = (flat * flat).sum(axis=1), flat @ start
        miss = start - flat * (b / a)[:, None]
        left = a * (half[0] * half[0] - (miss * miss).sum(axis=1))
        root = np.sqrt(np.maximum(left, 0.0))
        ends = (-b - root) / a, np.where(left >= 0.0, (root - b) / a, -np.inf)
        enter, leave = ends if axes == 3 else (np.maximum(ends[0], enter[:, 2]), np.minimum(ends[1], leave[:, 2]))
    t = np.where(enter > nearest, enter, leave)
    return np.where((leave >= enter) & (t > nearest), t, np.inf)


def _directions(beams: Floats, rows: Floats, frame: Floats) -> Floats:
    """Return the directions of all beams in the world, (V * N, 3)."""
    flat = np.empty((rows.shape[0], beams.shape[1], 3))
    flat[:, :, 0], flat[:, :, 1] = rows[:, :1] * beams[0], rows[:, :1] * beams[1]
    flat[:, :, 2] = rows[:, 1:]
    sensor = np.array(rotation(*frame[ORIENTATION:ORIENTATION + 4])).reshape(3, 3)
    return flat.reshape(-1, 3) @ sensor.T


def cast_rays_numpy(ranges: Floats, hits: NDArray[np.int64], beams: Floats, rows: Floats, frame: Floats,
                    spheres: Floats, shapes: Floats, order: NDArray[np.int32], near: NDArray[np.int32]) -> int:
    """Cast all beams, as ``ray_kernels.cast_rays`` with the same layouts of arrays.

    Parameters
    ----------
    ranges : (V * N,) float64
        Written: distance from the sensor's origin to the first hit [m], the longest range without a hit.
    hits : (V * N,) or (0,) int64
        Written, unless empty: row of the shape that is hit, -1 for none.
    beams, rows, frame, spheres, shapes : float64
        Read only.
    order : (2, C) int32
        Written: in the first row, the shapes within reach, not sorted.
    near : (n,) int32
        Rows of the shapes to look at; empty: all.

    Returns
    -------
    int
        Number of shapes within reach.
    """
    ranges[:] = frame[RANGE_MAX]
    hits[:] = -1
    with np.errstate(all='ignore'):
        rays = _directions(beams, rows, frame)
        centres = spheres[:3, :int(frame[COUNT])].T - frame[:3]
        reach = np.sqrt((centres * centres).sum(axis=1)) - spheres[3, :centres.shape[0]]
        seen = np.flatnonzero(reach <= frame[RANGE_MAX])
        if near.size:
            seen = np.intersect1d(seen, near)
        order[0, :seen.size] = seen
        for row in seen:
            shape, centre = shapes[row], centres[row]
            if shape[KIND] >= MESH or (frame[IGNORED] >= 0.0 and shape[OWNER] == frame[IGNORED]):
                continue
            if shape[KIND] == PLANE:
                t = (shape[:3] @ centre) / (rays @ shape[:3])
                t = np.where(t > frame[RANGE_MIN], t, np.inf)
            else:
                axes = shape[:9].reshape(3, 3)
                t = _numpy_solid(shape[KIND], rays @ axes, -centre @ axes, shape[HALF:KIND], frame[RANGE_MIN])
            nearer = t < ranges
            ranges[nearer] = t[nearer]
            if hits.size:
                hits[nearer] = row
    return int(seen.size)


def cast_meshes_numpy(ranges: Floats, hits: NDArray[np.int64], beams: Floats, rows: Floats, frame: Floats,
                      spheres: Floats, shapes: Floats, order: NDArray[np.int32], found: int, nodes: Floats,
                      triangles: Floats, trees: NDArray[np.int64]) -> None:
    """Lower ranges to the meshes within reach, as ``mesh_kernels.cast_meshes`` with the same layouts of arrays.

    Parameters
    ----------
    ranges : (V * N,) float64
        Lowered where a mesh is nearer [m].
    hits : (V * N,) or (0,) int64
        Unless empty, set to the row of the mesh that is hit.
    beams, rows, frame, spheres, shapes, nodes, triangles : float64
        Read only; ``nodes`` is not used.
    order : (2, C) int32
        In the first row, the shapes within reach.
    found : int
        Number of shapes within reach.
    trees : (T, 4) int64
    """
    with np.errstate(all='ignore'):
        rays = _directions(beams, rows, frame)
        for row in order[0, :found]:
            shape = shapes[row]
            if shape[KIND] != MESH or (frame[IGNORED] >= 0.0 and shape[OWNER] == frame[IGNORED]):
                continue
            _, start, count, _ = trees[int(shape[TREE])]
            axes = shape[:9].reshape(3, 3)
            origin, local = (frame[:3] - spheres[:3, row]) @ axes, rays @ axes
            near = triangles[start:start + count]
            near = near[_near_triangles(near, origin, local, frame[RANGE_MAX])]
            _lower(ranges, hits, row, near, origin, local, frame[RANGE_MIN])


def cast_heights_numpy(ranges: Floats, hits: NDArray[np.int64], row: int, beams: Floats, rows: Floats, frame: Floats,
                       sphere: Floats, shape: Floats, *ground: Any) -> None:
    """Lower ranges to a heightmap, as ``height_ray_kernels.cast_heights`` with the same arguments.

    Parameters
    ----------
    ranges : (V * N,) float64
        Lowered where the heightmap is nearer [m].
    hits : (V * N,) or (0,) int64
        Unless empty, set to ``row`` there.
    row : int
        Of the heightmap in the scene.
    beams, rows, frame, sphere, shape : float64
        Read only.
    ground : arrays
        ``heights``, ``blocks``, ``levels`` and ``frame`` of :class:`m2wr_sim.sensors.height_blocks.HeightBlocks`.
    """
    if frame[IGNORED] >= 0.0 and shape[OWNER] == frame[IGNORED]:
        return
    with np.errstate(all='ignore'):
        axes = shape[:9].reshape(3, 3)
        origin, local = (frame[:3] - sphere[:3]) @ axes, _directions(beams, rows, frame) @ axes
        if not (np.all(np.isfinite(origin)) and np.all(np.isfinite(local))):
            return
        low, high = np.minimum(local.min(axis=0), 0.0), np.maximum(local.max(axis=0), 0.0)
        near = triangles_of(HeightBlocks(np.zeros(3), 0.0, *ground), origin[:2] + low[:2] * frame[RANGE_MAX] - 1e-6,
                            origin[:2] + high[:2] * frame[RANGE_MAX] + 1e-6)
        near = near[_near_triangles(near, origin, local, frame[RANGE_MAX])]
        _lower(ranges, hits, row, near, origin, local, frame[RANGE_MIN])


def _lower(ranges: Floats, hits: NDArray[np.int64], row: int, triangles: Floats, origin: Floats, rays: Floats,
           nearest: float) -> None:
    """Lower ranges to triangles."""
    step = max(1, _PAIRS_AT_ONCE // len(rays))
    for first in range(0, len(triangles), step):
        t = _intersect_triangles(triangles[first:first + step], origin, rays, nearest)
        nearer = t < ranges
        ranges[nearer] = t[nearer]
        if hits.size:
            hits[nearer] = row


def _near_triangles(triangles: Floats, origin: Floats, rays: Floats, longest: float) -> NDArray[np.bool_]:
    """Return which triangles overlap the bounding box of the beams, (M,) bool."""
    low, high = np.minimum(rays.min(axis=0), 0.0) * longest - 1e-6, np.maximum(rays.max(axis=0), 0.0) * longest + 1e-6
    corners = triangles[:, :3] - origin
    corners = np.stack((corners, corners + triangles[:, 3:6], corners + triangles[:, 6:9]), axis=1)
    return np.all((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high), axis=1)


def _intersect_triangles(triangles: Floats, origin: Floats, rays: Floats, nearest: float) -> Floats:
    """Return the ranges (B,) of rays to the nearest of some triangles, infinity where a ray misses all."""
    one, two, offset = triangles[:, 3:6], triangles[:, 6:9], origin - triangles[:, :3]
    normal, across = np.cross(one, two), np.cross(offset, one)
    slope = -(rays @ normal.T)
    u, v = rays @ np.cross(two, offset).T / slope, rays @ across.T / slope
    t = (two * across).sum(axis=1) / slope
    hit = (u >= -EDGE) & (v >= -EDGE) & (u + v <= 1.0 + EDGE) & (t > nearest)
    hit &= np.abs(slope) > GRAZING * np.sqrt((normal * normal).sum(axis=1))
    return np.where(hit, t, np.inf).min(axis=1)

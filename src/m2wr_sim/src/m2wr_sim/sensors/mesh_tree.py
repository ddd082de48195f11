# SPDX-License-Identifier: BSD-3-Clause
"""Bounding volume trees of meshes, for :mod:`m2wr_sim.sensors.mesh_kernels`."""
from __future__ import annotations

import weakref
from typing import TYPE_CHECKING, Any, Dict, List, NamedTuple, Tuple, Union

import numpy as np

from m2wr_sim.model.types import Heightmap

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.types import Mesh

    Floats = NDArray[np.float64]
    Geometry = Union[Mesh, Heightmap]

LEAF = 4            # greatest number of triangles in a leaf
_GRID = 20          # bits per coordinate of the Z-order curve


class Tree(NamedTuple):
    """The tree of one mesh.

    Attributes
    ----------
    middle : (3,) float64
        Centre of the bounding box, in the frame of the mesh [m].
    radius : float
        Radius of the bounding sphere around ``middle`` [m].
    nodes : (K, 6) float64
    triangles : (M, 9) float64
    leaves : int
        Number of leaves, a power of two.
    """

    middle: Floats
    radius: float
    nodes: Floats
    triangles: Floats
    leaves: int


def corners_of(geometry: Geometry) -> Floats:
    """Return the corners (M, 3 corners, 3) of the triangles of a Mesh or Heightmap, in the collision's frame [m]."""
    if not isinstance(geometry, Heightmap):
        return np.asarray(geometry.vertices, dtype=np.float64)[np.asarray(geometry.triangles)]
    heights = np.asarray(geometry.heights, dtype=np.float64)
    rows, columns = heights.shape
    x = (np.arange(columns) / (columns - 1) - 0.5) * geometry.size[0] + geometry.position[0]
    y = (0.5 - np.arange(rows) / (rows - 1)) * geometry.size[1] + geometry.position[1]
    points = np.stack(np.broadcast_arrays(x[None, :], y[:, None], heights + geometry.position[2]), axis=2)
    a, b, c, d = points[:-1, :-1], points[:-1, 1:], points[1:, :-1], points[1:, 1:]
    return np.stack((np.stack((a, c, b), axis=2), np.stack((b, c, d), axis=2)), axis=2).reshape(-1, 3, 3)


def build_tree(geometry: Geometry) -> Tree:
    """Build the tree of a Mesh.

    The triangles are sorted along a Z-order (Morton) curve through their centres.  Groups of at most :data:`LEAF`
    neighbours are the leaves of a complete binary tree of bounding boxes.

    Raises
    ------
    ValueError
        If there is no triangle or a corner is not finite.
    """
    corners = corners_of(geometry)
    if not len(corners) or not np.all(np.isfinite(corners)):
        raise ValueError("a mesh of %d triangles: expected at least one, with finite corners" % len(corners))
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    middle = 0.5 * (low + high)
    corners = corners - middle
    radius = float(np.sqrt((corners * corners).sum(axis=2).max()))
    corners = corners[np.argsort(_curve(corners.mean(axis=1), float((high - low).max())), kind="stable")]
    count, leaves = len(corners), 1
    while leaves * LEAF < count:
        leaves *= 2
    starts = np.arange(leaves, dtype=np.int64) * count // leaves
    least, most = (np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts))
    levels = []
    while True:
        levels.append(np.hstack((0.5 * (least + most), 0.5 * (most - least))))
        if len(least) == 1:
            break
        least, most = np.minimum(least[0::2], least[1::2]), np.maximum(most[0::2], most[1::2])
    first = corners[:, 0]
    triangles = np.hstack((first, corners[:, 1] - first, corners[:, 2] - first))
    return Tree(middle, radius, np.concatenate(levels[::-1]), np.ascontiguousarray(triangles), leaves)


def _curve(points: Floats, extent: float) -> NDArray[np.uint64]:
    """Return the Morton code of each point: the interleaved bits of its coordinates."""
    cells = np.clip((points / max(extent, 1e-300) + 0.5) * 2 ** _GRID, 0, 2 ** _GRID - 1).astype(np.uint64)
    place = np.zeros(len(points), np.uint64)
    for bit in range(_GRID):
        for axis in range(3):
            place |= ((cells[:, axis] >> np.uint64(bit)) & np.uint64(1)) << np.uint64(3 * bit + axis)
    return place


_trees: "weakref.WeakKeyDictionary[Any, Tree]" = weakref.WeakKeyDictionary()    # Mesh in use -> Tree


def tree_of(geometry: Geometry) -> Tree:
    """Return the tree of a Mesh. It is built at the first use; other threads may call this.

    Raises
    ------
    ValueError
        If there is no triangle or a corner is not finite.
    """
    tree = _trees.get(geometry)
    if tree is None:
        tree = _trees[geometry] = build_tree(geometry)
    return tree


class Forest:
    """The trees of all meshes of a scene, in one set of arrays; equal shapes share a tree.

    Attributes
    ----------
    nodes, triangles, trees : arrays
        In the layout of :mod:`m2wr_sim.sensors.mesh_kernels`; ``pack`` may replace them.
    """

    def __init__(self) -> None:
        self._entries: Dict[Geometry, List[Any]] = {}       # geometry -> [number, Tree, users]
        self._numbers: Dict[int, Geometry] = {}
        self._stale = False
        self._lay_out()

    def __bool__(self) -> bool:
        return bool(self._entries)

    def add(self, geometry: Geometry) -> Tuple[int, Tree]:
        """Add a user of a geometry; returns the number and the Tree of the geometry."""
        entry = self._entries.get(geometry)
        if entry is None:
            number = next(number for number in range(len(self._numbers) + 1) if number not in self._numbers)
            entry = self._entries[geometry] = [number, tree_of(geometry), 0]
            self._numbers[number] = geometry
            self._stale = True
        entry[2] += 1
        return entry[0], entry[1]

    def remove(self, number: int) -> None:
        """Remove one user of a geometry, and the geometry with its last user."""
        geometry = self._numbers[number]
        self._entries[geometry][2] -= 1
        if not self._entries[geometry][2]:
            del self._entries[geometry], self._numbers[number]
            self._stale = True

    def pack(self) -> Forest:
        """Update the arrays; returns self."""
        if self._stale:
            self._lay_out()
        return self

    def _lay_out(self) -> None:
        entries = sorted(self._entries.values(), key=lambda entry: entry[0])
        self.trees = np.zeros((max([entry[0] for entry in entries], default=-1) + 1, 4), np.int64)
        nodes, triangles = 0, 0
        for number, tree, _ in entries:
            self.trees[number] = nodes, triangles, len(tree.triangles), tree.leaves
            nodes, triangles = nodes + len(tree.nodes), triangles + len(tree.triangles)
        self.nodes = np.concatenate([np.empty((0, 6))] + [tree.nodes for _, tree, _ in entries])
        self.triangles = np.concatenate([np.empty((0, 9))] + [tree.triangles for _, tree, _ in entries])
        self._stale = False

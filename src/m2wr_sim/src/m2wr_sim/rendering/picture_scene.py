# SPDX-License-Identifier: BSD-3-Clause
"""The visible shapes of all models, in the arrays of the kernels."""
from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Dict, Hashable, List, NamedTuple, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.model.mesh.surfaces import Surface
from m2wr_sim.model.mesh.textures import Texture
from m2wr_sim.rendering import picture_layout as layout
from m2wr_sim.rendering import tree_kernels as kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]

MESH_LEAF = 8           # greatest number of triangles in a leaf
_OWN_COLOURS = (-1.0, -1.0, -1.0)


class Part(NamedTuple):
    """One visible shape: kind of the layout, half extents [m] or a Surface, colour or None for that of the mesh."""

    kind: int
    shape: Any
    colour: Optional[Tuple[float, float, float]] = None
    texture: Optional[Texture] = None
    repeat: Tuple[float, float] = (1.0, 1.0)
    shadow: bool = True


@dataclass
class Lighting:
    """Lights of the layout (n, LIGHT_SIZE), light from everywhere (3,), background at the horizon and overhead (6,)."""

    lights: Floats = field(default_factory=lambda: np.zeros((0, layout.LIGHT_SIZE)))
    ambient: Floats = field(default_factory=lambda: np.full(3, 0.4))
    sky: Floats = field(default_factory=lambda: np.full(6, 0.7))

    @property
    def shadowed(self) -> int:
        """Number of the first light with shadows, -1 if there is none."""
        found = np.flatnonzero(self.lights[:, layout.L_SHADOW])
        return int(found[0]) if found.size else -1


class Tree:
    """A tree of some rows of the parts; the arrays grow when they are used up."""

    def __init__(self) -> None:
        self.rows = np.zeros(0, np.int64)
        self.order = np.zeros(1, np.int64)
        self.nodes = np.zeros((1, 6))
        self.row = np.zeros(layout.TREE_SIZE, np.int64)

    def build(self, parts: Floats, rows: Optional[NDArray[np.int64]] = None) -> None:
        """Build the tree for the present poses.

        Parameters
        ----------
        parts : (N, P) float64
            Table of the shapes.
        rows : (M,) int64, optional
            Which rows the tree holds from now on; None: the same as before.
        """
        if rows is not None:
            self.rows = rows
        if self.order.size < self.rows.size:
            self.order = np.zeros(2 * self.rows.size, np.int64)
            self.nodes = np.zeros((8 * self.rows.size, 6))
        leaves = kernels.build_tree(self.nodes, self.order, parts, self.rows)
        self.row[:] = 0, 0, self.rows.size, leaves


class PictureScene:
    """A table of visible shapes, one per row; a row keeps its number until its owner is removed.

    Attributes
    ----------
    parts, meshes, mesh_nodes, triangles, looks, images, texels : arrays
        See :mod:`m2wr_sim.rendering.picture_layout`.  Replaced when they grow, so do not keep them.
    resting, moving, ground : Tree
        Of the parts of static models and of others, and of static planes, which have no shadow.
    lighting : Lighting
    """

    def __init__(self) -> None:
        self.parts = np.zeros((16, layout.PART_SIZE))
        self.count = 0
        self.resting, self.moving, self.ground = Tree(), Tree(), Tree()
        self.lighting = Lighting()
        self._owners: Dict[Hashable, List[int]] = {}
        self._moves: Dict[int, bool] = {}           # row -> whether it belongs to a model that moves
        self._free: List[int] = []
        self._surfaces: Dict[int, Tuple[Surface, int, Floats, Floats]] = {}     # id -> with number, middle, half
        self._textures: Dict[int, Tuple[Texture, int]] = {}                     # id -> with its first row
        self.meshes = np.zeros((1, layout.TREE_SIZE), np.int64)
        self.mesh_nodes, self.triangles = np.zeros((1, 6)), np.zeros((1, 9))
        self.looks = np.zeros((1, layout.LOOK_SIZE), np.float32)
        self.images, self.texels = np.zeros((1, 4), np.int64), np.zeros(3, np.uint8)
        self._stale = True

    def add_all(self, parts: Sequence[Part], poses: Sequence[Any], owner: Hashable, moves: bool) -> List[int]:
        """Add shapes of one owner.

        Parameters
        ----------
        parts : sequence of Part
        poses : sequence of poses
            In the world.
        owner : hashable
            For :meth:`remove_owner`.
        moves : bool
            Whether they may move with each step.

        Returns
        -------
        list of int
            Their rows, for :meth:`place`.
        """
        rows = []
        for part in parts:
            row = self._take_row()
            self.parts[row] = 0.0
            half, middle, mesh = part.shape, np.zeros(3), 0
            if part.kind == layout.MESH:
                mesh, middle, half = self._add_surface(part.shape)
            words = self.parts[row]
            words[layout.P_HALF:layout.P_HALF + 3], words[layout.P_MIDDLE:layout.P_MIDDLE + 3] = half, middle
            words[layout.P_KIND], words[layout.P_MESH] = part.kind, mesh
            words[layout.P_COLOUR:layout.P_COLOUR + 3] = _OWN_COLOURS if part.colour is None else part.colour
            words[layout.P_IMAGE] = -1 if part.texture is None else self._add_texture(part.texture)
            words[layout.P_REPEAT:layout.P_REPEAT + 2] = part.repeat
            words[layout.P_SHADOW] = part.shadow
            self._moves[row] = moves
            rows.append(row)
        self._owners.setdefault(owner, []).extend(rows)
        if rows:
            self.place(np.array(rows, np.int64), np.array([tuple(pose[0]) + tuple(pose[1]) for pose in poses]))
            self._stale = True
        return rows

    def remove_owner(self, owner: Hashable) -> None:
        """Remove all shapes of an owner; an unknown one is not an error."""
        for row in self._owners.pop(owner, []):
            del self._moves[row]
            self._free.append(row)
            self._stale = True

    def place(self, rows: NDArray[np.int64], poses: Floats) -> None:
        """Move shapes.

        Parameters
        ----------
        rows : (n,) int64
        poses : (n, 7) float64
            Positions in the world [m] and quaternions x y z w.  A shape whose pose is not finite is invisible.
        """
        kernels.place_parts(self.parts, rows, poses)

    def disturb(self) -> None:
        """Take note that a static shape was placed elsewhere."""
        self._stale = True

    def prepare(self) -> None:
        """Bring the trees up to date with the poses."""
        if self._stale:
            rows = np.array(list(self._moves), np.int64)
            moves = np.array(list(self._moves.values()), bool)
            plane = self.parts[rows, layout.P_KIND] == layout.PLANE
            self.moving.build(self.parts, rows[moves])
            self.resting.build(self.parts, rows[~moves & ~plane])
            self.ground.build(self.parts, rows[~moves & plane])
            self._stale = False
        elif self.moving.rows.size:
            self.moving.build(self.parts)

    def _take_row(self) -> int:
        if self._free:
            return self._free.pop()
        if self.count == len(self.parts):
            self.parts = np.concatenate((self.parts, np.zeros_like(self.parts)))
        self.count += 1
        return self.count - 1

    def _add_surface(self, surface: Surface) -> Tuple[int, Floats, Floats]:
        """Return number, centre and half extents of a mesh, which is kept for later shapes."""
        known = self._surfaces.get(id(surface))
        if known is not None:
            return known[1:]
        corners = np.asarray(surface.corners, np.float64)
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        middle, half = 0.5 * (low + high), 0.5 * (high - low)
        corners = corners - middle
        least, most = corners.min(axis=1), corners.max(axis=1)
        centres, halves = 0.5 * (least + most), 0.5 * (most - least)
        order = kernels.sort_boxes(centres)
        leaves = kernels.count_leaves(len(corners), MESH_LEAF)
        nodes = np.zeros((2 * leaves - 1, 6))
        kernels.fill_nodes(nodes, leaves, centres, halves, order)
        looks = self._looks(surface, corners)[order]
        corners = corners[order]
        edges = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        triangles = np.concatenate((corners[:, 0], *edges), axis=1)
        first = not self._surfaces
        number = len(self._surfaces)
        row = [0 if first else len(self.mesh_nodes), 0 if first else len(self.triangles), len(corners), leaves]
        self.meshes = _joined(self.meshes, np.array([row], np.int64), first)
        self.mesh_nodes = _joined(self.mesh_nodes, nodes, first)
        self.triangles = _joined(self.triangles, triangles, first)
        self.looks = _joined(self.looks, looks, first)
        self._surfaces[id(surface)] = surface, number, middle, half
        return number, middle, half

    def _looks(self, surface: Surface, corners: Floats) -> NDArray[np.float32]:
        looks = np.zeros((len(corners), layout.LOOK_SIZE), np.float32)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.sqrt((normals * normals).sum(axis=1))
        looks[:, layout.K_NORMAL:layout.K_NORMAL + 3] = normals / np.maximum(lengths, 1e-300)[:, None]
        looks[:, layout.K_COLOUR:layout.K_COLOUR + 3] = surface.colours
        looks[:, layout.K_IMAGE] = -1
        if surface.uses is not None and surface.textures:
            rows = np.array([self._add_texture(texture) for texture in surface.textures] + [-1])
            looks[:, layout.K_IMAGE] = rows[surface.uses]
        if surface.uv is not None:
            looks[:, layout.K_UV:layout.K_UV + 6] = np.asarray(surface.uv).reshape(-1, 6)
        return looks

    def _add_texture(self, texture: Texture) -> int:
        """Return the first row in ``images`` of a texture and its smaller versions."""
        known = self._textures.get(id(texture))
        if known is not None:
            return known[1]
        versions = [np.ascontiguousarray(texture.pixels, np.uint8)]
        while max(versions[-1].shape[:2]) > 1:
            versions.append(_halved(versions[-1]))
        first = not self._textures
        row, start = (0, 0) if first else (len(self.images), self.texels.size)
        entries = []
        for index, pixels in enumerate(versions):
            entries.append((start, pixels.shape[1], pixels.shape[0], len(versions) - 1 - index))
            start += pixels.size
        self.images = _joined(self.images, np.array(entries, np.int64), first)
        self.texels = _joined(self.texels, np.concatenate([pixels.ravel() for pixels in versions]), first)
        self._textures[id(texture)] = texture, row
        return row


def _joined(table: Any, rows: Any, first: bool) -> Any:
    """Return a table with more rows; the first ones replace the row that only keeps the table from being empty."""
    return np.ascontiguousarray(rows) if first else np.concatenate((table, rows))


def _halved(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """Return a picture of half the width and height; each pixel is the mean of those it stands for."""
    values = pixels.astype(np.float32)
    for axis in (0, 1):
        size = values.shape[axis]
        if size > 1:
            even = np.take(values, np.arange(0, size - 1, 2), axis=axis)
            values = 0.5 * (even + np.take(values, np.arange(1, size, 2), axis=axis))
    return (values + 0.5).astype(np.uint8)

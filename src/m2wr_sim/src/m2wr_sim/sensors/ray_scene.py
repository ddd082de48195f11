# SPDX-License-Identifier: BSD-3-Clause
"""The collision shapes of all models, in the arrays of the ray kernels."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Callable, Dict, Hashable, List, Optional, Sequence, Tuple, Union, cast

import numpy as np

from m2wr_sim.model.types import Box, Cylinder, Heightmap, Mesh, Plane, Sphere
from m2wr_sim.sensors import packed_kernels as packed
from m2wr_sim.sensors.height_blocks import HeightBlocks, blocks_of
from m2wr_sim.sensors.mesh_tree import Forest
from m2wr_sim.sensors.ray_kernels import (
    BOX,
    CYLINDER,
    GROUND,
    HALF,
    KIND,
    MESH,
    OWNER,
    PLANE,
    RETRO,
    SHAPE_SIZE,
    SPHERE,
    TREE,
    write_poses,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.geometry import Pose

    Floats = NDArray[np.float64]
    Rows = NDArray[np.int64]
    Primitive = Union[Box, Cylinder, Plane, Sphere]
    Geometry = Union[Primitive, Mesh, Heightmap]


class RayScene:
    """A table of shapes, one per row; a row keeps its number until its owner is removed.

    It holds all shapes of all models, including those of the robot that carries the sensor.

    Parameters
    ----------
    capacity : int
        Number of rows to reserve; the table grows when they are used up.

    Attributes
    ----------
    spheres, shapes : arrays
        The table in the layout of :mod:`m2wr_sim.sensors.ray_kernels`.  Replaced when it grows, so do not keep them.
    order : (2, capacity) int32
        Working memory of the ray kernels, for all sensors.  Replaced when the table grows.
    moves : (capacity,) bool
        The rows that :meth:`mark_moving` named.
    count : int
        Rows in use are below this number.
    version : int
        Increases with every change.
    resting_version : int
        Increases when a shape is added or removed, or one moves that is not in ``moves``.
    has_retro : bool
        Whether any shape has a laser_retro other than 0.
    forest : Forest
        Trees of meshes; false if there are none.
    grounds : dict
        Row of each heightmap -> its :class:`m2wr_sim.sensors.height_blocks.HeightBlocks`.
    """

    def __init__(self, capacity: int = 64) -> None:
        capacity = max(int(capacity), 1)
        self.spheres = np.full((4, capacity), np.nan)
        self.shapes = np.zeros((capacity, SHAPE_SIZE))
        self.order, self.moves = np.empty((2, capacity), np.int32), np.zeros(capacity, bool)
        self.count = 0
        self.version = self.resting_version = 0
        self.has_retro = False
        self.forest = Forest()
        self.grounds: Dict[int, HeightBlocks] = {}
        self._rows: Dict[Hashable, List[int]] = {}      # owner -> its rows
        self._ids: Dict[Hashable, int] = {}             # owner -> its number in the table
        self._next_id = 0
        self._free: List[int] = []
        self._one_row, self._one_pose = np.zeros(1, np.int64), np.zeros((1, 7))

    def __len__(self) -> int:
        return sum(len(rows) for rows in self._rows.values())

    @property
    def capacity(self) -> int:
        """Number of rows in the table."""
        return self.shapes.shape[0]

    def add(self, geometry: Geometry, pose: Pose, owner: Hashable, retro: float = 0.0) -> int:
        """Add a shape to the scene.

        Parameters
        ----------
        geometry : Box, Sphere, Cylinder, Plane, Mesh or Heightmap
            See :mod:`m2wr_sim.model.types`.  A plane is infinite; its normal is in world axes and its offset comes
            from the position of ``pose``.
        pose : ((x, y, z), (x, y, z, w))
            Pose of the shape in the world.
        owner : hashable
            Owner of the shape, for ``remove_owner`` and ``ignore_owner``.
        retro : float
            laser_retro of the shape: the intensity of a hit.

        Returns
        -------
        int
            Row of the shape, for ``set_pose``.

        Raises
        ------
        TypeError
            If this kind of geometry is not supported.
        ValueError
            If a size is negative or not finite, a plane's normal is zero, or a mesh has no triangle.
        """
        return self.add_all([(geometry, pose, retro)], owner)[0]

    def add_all(self, parts: Sequence[Tuple[Geometry, Pose, float]], owner: Hashable) -> List[int]:
        """Add several shapes of one owner, which is faster than one by one.

        Parameters
        ----------
        parts : sequence of (geometry, pose, retro)
            See :meth:`add`.
        owner : hashable

        Returns
        -------
        list of int
            Rows of the shapes.

        Raises
        ------
        TypeError, ValueError
            As :meth:`add`.
        """
        if not parts:
            return []
        packed_parts = [None if isinstance(geometry, (Mesh, Heightmap)) else _pack(geometry)
                        for geometry, _, _ in parts]
        if owner not in self._ids:
            self._ids[owner], self._rows[owner] = self._next_id, []
            self._next_id += 1
        number, poses, rows = float(self._ids[owner]), [], []
        for (geometry, pose, retro), entry in zip(parts, packed_parts):
            tree, blocks = 0, None
            if isinstance(geometry, Heightmap):
                blocks = blocks_of(geometry)
                entry = GROUND, blocks.radius, tuple(blocks.middle)
            elif entry is None:
                tree, packed_tree = self.forest.add(cast(Mesh, geometry))
                entry = MESH, packed_tree.radius, tuple(packed_tree.middle)
            kind, radius, values = entry
            row = self._take_row()
            if blocks is not None:
                self.grounds[row] = blocks
            words = [0.0] * SHAPE_SIZE
            first = 0 if kind == PLANE else HALF
            words[first:first + 3] = values
            words[TREE], words[KIND], words[RETRO], words[OWNER] = tree, kind, retro, number
            self.shapes[row] = words
            self._rows[owner].append(row)
            self.spheres[3, row] = radius
            self.has_retro = self.has_retro or retro != 0.0
            rows.append(row)
            poses.append((*pose[0], *pose[1]))
        self.set_poses(np.array(rows, np.int64), np.array(poses, dtype=float))
        return rows

    def remove_owner(self, owner: Hashable) -> None:
        """Remove all shapes of ``owner``; their rows may be used again.  An unknown owner is not an error."""
        rows = self._rows.pop(owner, [])
        self._ids.pop(owner, None)
        for row in rows:
            if self.shapes[row, KIND] == MESH:
                self.forest.remove(int(self.shapes[row, TREE]))
            self.grounds.pop(row, None)
            self.shapes[row, KIND] = SPHERE
            self.spheres[:, row] = np.nan
            self.shapes[row, RETRO] = 0.0
            self.shapes[row, OWNER] = -1.0
            self.moves[row] = False
        self._free.extend(rows)
        self.resting_version += 1
        self.has_retro = bool(np.any(self.shapes[:self.count, RETRO]))
        self.version += 1

    def rows_of(self, owner: Hashable) -> Tuple[int, ...]:
        """Return the rows of ``owner`` in the order in which they were added."""
        return tuple(self._rows.get(owner, ()))

    def owner_id(self, owner: Hashable) -> int:
        """Return the number of ``owner`` in the table, -1 if it has no shapes."""
        return self._ids.get(owner, -1)

    def set_pose(self, row: int, position: Tuple[float, float, float],
                 quaternion: Tuple[float, float, float, float]) -> None:
        """Move one shape.

        Parameters
        ----------
        row : int
            As returned by ``add``.
        position : (3,) sequence of float
            In the world [m].
        quaternion : (4,) sequence of float
            Orientation in the world, x y z w.
        """
        self._one_row[0], self._one_pose[0, :3], self._one_pose[0, 3:] = row, position, quaternion
        self.set_poses(self._one_row, self._one_pose)

    def set_poses(self, rows: Rows, poses: Floats) -> None:
        """Move many shapes.

        Parameters
        ----------
        rows : (n,) int64
            Rows as returned by ``add``; rows outside the table are ignored.
        poses : (n, 7) float64
            Positions in the world [m] and quaternions x y z w of any length but 0.  A shape with a pose that is not
            finite is invisible.

        Raises
        ------
        ValueError
            If the shape of ``poses`` differs from the above.
        """
        if poses.shape != (len(rows), 7):
            raise ValueError("scene poses for %d rows: %s, expected (%d, 7)" % (len(rows), poses.shape, len(rows)))
        write_poses(self.spheres, self.shapes, rows, poses)
        self.version += 1
        self.resting_version += 1

    def mark_moving(self, rows: Sequence[int]) -> None:
        """Say that shapes move often, so that sensors always look at them; by default a shape rests.

        Parameters
        ----------
        rows : sequence of int
            As returned by ``add``.
        """
        self.moves[list(rows)] = True
        self.resting_version += 1

    def mover(self, rows: Rows, poses: Floats) -> Callable[[], None]:
        """Return a faster replacement for :meth:`set_poses` that always uses the same two arrays.

        Parameters
        ----------
        rows : (n,) int64
            C-contiguous.
        poses : (n, 7) float64
            C-contiguous.

        Returns
        -------
        callable
            ``move()`` moves the shapes to what is in ``poses`` at that time.

        Raises
        ------
        ValueError
            If the shape, type or memory layout of an array is wrong.
        """
        if rows.dtype != np.int64 or poses.dtype != np.float64 or poses.shape != (rows.size, 7) or not (
                rows.flags.c_contiguous and poses.flags.c_contiguous):
            raise ValueError("scene poses for %d rows: %s of %s, expected (%d, 7) of float64"
                             % (rows.size, poses.shape, poses.dtype, rows.size))
        return ShapeMover(self, rows, poses) if packed.COMPILED else lambda: self.set_poses(rows, poses)

    def _take_row(self) -> int:
        if self._free:
            return self._free.pop()
        if self.count == self.capacity:
            self.spheres = np.concatenate((self.spheres, np.full_like(self.spheres, np.nan)), axis=1)
            self.shapes = np.concatenate((self.shapes, np.zeros_like(self.shapes)))
            self.moves = np.concatenate((self.moves, np.zeros_like(self.moves)))
            self.order = np.empty((2, len(self.moves)), np.int32)
        self.count += 1
        return self.count - 1


class ShapeMover:
    """Moves shapes of a scene to the poses in an array, by compiled code.

    Parameters
    ----------
    scene : RayScene
    rows : (n,) int64
    poses : (n, 7) float64
        See :meth:`RayScene.mover`.

    Attributes
    ----------
    block : (MOVE_WORDS,) uint64
        Arguments of :func:`m2wr_sim.sensors.packed_kernels.move`, after :meth:`update`.
    rests : bool
        Whether one of the shapes is not marked as moving.
    """

    def __init__(self, scene: RayScene, rows: Rows, poses: Floats) -> None:
        self._scene, self._rows, self._poses = scene, rows, poses
        self._table: Optional[Floats] = None
        self.rests = not scene.moves[rows[(rows >= 0) & (rows < len(scene.moves))]].all()
        self.block = np.zeros(packed.MOVE_WORDS, np.uint64)

    def update(self) -> None:
        """Write the addresses of the scene's table, which is replaced when it grows."""
        scene = self._scene
        if self._table is not scene.shapes:
            self._table = scene.shapes
            self.block[:] = (scene.spheres.ctypes.data, scene.shapes.ctypes.data, scene.shapes.shape[0],
                             self._rows.ctypes.data, self._poses.ctypes.data, self._rows.size)

    def __call__(self) -> None:
        self.update()
        packed.move(self.block)
        self._scene.version += 1
        if self.rests:
            self._scene.resting_version += 1


def _pack(geometry: Primitive) -> Tuple[int, float, Tuple[float, ...]]:
    """Return kind, bounding radius and three values (half sizes, or the unit normal of a plane) of a geometry."""
    values: Tuple[float, ...]
    if isinstance(geometry, Box):
        kind, values = BOX, tuple(0.5 * float(size) for size in geometry.size)
        radius = math.sqrt(sum(value * value for value in values))
    elif isinstance(geometry, Sphere):
        radius = float(geometry.radius)
        kind, values = SPHERE, (radius, radius, radius)
    elif isinstance(geometry, Cylinder):
        kind, values = CYLINDER, (float(geometry.radius), float(geometry.radius), 0.5 * float(geometry.length))
        radius = math.hypot(values[0], values[2])
    elif isinstance(geometry, Plane):
        length = math.hypot(*map(float, geometry.normal))
        if not 0.0 < length < math.inf:
            raise ValueError("plane normal %r: expected a finite vector that is not zero" % (geometry.normal,))
        return PLANE, math.inf, tuple(value / length for value in geometry.normal)
    else:
        raise TypeError("a laser scanner cannot see a %s: expected Box, Sphere, Cylinder, Plane, Mesh or Heightmap"
                        % type(geometry).__name__)
    if not all(0.0 <= value < math.inf for value in values):
        raise ValueError("%r: expected finite sizes that are not negative" % (geometry,))
    return kind, radius, values

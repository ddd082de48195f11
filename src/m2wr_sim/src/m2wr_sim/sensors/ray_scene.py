# SPDX-License-Identifier: BSD-3-Clause
"""What rays can hit: the collision shapes of all models, packed into the arrays of the ray kernels."""
import math

import numpy as np

from m2wr_sim.model.types import Box, Cylinder, Heightmap, Mesh, Plane, Sphere
from m2wr_sim.sensors import packed_kernels as packed
from m2wr_sim.sensors.mesh_tree import Forest
from m2wr_sim.sensors.ray_kernels import (
    BOX,
    CYLINDER,
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


class RayScene:
    """A table of shapes, one row each; a row keeps its number until its owner is removed.

    Every shape of every model belongs here, those of the robot that carries the sensor too: rays know no owner.

    Parameters
    ----------
    capacity : int
        Rows to reserve; the table grows by itself when they are used up.

    Attributes
    ----------
    spheres, shapes : arrays
        The table in the layout of :mod:`m2wr_sim.sensors.ray_kernels`; replaced when it grows, so ask each time.
    count : int
        Rows in use lie below this number.
    version : int
        Grows with every change.
    has_retro : bool
        Whether any shape reflects more than nothing.
    forest : Forest
        What meshes and heightmaps are made of; false where there are none.
    """

    def __init__(self, capacity=64):
        capacity = max(int(capacity), 1)
        self.spheres = np.full((4, capacity), np.nan)
        self.shapes = np.zeros((capacity, SHAPE_SIZE))
        self.count = 0
        self.version = 0
        self.has_retro = False
        self.forest = Forest()
        self._rows = {}         # owner -> its rows
        self._ids = {}          # owner -> the number that stands for it in the table
        self._next_id = 0
        self._free = []
        self._one_row, self._one_pose = np.zeros(1, np.int64), np.zeros((1, 7))

    def __len__(self):
        return sum(len(rows) for rows in self._rows.values())

    @property
    def capacity(self):
        """Number of rows the table has room for."""
        return self.shapes.shape[0]

    def add(self, geometry, pose, owner, retro=0.0):
        """Put a shape into the scene.

        Parameters
        ----------
        geometry : Box, Sphere, Cylinder, Plane, Mesh or Heightmap
            See :mod:`m2wr_sim.model.types`.  A plane is infinite; its normal is in world axes and its offset comes
            from the position of ``pose``.
        pose : ((x, y, z), (x, y, z, w))
            Of the shape's frame in world.
        owner : hashable
            Whom the shape belongs to, for ``remove_owner`` and ``ignore_owner``.
        retro : float
            The laser_retro that becomes the intensity of a hit.

        Returns
        -------
        int
            Row of the shape, for ``set_pose``.

        Raises
        ------
        TypeError
            If rays cannot meet this kind of geometry.
        ValueError
            If a size is negative or not finite, a plane's normal is zero, or a mesh has no triangle.
        """
        tree = 0
        if isinstance(geometry, (Mesh, Heightmap)):
            kind, (tree, (values, radius, _, _, _)) = MESH, self.forest.add(geometry)
        else:
            kind, radius, values = _pack(geometry)
        row = self._take_row()
        self.shapes[row] = 0.0
        self.shapes[row, TREE] = tree
        if kind == PLANE:
            self.shapes[row, :3] = values
        else:
            self.shapes[row, HALF:HALF + 3] = values
        self.shapes[row, KIND], self.shapes[row, RETRO] = kind, retro
        if owner not in self._ids:
            self._ids[owner], self._rows[owner] = self._next_id, []
            self._next_id += 1
        self.shapes[row, OWNER] = self._ids[owner]
        self._rows[owner].append(row)
        self.spheres[3, row] = radius
        self.has_retro = self.has_retro or retro != 0.0
        self.set_pose(row, pose[0], pose[1])
        return row

    def remove_owner(self, owner):
        """Take all shapes of ``owner`` out; their rows may be given to others.  Unknown owners are no error."""
        rows = self._rows.pop(owner, [])
        self._ids.pop(owner, None)
        for row in rows:
            if self.shapes[row, KIND] == MESH:
                self.forest.remove(int(self.shapes[row, TREE]))
                self.shapes[row, KIND] = SPHERE
            self.spheres[:, row] = np.nan
            self.shapes[row, RETRO] = 0.0
            self.shapes[row, OWNER] = -1.0
        self._free.extend(rows)
        self.has_retro = bool(np.any(self.shapes[:self.count, RETRO]))
        self.version += 1

    def rows_of(self, owner):
        """Return the rows of ``owner`` in the order they were added."""
        return tuple(self._rows.get(owner, ()))

    def owner_id(self, owner):
        """Return the number that stands for ``owner`` in the table, -1 if it has no shapes."""
        return self._ids.get(owner, -1)

    def set_pose(self, row, position, quaternion):
        """Move one shape to a world pose (x, y, z), (x, y, z, w)."""
        self._one_row[0], self._one_pose[0, :3], self._one_pose[0, 3:] = row, position, quaternion
        self.set_poses(self._one_row, self._one_pose)

    def set_poses(self, rows, poses):
        """Move many shapes.

        Parameters
        ----------
        rows : (n,) int64
            Rows as ``add`` returned them; no row outside the table is written.
        poses : (n, 7) float64
            World positions [m] and orientations x y z w, these of any length but 0.  A shape with a pose that is not
            finite is not seen.

        Raises
        ------
        ValueError
            If the shape of ``poses`` differs from the above.
        """
        if poses.shape != (len(rows), 7):
            raise ValueError("scene poses for %d rows: %s, expected (%d, 7)" % (len(rows), poses.shape, len(rows)))
        write_poses(self.spheres, self.shapes, rows, poses)
        self.version += 1

    def mover(self, rows, poses):
        """Return a function that does :meth:`set_poses` of these very arrays, at less cost, whenever it is called.

        Raises
        ------
        ValueError
            If the arrays are not of the shapes and kinds that ``set_poses`` asks for, without gaps.
        """
        if rows.dtype != np.int64 or poses.dtype != np.float64 or poses.shape != (rows.size, 7) or not (
                rows.flags.c_contiguous and poses.flags.c_contiguous):
            raise ValueError("scene poses for %d rows: %s of %s, expected (%d, 7) of float64"
                             % (rows.size, poses.shape, poses.dtype, rows.size))
        if not packed.COMPILED:
            return lambda: self.set_poses(rows, poses)
        block, table = np.zeros(packed.MOVE_WORDS, np.uint64), None

        def move():
            nonlocal table
            if table is not self.shapes:        # it has grown
                table = self.shapes
                block[:] = (self.spheres.ctypes.data, table.ctypes.data, table.shape[0], rows.ctypes.data,
                            poses.ctypes.data, rows.size)
            packed.move(block)
            self.version += 1

        return move

    def _take_row(self):
        if self._free:
            return self._free.pop()
        if self.count == self.capacity:
            self.spheres = np.concatenate((self.spheres, np.full_like(self.spheres, np.nan)), axis=1)
            self.shapes = np.concatenate((self.shapes, np.zeros_like(self.shapes)))
        self.count += 1
        return self.count - 1


def _pack(geometry):
    """Return kind, bounding radius and the three values (half sizes, or a plane's unit normal) of a geometry."""
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
        raise TypeError("rays cannot meet a %s: expected Box, Sphere, Cylinder, Plane, Mesh or Heightmap"
                        % type(geometry).__name__)
    if not all(0.0 <= value < math.inf for value in values):
        raise ValueError("%r: expected finite sizes that are not negative" % (geometry,))
    return kind, radius, values

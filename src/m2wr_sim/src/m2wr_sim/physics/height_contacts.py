# SPDX-License-Identifier: BSD-3-Clause
"""Which pairs have contacts by height_kernels, and these contacts for the engine in Python."""
from __future__ import annotations

import ctypes
from typing import TYPE_CHECKING, List, Optional, Tuple

import numpy as np

from m2wr_sim.model.types import Box, Cylinder, Heightmap, Sphere
from m2wr_sim.physics import height_kernels as kernels
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.height_window_kernels import WINDOW

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.physics.contacts import Contact
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.parts import Shape


def kind_of(shape: Shape) -> int:
    """Return the kind of a shape for height_kernels; NO_SHAPE for meshes and planes, which libode collides."""
    geometry = shape.collision.geometry
    if isinstance(geometry, Heightmap):
        return kernels.FIELD
    if isinstance(geometry, Sphere):
        return kernels.SPHERE
    if isinstance(geometry, Cylinder):
        return kernels.WHEEL if shape.wheel else kernels.CYLINDER
    return kernels.BOX if isinstance(geometry, Box) else kernels.NO_SHAPE


def size_of(shape: Shape) -> Tuple[float, float, float]:
    """Return the size of a ball, cylinder or box as height_kernels takes it; zeros for others."""
    geometry = shape.collision.geometry
    if isinstance(geometry, Sphere):
        return (geometry.radius, 0.0, 0.0)
    if isinstance(geometry, Cylinder):
        return (geometry.radius, geometry.length, 0.0)
    return geometry.size if isinstance(geometry, Box) else (0.0, 0.0, 0.0)


def _pose(geom: Geom) -> NDArray[np.float64]:
    """Return position and quaternion x y z w of a geom, read as the compiled callback does."""
    library = native_ode.library()
    library.dGeomGetPosition.restype = ctypes.POINTER(ctypes.c_double)
    library.dGeomGetPosition.argtypes = [ctypes.c_void_p]
    library.dGeomGetQuaternion.argtypes = [ctypes.c_void_p, ctypes.POINTER(ctypes.c_double)]
    quaternion = (ctypes.c_double * 4)()
    library.dGeomGetQuaternion(geom._id(), quaternion)
    return np.array(library.dGeomGetPosition(geom._id())[:3] + quaternion[1:4] + quaternion[:1])


def find(first: Geom, second: Geom, one: Shape, two: Shape) -> Optional[List[Contact]]:
    """Return the contacts of a shape with a heightmap, their normals from the second into the first.

    Parameters
    ----------
    first, second : geom
    one, two : Shape
        Theirs.

    Returns
    -------
    list of (position, normal, depth), or None
        None if libode is to find them.
    """
    kinds = kind_of(one), kind_of(two)
    if kernels.NO_SHAPE in kinds or kinds.count(kernels.FIELD) != 1:
        return None
    field, geom, shape, sign = (first, second, two, -1.0) if kinds[0] == kernels.FIELD else (second, first, one, 1.0)
    found = np.empty((kernels.MOST, kernels.CONTACT))
    data = field.heights                # type: ignore[union-attr]
    count = kernels.height_contacts(data.heights, data.tops, data.cell, _pose(field), kind_of(shape),
                                    np.array(size_of(shape)), _pose(geom), found, np.empty(kernels.WORK),
                                    np.empty(WINDOW, np.int64))
    return [((x, y, z), (sign * nx, sign * ny, sign * nz), depth)
            for x, y, z, nx, ny, nz, depth in found[:count].tolist()]

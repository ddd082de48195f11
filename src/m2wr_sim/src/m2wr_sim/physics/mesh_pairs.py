# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of two meshes for the engine in Python; see :mod:`m2wr_sim.physics.mesh_pair_kernels`."""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Optional

import numpy as np

from m2wr_sim.model.types import Mesh
from m2wr_sim.physics import native_ode
from m2wr_sim.physics.step_layout import GEOMETRY_WORDS, MAX_FOUND, MOST_OF_MESHES

_NUMBERS = [0, 1, 2, 4, 5, 6, 8]        # words with position, normal and depth; the vectors have four words

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.physics.contacts import Contact
    from m2wr_sim.physics.native_shapes import Geom
    from m2wr_sim.physics.parts import Shape


def find(first: Geom, second: Geom, one: Shape, two: Shape) -> Optional[List[Contact]]:
    """Return the contacts of two meshes, their normals from the second into the first.

    Parameters
    ----------
    first, second : geom
    one, two : Shape
        Theirs.

    Returns
    -------
    list of (position, normal, depth), or None
        At most MAX_FOUND.  None if one is no mesh.
    """
    if not (isinstance(one.collision.geometry, Mesh) and isinstance(two.collision.geometry, Mesh)):
        return None
    found = np.empty((MOST_OF_MESHES, GEOMETRY_WORDS))
    count = native_ode.library().dCollide(first._id(), second._id(), MOST_OF_MESHES, found.ctypes.data,
                                          8 * GEOMETRY_WORDS)
    rows = deepest(found[:count, _NUMBERS]).tolist()
    return [((x, y, z), (nx, ny, nz), depth) for x, y, z, nx, ny, nz, depth in rows]


def deepest(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the MAX_FOUND deepest contacts, in the order in which they were.

    Parameters
    ----------
    rows : (N, 7) float64
        Position, normal, depth.
    """
    if len(rows) <= MAX_FOUND:
        return rows
    chosen: NDArray[np.float64] = rows[np.sort(np.argsort(-rows[:, 6], kind="mergesort")[:MAX_FOUND])]
    return chosen

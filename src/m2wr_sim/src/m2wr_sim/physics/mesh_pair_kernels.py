# SPDX-License-Identifier: BSD-3-Clause
"""Contacts of two meshes: libode finds all of them, and the deepest are kept.

If libode finds more contacts of two meshes than it has room for, it has to forget the shallowest ones, and its list of
them becomes inconsistent: an assertion in ``collision_trimesh_trimesh.cpp`` of version 0.16 ends the process.  So it
gets all the room that it can use.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit, types

from m2wr_sim.physics.step_layout import C_GEOMETRY, CONTACT_WORDS, GEOMETRY_WORDS, MAX_FOUND, MOST_OF_MESHES, TRIMESH

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]

_handle = types.uintp
_geom_class = types.ExternalFunction("dGeomGetClass", types.int32(_handle))
_collide = types.ExternalFunction("dCollide", types.int32(_handle, _handle, types.int32, _handle, types.int32))
_DEPTH = 8                      # word of the depth in a dContactGeom


@njit(cache=True, nogil=True, error_model="numpy")
def are_meshes(one: int, two: int) -> bool:
    """Return whether two geoms are meshes.

    Parameters
    ----------
    one, two : int
        Native handles.
    """
    return bool(_geom_class(one) == TRIMESH and _geom_class(two) == TRIMESH)


@njit(cache=True, nogil=True, error_model="numpy")
def mesh_contacts(words: Words, first: int, one: int, two: int) -> int:
    """Write the contacts of two meshes, at most MAX_FOUND: if there are more, the deepest, in the order of libode.

    Parameters
    ----------
    words : (W,) uint64
        The block.
    first : int
        Word of the first contact.
    one, two : int
        Native handles of the geoms.

    Returns
    -------
    int
        Number of contacts.
    """
    found = np.empty((MOST_OF_MESHES, GEOMETRY_WORDS), np.uint64)
    count = np.int64(_collide(one, two, MOST_OF_MESHES, found.ctypes.data, 8 * GEOMETRY_WORDS))
    chosen = np.arange(count)
    if count > MAX_FOUND:
        depths = found.view(np.float64)[:count, _DEPTH].copy()
        chosen = np.sort(np.argsort(-depths, kind="mergesort")[:MAX_FOUND])
    for index in range(len(chosen)):
        for word in range(GEOMETRY_WORDS):
            words[first + index * CONTACT_WORDS + C_GEOMETRY + word] = found[chosen[index], word]
    return len(chosen)

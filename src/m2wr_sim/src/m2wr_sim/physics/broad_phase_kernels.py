# SPDX-License-Identifier: BSD-3-Clause
"""Broad-phase bounds: a model with no static shape near it is tested for collisions only with the ground plane.

Each body has a cube as bounds: around the sphere that contains its geoms in any orientation, enlarged by
:data:`MARGIN`. If no static shape but the plane overlaps the bounds of a model, and no body has moved by more than the
margin, its geoms are tested only against the plane.  The order is that of libode, so that the results are the same to
the last bit.  A sleeping model that no other one can reach is not tested at all: libode does not solve it.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numba import carray, cfunc, njit, types

from m2wr_sim.physics.step_layout import (
    BOUNDS_WORDS,
    H_ADDRESS,
    H_BODIES,
    H_BODY_COUNT,
    H_BOUNDS,
    H_FOUND,
    H_PLANE,
    H_PROBE,
    H_PROBE_CALLBACK,
    H_STATIC,
    HEADER_WORDS,
    S_BODY_COUNT,
    S_FIRST_BODY,
    S_FREE,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

MARGIN = 0.25           # m; a robot at 1 m/s computes its bounds about four times per second

_handle = types.uintp
_position = types.ExternalFunction("dBodyGetPosition", types.CPointer(types.float64)(_handle))
_is_enabled = types.ExternalFunction("dBodyIsEnabled", types.int32(_handle))
_space_collide2 = types.ExternalFunction("dSpaceCollide2", types.void(_handle, _handle, _handle, _handle))
_set_lengths = types.ExternalFunction(
    "dGeomBoxSetLengths", types.void(_handle, types.float64, types.float64, types.float64))
_set_position = types.ExternalFunction(
    "dGeomSetPosition", types.void(_handle, types.float64, types.float64, types.float64))


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def count_solids(data: Any, one: int, two: int) -> None:
    """ODE's near callback for the bounds of a body: count the shapes other than the plane.

    Parameters
    ----------
    data : pointer
        The block.
    one, two : int
        Native handles of two geoms.
    """
    header = carray(data, (HEADER_WORDS,), np.uint64)
    if one != header[H_PLANE] and two != header[H_PLANE]:
        header[H_FOUND] += np.uint64(1)


@njit(cache=True, nogil=True, error_model="numpy")
def is_free(words: Words, values: Values, row: int) -> bool:
    """Return whether a model can collide with no static shape but the plane.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    row : int
        Row of the model in ``H_SPACES``.

    Returns
    -------
    bool
    """
    first, count = np.int64(words[row + S_FIRST_BODY]), np.int64(words[row + S_BODY_COUNT])
    bodies, bounds = np.int64(words[H_BODIES]) + first, np.int64(words[H_BOUNDS]) + first * BOUNDS_WORDS
    inside = True
    for index in range(count):
        at, bound = carray(_position(words[bodies + index]), (3,)), bounds + index * BOUNDS_WORDS
        away = max(abs(at[0] - values[bound + 1]), abs(at[1] - values[bound + 2]), abs(at[2] - values[bound + 3]))
        inside = inside and away <= MARGIN
    if not inside:
        words[H_FOUND] = np.uint64(0)
        for index in range(count):
            at, bound = carray(_position(words[bodies + index]), (3,)), bounds + index * BOUNDS_WORDS
            values[bound + 1], values[bound + 2], values[bound + 3] = at[0], at[1], at[2]
            edge = 2.0 * (values[bound] + MARGIN)
            _set_lengths(words[H_PROBE], edge, edge, edge)
            _set_position(words[H_PROBE], at[0], at[1], at[2])
            _space_collide2(words[H_PROBE], words[H_STATIC], words[H_ADDRESS], words[H_PROBE_CALLBACK])
        words[row + S_FREE] = np.uint64(words[H_FOUND] == 0)
    return words[row + S_FREE] != 0


@njit(cache=True, nogil=True, error_model="numpy")
def sleeps_apart(words: Words, values: Values, row: int) -> bool:
    """Return whether a model sleeps and no geom of another model can collide with it.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    row : int
        Row of the model in ``H_SPACES``.

    Returns
    -------
    bool
    """
    first, count = np.int64(words[row + S_FIRST_BODY]), np.int64(words[row + S_BODY_COUNT])
    bodies, bounds = np.int64(words[H_BODIES]), np.int64(words[H_BOUNDS])
    for index in range(first, first + count):
        if _is_enabled(words[bodies + index]):
            return False
    for index in range(first, first + count):
        at, reach = carray(_position(words[bodies + index]), (3,)), values[bounds + index * BOUNDS_WORDS]
        for other in range(np.int64(words[H_BODY_COUNT])):
            if first <= other < first + count:
                continue
            there = carray(_position(words[bodies + other]), (3,))
            away = max(abs(at[0] - there[0]), abs(at[1] - there[1]), abs(at[2] - there[2]))
            if not away > reach + values[bounds + other * BOUNDS_WORDS]:
                return False
    return True

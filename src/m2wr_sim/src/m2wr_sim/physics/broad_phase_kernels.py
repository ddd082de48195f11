# SPDX-License-Identifier: BSD-3-Clause
"""Models with nothing near them need not ask the whole static space what they touch: it can only be the ground plane.

Each body of a model has broad-phase bounds, a cube: the sphere that holds the body's geoms, however it turns, and
:data:`MARGIN` more.  While no static shape but the plane reaches into the bounds of a model and no body has moved by
more than the margin, its geoms are offered to the plane alone, in the order in which libode would do it, so that the
numbers stay what they are, to the last bit.  A model that sleeps where no other can reach it is offered to nothing:
libode leaves it out of the step, and its contacts with it.
"""
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

MARGIN = 0.25           # m; a robot that goes 1 m/s looks about four times a second

_handle = types.uintp
_position = types.ExternalFunction("dBodyGetPosition", types.CPointer(types.float64)(_handle))
_is_enabled = types.ExternalFunction("dBodyIsEnabled", types.int32(_handle))
_space_collide2 = types.ExternalFunction("dSpaceCollide2", types.void(_handle, _handle, _handle, _handle))
_set_lengths = types.ExternalFunction(
    "dGeomBoxSetLengths", types.void(_handle, types.float64, types.float64, types.float64))
_set_position = types.ExternalFunction(
    "dGeomSetPosition", types.void(_handle, types.float64, types.float64, types.float64))


@cfunc(types.void(types.voidptr, _handle, _handle), cache=True, error_model="numpy")
def count_solids(data, one, two):
    """ODE's near callback for the bounds of a body: count what is not the plane."""
    header = carray(data, (HEADER_WORDS,), np.uint64)
    if one != header[H_PLANE] and two != header[H_PLANE]:
        header[H_FOUND] += np.uint64(1)


@njit(cache=True, nogil=True, error_model="numpy")
def is_free(words, values, row):
    """Tell whether nothing but the plane can touch the model whose row among the spaces this is."""
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
def sleeps_apart(words, values, row):
    """Tell whether the model of a row sleeps and the geoms of no other model can touch it, asleep or awake."""
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

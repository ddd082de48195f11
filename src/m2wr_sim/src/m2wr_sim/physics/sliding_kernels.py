# SPDX-License-Identifier: BSD-3-Clause
"""Compiled version of sliding, friction of wheels that slide, with the same order of operations.

See step_layout for the block of memory.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np
from numba import carray, njit, types

from m2wr_sim.physics.step_layout import (
    C_ALONG,
    C_MODE,
    C_NORMAL,
    C_POSITION,
    C_SLIP1,
    C_SLIP2,
    G_BODY,
    H_ADDRESS,
    H_STEPS,
    L_AT,
    L_FORCE,
    L_NORMAL,
    L_OTHER,
    L_ROOM,
    L_STEP,
    MODE_FDIR1,
    P_MU,
    P_MU2,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Words = NDArray[np.uint64]
    Values = NDArray[np.float64]

_SLOWEST = 1e-6         # as in sliding

_handle = types.uintp
_numbers = types.CPointer(types.float64)
_position = types.ExternalFunction("dBodyGetPosition", _numbers(_handle))
_linear_velocity = types.ExternalFunction("dBodyGetLinearVel", _numbers(_handle))
_angular_velocity = types.ExternalFunction("dBodyGetAngularVel", _numbers(_handle))
_set_feedback = types.ExternalFunction("dJointSetFeedback", types.void(_handle, _handle))


@njit(cache=True, nogil=True, error_model="numpy")
def _point_velocity(values: Values, body: int, at: int) -> Tuple[float, float, float]:
    """Return the velocity of a body at the position of the contact at word ``at``; zeros for the world."""
    if body == 0:
        return 0.0, 0.0, 0.0
    centre, linear = carray(_position(body), (3,)), carray(_linear_velocity(body), (3,))
    rate = carray(_angular_velocity(body), (3,))
    x = values[at + C_POSITION] - centre[0]
    y, z = values[at + C_POSITION + 1] - centre[1], values[at + C_POSITION + 2] - centre[2]
    return (linear[0] + (rate[1] * z - rate[2] * y), linear[1] + (rate[2] * x - rate[0] * z),
            linear[2] + (rate[0] * y - rate[1] * x))


@njit(cache=True, nogil=True, error_model="numpy")
def slide(words: Words, values: Values, geom_one: int, geom_two: int, other: int, load: int, pair: int,
          at: int) -> None:
    """Set the friction of the contact of a wheel by its slip, and by its load in the last step if that is known.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    geom_one, geom_two : int
        Words of the geoms in ``H_GEOMS``.
    other : int
        Row of the geom that is no wheel, from 1.
    load : int
        Word of the wheel's row in ``H_LOADS``.
    pair : int
        Word of the surface of the pair.
    at : int
        Word of the contact.
    """
    if words[load + L_STEP] + np.uint64(1) != words[H_STEPS] or words[load + L_OTHER] != other:
        return
    force, felt = values[load + L_FORCE], np.int64(words[load + L_AT])
    if felt != 0:
        force = abs(values[felt] * values[load + L_NORMAL] + values[felt + 1] * values[load + L_NORMAL + 1]
                    + values[felt + 2] * values[load + L_NORMAL + 2])
    nx, ny, nz = values[at + C_NORMAL], values[at + C_NORMAL + 1], values[at + C_NORMAL + 2]
    if words[at + C_MODE] & MODE_FDIR1:
        fx, fy, fz = values[at + C_ALONG], values[at + C_ALONG + 1], values[at + C_ALONG + 2]
    elif abs(nz) > math.sqrt(0.5):
        scale = 1.0 / math.sqrt(ny * ny + nz * nz)
        fx, fy, fz = 0.0, -nz * scale, ny * scale
    else:
        scale = 1.0 / math.sqrt(nx * nx + ny * ny)
        fx, fy, fz = -ny * scale, nx * scale, 0.0
    x, y, z = _point_velocity(values, words[geom_one + G_BODY], at)
    x2, y2, z2 = _point_velocity(values, words[geom_two + G_BODY], at)
    x, y, z = x - x2, y - y2, z - z2
    along = x * fx + y * fy + z * fz
    across = x * (ny * fz - nz * fy) + y * (nz * fx - nx * fz) + z * (nx * fy - ny * fx)
    mu, mu2 = values[pair + P_MU], values[pair + P_MU2]
    dissipation = math.sqrt(mu * mu * along * along + mu2 * mu2 * across * across)
    if dissipation > _SLOWEST and force > 0.0:
        values[at + C_SLIP1] = max(values[at + C_SLIP1], dissipation / (force * mu * mu))
        values[at + C_SLIP2] = max(values[at + C_SLIP2], dissipation / (force * mu2 * mu2))


@njit(cache=True, nogil=True, error_model="numpy")
def feel_load(words: Words, values: Values, other: int, load: int, at: int, joint: int, feedback: int) -> int:
    """Let the solver store the force on a wheel for the next step; return the address of the joint's feedback.

    Parameters
    ----------
    words : (W,) uint64
    values : (W,) float64
        The block.
    other : int
        Row of the geom that is no wheel, from 1.
    load : int
        Word of the wheel's row in ``H_LOADS``.
    at : int
        Word of the contact.
    joint : int
        Native handle of the contact joint.
    feedback : int
        Address of its feedback if it has one already, else 0.

    Returns
    -------
    int
    """
    if feedback == 0:
        feedback = words[H_ADDRESS] + np.uint64(8 * (load + L_ROOM))
        for word in range(3):
            values[load + L_ROOM + word] = 0.0
        _set_feedback(joint, feedback)
    words[load + L_STEP], words[load + L_OTHER] = words[H_STEPS], other
    words[load + L_AT] = (feedback - words[H_ADDRESS]) // np.uint64(8)
    for axis in range(3):
        values[load + L_NORMAL + axis] = values[at + C_NORMAL + axis]
    return feedback

# SPDX-License-Identifier: BSD-3-Clause
"""Places bodies that nothing pushes and sets their velocities: the formulas of Engine.link_mover, in their order."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np
from numba import njit, types

from m2wr_sim.physics.contact_kernels import rotate

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

MOVED_WORDS = 19
M_ROW, M_BODY, M_POSITION, M_TURN, M_CENTRE, M_SHIFT, M_ROOM = 0, 1, 2, 5, 9, 12, 15
_LEAST_NORM = 1e-12             # as in geometry.normalise_quaternion

_handle = types.uintp
_three = (types.float64, types.float64, types.float64)
_set_position = types.ExternalFunction("dBodySetPosition", types.void(_handle, *_three))
_set_quaternion = types.ExternalFunction("dBodySetQuaternion", types.void(_handle, types.uintp))
_set_linear_velocity = types.ExternalFunction("dBodySetLinearVel", types.void(_handle, *_three))
_set_angular_velocity = types.ExternalFunction("dBodySetAngularVel", types.void(_handle, *_three))
_enable = types.ExternalFunction("dBodyEnable", types.void(_handle))


@njit(cache=True, nogil=True, error_model="numpy")
def place(links: NDArray[np.uint64], motions: Values, chosen: NDArray[np.int64]) -> int:
    """Place the links of models, and set their velocities.

    Parameters
    ----------
    links : (L, MOVED_WORDS) uint64
        Row of the model of each link; its body, 0 if it is gone; as floats: position and orientation x y z w of the
        link in its model, centre of mass in link axes for the velocity, and that of the body; room for four words.
    motions : (S, 13) float64
        Of the models: position, orientation x y z w, linear and angular velocity, in the world.
    chosen : (S,) int64
        1 for the models to be moved.

    Returns
    -------
    int
        How many links were placed.
    """
    values, address, count = links.view(np.float64), links.ctypes.data, 0
    for k in range(links.shape[0]):
        body, motion = links[k, M_BODY], motions[links[k, M_ROW]]
        if chosen[links[k, M_ROW]] != 1 or body == 0:
            continue
        at, turn, room = values[k, M_POSITION:M_TURN], values[k, M_TURN:M_CENTRE], values[k, M_ROOM:]
        lx, ly, lz, lw = motion[3], motion[4], motion[5], motion[6]
        rx, ry, rz, rw = turn[0], turn[1], turn[2], turn[3]
        dx, dy, dz = rotate(lx, ly, lz, lw, at[0], at[1], at[2])
        px, py, pz = motion[0] + dx, motion[1] + dy, motion[2] + dz
        x, y = lw * rx + lx * rw + ly * rz - lz * ry, lw * ry - lx * rz + ly * rw + lz * rx
        z, w = lw * rz + lx * ry - ly * rx + lz * rw, lw * rw - lx * rx - ly * ry - lz * rz
        cx, cy, cz = rotate(x, y, z, w, values[k, M_CENTRE], values[k, M_CENTRE + 1], values[k, M_CENTRE + 2])
        norm = math.sqrt(x * x + y * y + z * z + w * w)
        if norm < _LEAST_NORM:
            x, y, z, w, norm = 0.0, 0.0, 0.0, 1.0, 1.0
        x, y, z, w = x / norm, y / norm, z / norm, w / norm
        sx, sy, sz = rotate(x, y, z, w, values[k, M_SHIFT], values[k, M_SHIFT + 1], values[k, M_SHIFT + 2])
        _set_position(body, px + sx, py + sy, pz + sz)
        room[0], room[1], room[2], room[3] = w, x, y, z
        _set_quaternion(body, np.uintp(address + 8 * (k * MOVED_WORDS + M_ROOM)))
        ax, ay, az = px + cx - motion[0], py + cy - motion[1], pz + cz - motion[2]
        wx, wy, wz = motion[10], motion[11], motion[12]
        _set_linear_velocity(body, motion[7] + (wy * az - wz * ay), motion[8] + (wz * ax - wx * az),
                             motion[9] + (wx * ay - wy * ax))
        _set_angular_velocity(body, wx, wy, wz)
        _enable(body)
        count += 1
    return count

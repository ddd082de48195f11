# SPDX-License-Identifier: BSD-3-Clause
"""Steps many worlds by compiled code, without Python between two of them.

``rows`` (n, QUIET_WORDS) uint64 has a row of addresses and sizes for each world, see the ``Q_`` names.  The caller
keeps all arrays alive, and writes a row again when one of them is replaced.  Worlds are named by their row.

The kernels have the options of those in :mod:`m2wr_sim.physics.step_kernels`.  A function inherits ``fastmath`` from
the first one that calls it, and keeps it in the cache: with it the engine's steps would have other bits.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import carray, njit

from m2wr_sim.physics.step_kernels import read_motion, read_poses, run, set_hinge_rate
from m2wr_sim.physics.step_layout import SHAPE_WORDS
from m2wr_sim.sensors.base_kernels import pointer
from m2wr_sim.sensors.packed_kernels import MOVE_WORDS, S_RANGES, SCAN_WORDS, move, scan  # noqa: F401

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Rows = NDArray[np.uint64]
    Numbers = NDArray[np.int64]

#: Block of the engine and its size; native handles of the driven hinges; tables and results of the readers of the
#: robot's motion, of the laser's pose and of the moving shapes, whose number comes last; arguments of move and scan.
(Q_BLOCK, Q_SIZE, Q_LEFT, Q_RIGHT, Q_ROBOT, Q_MOTION, Q_LASER, Q_LASER_POSE, Q_SHAPES, Q_POSES, Q_SHAPE_COUNT,
 Q_MOVE) = range(12)
Q_SCAN = Q_MOVE + MOVE_WORDS
QUIET_WORDS = Q_SCAN + SCAN_WORDS


@njit(cache=True, nogil=True, error_model="numpy")
def drive_all(rows: Rows, chosen: Numbers, counts: Numbers, rates: NDArray[np.float64], taken: Numbers) -> None:
    """Make steps with the old rates of the wheels, then set new ones, and make further steps.

    Parameters
    ----------
    rows : (n, QUIET_WORDS) uint64
    chosen : (k,) int64
        Which worlds.
    counts : (n, 2) int64
        Numbers of steps before and after the change; the second is not made if the first ends early.
    rates : (n, 2) float64
        Rates of the left and the right wheel [rad/s].
    taken : (n, 2) int64
        Written: what :func:`m2wr_sim.physics.step_kernels.run` has returned, 0 if it was not called.
    """
    for k in range(chosen.size):
        index = chosen[k]
        words = carray(pointer(rows[index, Q_BLOCK]), (np.int64(rows[index, Q_SIZE]),), np.uint64)
        before, after = counts[index, 0], counts[index, 1]
        taken[index, 0] = run(words, before) if before > 0 else 0
        taken[index, 1] = 0
        if taken[index, 0] == before and after > 0:
            set_hinge_rate(rows[index, Q_LEFT], rates[index, 0])
            set_hinge_rate(rows[index, Q_RIGHT], rates[index, 1])
            taken[index, 1] = run(words, after)


@njit(cache=True, nogil=True, error_model="numpy")
def read_all(rows: Rows, chosen: Numbers) -> None:
    """Read the motions of the robots, into the arrays of their readers.

    Parameters
    ----------
    rows : (n, QUIET_WORDS) uint64
    chosen : (k,) int64
        Which worlds.
    """
    for k in range(chosen.size):
        row = rows[chosen[k]]
        read_motion(carray(pointer(row[Q_ROBOT]), (1, SHAPE_WORDS), np.uint64),
                    carray(pointer(row[Q_MOTION]), (1, 13), np.float64))


@njit(cache=True, nogil=True, error_model="numpy")
def scan_all(rows: Rows, chosen: Numbers) -> None:
    """Take a scan in each world, after all its moving shapes have been moved to where their bodies are.

    Parameters
    ----------
    rows : (n, QUIET_WORDS) uint64
    chosen : (k,) int64
        Which worlds.
    """
    for k in range(chosen.size):
        row = rows[chosen[k]]
        read_poses(carray(pointer(row[Q_LASER]), (1, SHAPE_WORDS), np.uint64),
                   carray(pointer(row[Q_LASER_POSE]), (1, 7), np.float64))
        count = np.int64(row[Q_SHAPE_COUNT])
        read_poses(carray(pointer(row[Q_SHAPES]), (count, SHAPE_WORDS), np.uint64),
                   carray(pointer(row[Q_POSES]), (count, 7), np.float64))
        move(row[Q_MOVE:Q_SCAN])
        scan(row[Q_SCAN:])

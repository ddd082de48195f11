# SPDX-License-Identifier: BSD-3-Clause
"""Kernels for scans and moving shapes with packed arguments: one array of addresses and sizes.

Passing an array to compiled code takes about 50 ns, a call another 100 ns, and a scan needs a dozen arrays.  The caller
that fills a block must keep the arrays alive, and must fill the block again when an array is replaced.  These kernels
exist only as compiled code.  Without numba, or with its compiler switched off, the plain kernels are called instead.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_sim.sensors.base_kernels import HAVE_NUMBA, kernel
from m2wr_sim.sensors.ray_kernels import FRAME_SIZE, SHAPE_SIZE, cast_rays, write_poses
from m2wr_sim.sensors.reading_kernels import SETTINGS_SIZE, finish_ranges

if TYPE_CHECKING:
    from numpy.typing import NDArray

if HAVE_NUMBA:
    from numba import carray

    from m2wr_sim.sensors.base_kernels import pointer

(S_DISTANCES, S_RANGES, S_BEAMS, S_BEAM_COUNT, S_ROWS, S_ROW_COUNT, S_FRAME, S_SPHERES, S_SHAPES, S_CAPACITY, S_ORDER,
 S_NORMALS, S_NORMAL_COUNT, S_SETTINGS, S_NEAR, S_NEAR_COUNT, SCAN_WORDS) = range(17)
(M_SPHERES, M_SHAPES, M_CAPACITY, M_ROWS, M_POSES, M_COUNT, MOVE_WORDS) = range(7)


@kernel
def scan(block: NDArray[np.uint64]) -> None:
    """Cast all beams and compute the range readings; ``block`` is (SCAN_WORDS,) uint64, see the ``S_`` names.

    Calls :func:`~m2wr_sim.sensors.ray_kernels.cast_rays` without hits, then
    :func:`~m2wr_sim.sensors.reading_kernels.finish_ranges`.  For scenes without meshes and reflecting shapes.
    """
    beams, rows, capacity = np.int64(block[S_BEAM_COUNT]), np.int64(block[S_ROW_COUNT]), np.int64(block[S_CAPACITY])
    distances = carray(pointer(block[S_DISTANCES]), (rows * beams,), np.float64)
    cast_rays(distances, carray(pointer(block[S_DISTANCES]), (0,), np.int64),
              carray(pointer(block[S_BEAMS]), (2, beams), np.float64),
              carray(pointer(block[S_ROWS]), (rows, 2), np.float64),
              carray(pointer(block[S_FRAME]), (FRAME_SIZE,), np.float64),
              carray(pointer(block[S_SPHERES]), (4, capacity), np.float64),
              carray(pointer(block[S_SHAPES]), (capacity, SHAPE_SIZE), np.float64),
              carray(pointer(block[S_ORDER]), (2, capacity), np.int32),
              carray(pointer(block[S_NEAR]), (np.int64(block[S_NEAR_COUNT]),), np.int32))
    finish_ranges(carray(pointer(block[S_RANGES]), (rows * beams,), np.float32), distances,
                  carray(pointer(block[S_NORMALS]), (np.int64(block[S_NORMAL_COUNT]),), np.float64),
                  carray(pointer(block[S_SETTINGS]), (SETTINGS_SIZE,), np.float64))


@kernel
def move(block: NDArray[np.uint64]) -> None:
    """Call :func:`~m2wr_sim.sensors.ray_kernels.write_poses`; ``block`` is (MOVE_WORDS,) uint64, see ``M_`` names."""
    capacity, count = np.int64(block[M_CAPACITY]), np.int64(block[M_COUNT])
    write_poses(carray(pointer(block[M_SPHERES]), (4, capacity), np.float64),
                carray(pointer(block[M_SHAPES]), (capacity, SHAPE_SIZE), np.float64),
                carray(pointer(block[M_ROWS]), (count,), np.int64),
                carray(pointer(block[M_POSES]), (count, 7), np.float64))


COMPILED = hasattr(scan, "signatures")      # False without numba, or if its compiler is switched off

# SPDX-License-Identifier: BSD-3-Clause
"""The kernels of a scan and of moving shapes with their arguments packed: each gets one array of addresses and sizes.

To hand an array to compiled code costs some 50 ns, a call 100 more, and a scan needs a dozen arrays.  Whoever fills a
block keeps the arrays alive whose addresses stand there, and fills it anew when one is replaced.  Compiled code only:
without numba, or with its compiler switched off, the kernels themselves are called.
"""
import numpy as np

from m2wr_sim.sensors.base_kernels import HAVE_NUMBA, kernel
from m2wr_sim.sensors.ray_kernels import FRAME_SIZE, SHAPE_SIZE, cast_rays, write_poses
from m2wr_sim.sensors.reading_kernels import SETTINGS_SIZE, finish_ranges

if HAVE_NUMBA:
    from numba import carray

    from m2wr_sim.sensors.base_kernels import pointer

(S_DISTANCES, S_RANGES, S_BEAMS, S_BEAM_COUNT, S_ROWS, S_ROW_COUNT, S_FRAME, S_SPHERES, S_SHAPES, S_CAPACITY, S_ORDER,
 S_NORMALS, S_NORMAL_COUNT, S_SETTINGS, SCAN_WORDS) = range(15)
(M_SPHERES, M_SHAPES, M_CAPACITY, M_ROWS, M_POSES, M_COUNT, MOVE_WORDS) = range(7)


@kernel
def scan(block):
    """Cast all beams of a plain scanner and finish the ranges; ``block`` is (SCAN_WORDS,) uint64, see the ``S_`` names.

    As :func:`~m2wr_sim.sensors.ray_kernels.cast_rays` without hits, then
    :func:`~m2wr_sim.sensors.reading_kernels.finish_ranges`: for scenes without meshes and reflecting shapes.
    """
    beams, rows, capacity = np.int64(block[S_BEAM_COUNT]), np.int64(block[S_ROW_COUNT]), np.int64(block[S_CAPACITY])
    distances = carray(pointer(block[S_DISTANCES]), (rows * beams,), np.float64)
    cast_rays(distances, carray(pointer(block[S_DISTANCES]), (0,), np.int64),
              carray(pointer(block[S_BEAMS]), (2, beams), np.float64),
              carray(pointer(block[S_ROWS]), (rows, 2), np.float64),
              carray(pointer(block[S_FRAME]), (FRAME_SIZE,), np.float64),
              carray(pointer(block[S_SPHERES]), (4, capacity), np.float64),
              carray(pointer(block[S_SHAPES]), (capacity, SHAPE_SIZE), np.float64),
              carray(pointer(block[S_ORDER]), (2, capacity), np.int32))
    finish_ranges(carray(pointer(block[S_RANGES]), (rows * beams,), np.float32), distances,
                  carray(pointer(block[S_NORMALS]), (np.int64(block[S_NORMAL_COUNT]),), np.float64),
                  carray(pointer(block[S_SETTINGS]), (SETTINGS_SIZE,), np.float64))


@kernel
def move(block):
    """Do what :func:`~m2wr_sim.sensors.ray_kernels.write_poses` does; ``block`` is (MOVE_WORDS,) uint64."""
    capacity, count = np.int64(block[M_CAPACITY]), np.int64(block[M_COUNT])
    write_poses(carray(pointer(block[M_SPHERES]), (4, capacity), np.float64),
                carray(pointer(block[M_SHAPES]), (capacity, SHAPE_SIZE), np.float64),
                carray(pointer(block[M_ROWS]), (count,), np.int64),
                carray(pointer(block[M_POSES]), (count, 7), np.float64))


COMPILED = hasattr(scan, "signatures")      # not so without numba, and where its compiler is switched off

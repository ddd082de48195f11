# SPDX-License-Identifier: BSD-3-Clause
"""Lists the shapes around a sensor, so that a scan in a large world does not look at all."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_sim.sensors.base_kernels import kernel
from m2wr_sim.sensors.ray_kernels import COUNT, RANGE_MAX

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel
def list_near(near: NDArray[np.int32], frame: Floats, spheres: Floats, moves: NDArray[np.bool_], margin: float) -> int:
    """List the rows that a sensor can see until it, or a resting shape, has moved.

    Parameters
    ----------
    near : (C,) int32
        Written, at first: the rows that move, and those within reach of the sensor and the margin, ascending.
    frame, spheres : float64
        See :mod:`m2wr_sim.sensors.ray_kernels`.
    moves : (C,) bool
        Which shapes move.
    margin : float
        How far the sensor may then move [m].

    Returns
    -------
    int
        Number of rows that were written.
    """
    found, longest = 0, frame[RANGE_MAX] + margin
    for k in range(min(int(frame[COUNT]), near.shape[0])):
        dx, dy, dz = spheres[0, k] - frame[0], spheres[1, k] - frame[1], spheres[2, k] - frame[2]
        reach = longest + spheres[3, k]
        if moves[k] or dx * dx + dy * dy + dz * dz <= reach * reach:
            near[found] = k
            found += 1
    return found

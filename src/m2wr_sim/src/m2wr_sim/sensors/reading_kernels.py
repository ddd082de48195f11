# SPDX-License-Identifier: BSD-3-Clause
"""Converts distances to range readings with noise and limits.  All arguments are plain arrays."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_sim.sensors.base_kernels import kernel

if TYPE_CHECKING:
    from numpy.typing import NDArray

SETTINGS_SIZE = 6


@kernel
def finish_ranges(out: NDArray[np.float32], ranges: NDArray[np.float64], normals: NDArray[np.float64],
                  settings: NDArray[np.float64]) -> None:
    """Convert distances to range readings.

    A distance from the longest range on gives +inf.  Others get noise and are clipped to the range limits.

    Parameters
    ----------
    out : (B,) float32
        Written: range readings [m].
    ranges : (B,) float64
        Distances [m], each above the shortest range.
    normals : (M,) float64
        Standard normal draws; M is at least B + start where the standard deviation is not 0.
    settings : (6,) float64
        Shortest and longest range, mean error with bias, standard deviation, rounding step (0: no rounding) [m], and
        index of the draw for beam 0.
    """
    shortest, longest, shift, stddev, precision = settings[0], settings[1], settings[2], settings[3], settings[4]
    start = int(settings[5])
    noisy = stddev > 0.0 and start >= 0 and start + ranges.size <= normals.size
    if noisy and not precision > 0.0:       # the usual case has its own loop, so that the compiler vectorises it
        draws = normals[start:start + ranges.size]
        for i in range(ranges.size):
            value = ranges[i] + shift + stddev * draws[i]
            value = value if value > shortest else shortest
            value = value if value < longest else longest
            out[i] = value if ranges[i] < longest else np.inf
        return
    changed = noisy or shift != 0.0 or precision > 0.0
    for i in range(ranges.size):
        value = ranges[i]
        if changed:
            value = value + shift
            if noisy:
                value = value + stddev * normals[start + i]
            if precision > 0.0:
                value = math.floor(value / precision + 0.5) * precision
            value = value if value > shortest else shortest
            value = value if value < longest else longest
        out[i] = value if ranges[i] < longest else np.inf

# SPDX-License-Identifier: BSD-3-Clause
"""Which cells of a grid the beams of a laser cross."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]


@njit(cache=True, nogil=True, error_model='numpy')
def mark_crossed(ranges: Values, along: Values, spacing: float, start: Values, known: NDArray[np.bool_],
                 parts: NDArray[np.int64]) -> int:
    """Mark the cells that beams cross as known.

    Parameters
    ----------
    ranges : (B,) float64
        Lengths of the beams, at most those that are looked at [m].
    along : (B, 2) float64
        Columns and rows that a beam goes in a metre.
    spacing : float
        Between the places of a beam that are looked at [m]: the first one is half of it away.
    start : (2,) float64
        Column and row of the laser.
    known : (H, W) bool
        Changed.
    parts : (P, Q) int64
        Changed: how many cells are known in each of P x Q equal parts of the grid.

    Returns
    -------
    int
        How many of these cells were unknown before.
    """
    rows, columns = known.shape
    high, wide = rows // parts.shape[0], columns // parts.shape[1]
    found = 0
    for beam in range(len(ranges)):
        number = 0
        while True:
            share = (0.5 + number) * spacing
            if not share < ranges[beam]:
                break
            number += 1
            column, row = share * along[beam, 0] + start[0], share * along[beam, 1] + start[1]
            if not (0.0 <= row < rows and 0.0 <= column < columns):
                continue
            if not known[int(row), int(column)]:
                known[int(row), int(column)] = True
                parts[int(row) // high, int(column) // wide] += 1
                found += 1
    return found

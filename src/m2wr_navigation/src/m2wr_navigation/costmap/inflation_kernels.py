# SPDX-License-Identifier: BSD-3-Clause
"""Inflation: costs around lethal cells by the exact Euclidean distance, cut at the inflation radius.

The squared distance is separable: d^2(x, y) = min over dx of dx^2 + g^2(x + dx, y), where g is the distance along the
column. Both passes are plain minima over rows of 16-bit numbers, which the compiler turns into vector instructions.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import INSCRIBED, LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Int16Array, Uint8Array

GREATEST_RADIUS = 120               # cells: the sum of two squares and one more stay below 2^15
_FAR = 32767


@kernel
def cost_table(radius: int, resolution: float, inscribed: float, scaling: float) -> Uint8Array:
    """Return the cost of each squared distance, as costmap_2d's ``InflationLayer::computeCost``.

    Parameters
    ----------
    radius : int
        Inflation radius [cells].
    resolution : float
        [m]
    inscribed : float
        Inscribed radius of the footprint [m].
    scaling : float
        ``cost_scaling_factor`` [1/m].

    Returns
    -------
    (radius^2 + 1,) uint8
    """
    table = np.zeros(radius * radius + 1, np.uint8)
    for square in range(radius * radius + 1):
        distance = math.sqrt(square) * resolution
        if square == 0:
            table[square] = LETHAL
        elif distance <= inscribed:
            table[square] = INSCRIBED
        else:
            table[square] = np.uint8((INSCRIBED - 1) * math.exp(-scaling * (distance - inscribed)))
    return table


# The loops over a row are functions of their own: there the compiler sees that no index is negative, and vectorises.

@kernel
def _start_row(line: Int16Array, source: Uint8Array, above: Int16Array, limit: int) -> None:
    """Write distances downwards: 0 in lethal cells, else one more than above, at most ``limit``."""
    one, zero, lethal = np.int16(1), np.int16(0), np.uint8(LETHAL)
    for column in range(line.shape[0]):
        more = min(np.int16(above[column] + one), limit)
        line[column] = zero if source[column] == lethal else more


@kernel
def _end_row(line: Int16Array, below: Int16Array) -> None:
    """Lower distances to one more than below."""
    one = np.int16(1)
    for column in range(line.shape[0]):
        line[column] = min(np.int16(below[column] + one), line[column])


@kernel
def _square_row(line: Int16Array, limit: int, far: int) -> None:
    """Square distances; those of ``limit`` become ``far``."""
    for column in range(line.shape[0]):
        step = line[column]
        line[column] = far if step >= limit else np.int16(step * step)


@kernel
def _lower_row(best: Int16Array, padded: Int16Array, first: int, second: int, more: int) -> None:
    """Lower ``best`` to the lesser of two shifted rows of ``padded``, plus ``more``."""
    before, after = padded[first:], padded[second:]
    for column in range(best.shape[0]):
        nearer = np.int16(min(before[column], after[column]) + more)
        best[column] = min(nearer, best[column])


@kernel
def _least(line: Int16Array) -> int:
    least = line[0]
    for column in range(line.shape[0]):
        least = min(least, line[column])
    return least


@kernel
def _column_squares(costs: Uint8Array, radius: int, top: int, bottom: int, left: int, right: int) -> Int16Array:
    """Return the squared distance (rows, columns) int16 along the column to a lethal cell; far ones are _FAR."""
    rows = bottom - top
    squares = np.empty((rows, right - left), np.int16)
    limit, far = np.int16(radius + 1), np.int16(_FAR)
    above = np.full(right - left, limit, np.int16)
    for row in range(rows):
        _start_row(squares[row], costs[top + row, left:right], above, limit)
        above = squares[row]
    for row in range(rows - 2, -1, -1):
        _end_row(squares[row], squares[row + 1])
    for row in range(rows):
        _square_row(squares[row], limit, far)
    return squares


@kernel
def _write_row(line: Uint8Array, best: Int16Array, table: Uint8Array, reach: int, inflate_unknown: bool) -> None:
    """Raise the costs of one row."""
    for column in range(line.shape[0]):
        square = best[column]
        if square <= reach:
            new, old = table[square], line[column]
            if old == NO_INFORMATION:
                if new >= INSCRIBED or (inflate_unknown and new > 0):
                    line[column] = new
            elif new > old:
                line[column] = new


@kernel
def inflate(costs: Uint8Array, table: Uint8Array, radius: int, top: int, bottom: int, left: int, right: int,
            inflate_unknown: bool) -> None:
    """Raise the costs of a window by its distance to lethal cells, those around the window included.

    A cost is never lowered. An unknown cell becomes inscribed only, or with ``inflate_unknown`` any cost above 0.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    table : (radius^2 + 1,) uint8
        Of :func:`cost_table`.
    radius : int
        [cells], at most GREATEST_RADIUS.
    top, bottom, left, right : int
        Rows top to bottom - 1 and columns left to right - 1 are written; within the grid.
    inflate_unknown : bool
    """
    if radius <= 0 or bottom <= top or right <= left:
        return
    first, last = max(0, top - radius), min(costs.shape[0], bottom + radius)
    begin, end = max(0, left - radius), min(costs.shape[1], right + radius)
    squares = _column_squares(costs, radius, first, last, begin, end)
    columns, reach = end - begin, radius * radius
    greatest = np.int16(_FAR - reach)
    padded = np.full(columns + 2 * radius, greatest, np.int16)
    middle = padded[radius:radius + columns]
    best = np.empty(columns, np.int16)
    for row in range(top, bottom):
        line = squares[row - first]
        if _least(line) > reach:
            continue
        for column in range(columns):
            middle[column] = min(line[column], greatest)
        best[:] = middle
        for step in range(1, radius + 1):
            _lower_row(best, padded, np.uint64(radius - step), np.uint64(radius + step), np.int16(step * step))
        _write_row(costs[row, left:right], best[left - begin:right - begin], table, reach, inflate_unknown)

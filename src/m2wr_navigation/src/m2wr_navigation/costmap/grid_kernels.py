# SPDX-License-Identifier: BSD-3-Clause
"""Whole grids: combination of layers, translation of occupancy to costs, resampling, counts."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from m2wr_navigation.costmap.cost_layout import FREE, LETHAL, NO_INFORMATION
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array, Uint8Array


@kernel
def _raise_row(line: Uint8Array, other: Uint8Array) -> None:
    for column in range(line.shape[0]):
        # an unknown cell (255) counts as -1 in both: 255 + 1 wraps to 0
        old, new = np.uint8(line[column] + np.uint8(1)), np.uint8(other[column] + np.uint8(1))
        line[column] = np.uint8(max(old, new) - np.uint8(1))


@kernel
def raise_to(costs: Uint8Array, layer: Uint8Array, top: int, bottom: int, left: int, right: int) -> None:
    """Raise costs to those of a layer; unknown cells of the layer write nothing, those of the costs are replaced.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    layer : (H, W) uint8
    top, bottom, left, right : int
        Window, ends excluded.
    """
    for row in range(top, bottom):
        _raise_row(costs[row, left:right], layer[row, left:right])


@kernel
def overwrite(costs: Uint8Array, layer: Uint8Array, top: int, bottom: int, left: int, right: int) -> None:
    """Replace costs by those of a layer where it knows something.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    layer : (H, W) uint8
    top, bottom, left, right : int
        Window, ends excluded.
    """
    for row in range(top, bottom):
        for column in range(left, right):
            if layer[row, column] != NO_INFORMATION:
                costs[row, column] = layer[row, column]


@kernel
def cost_of_occupancy(threshold: int, unknown_value: int, track_unknown: bool, trinary: bool) -> Uint8Array:
    """Return the cost (256,) uint8 of each occupancy, indexed by its byte, as ``StaticLayer::interpretValue``.

    Parameters
    ----------
    threshold : int
        ``lethal_cost_threshold``, 0 to 100.
    unknown_value : int
        ``unknown_cost_value``, -1 to 255.
    track_unknown : bool
        Whether unknown cells stay unknown; otherwise they are free.
    trinary : bool
        Whether cells below the threshold are free; otherwise their costs are in proportion.
    """
    table = np.zeros(256, np.uint8)
    unknown = unknown_value & 255
    for value in range(256):
        if value == unknown:
            table[value] = NO_INFORMATION if track_unknown else FREE
        elif value >= threshold:
            table[value] = LETHAL
        elif not trinary:
            table[value] = np.uint8(value * LETHAL / threshold)
    return table


@kernel
def translate(occupancy: Int8Array, table: Uint8Array, costs: Uint8Array) -> None:
    """Write the cost of each cell of a map.

    Parameters
    ----------
    occupancy : (H, W) int8
        -1 unknown, 0 free to 100 occupied.
    table : (256,) uint8
        Of :func:`cost_of_occupancy`.
    costs : (H, W) uint8
        Written.
    """
    for row in range(occupancy.shape[0]):
        for column in range(occupancy.shape[1]):
            costs[row, column] = table[occupancy[row, column] & 255]


@kernel
def resample(source: Uint8Array, source_resolution: float, source_from_target: FloatArray, target: Uint8Array,
             resolution: float, origin: FloatArray, top: int, bottom: int, left: int, right: int) -> None:
    """Write the costs of a grid into another one that may be turned against it; outside cells become unknown.

    A cell gets the greatest known cost below its four quarter points. They are half a cell apart, so that a source cell
    of the same size cannot fall between them: no obstacle is lost.

    Parameters
    ----------
    source : (h, w) uint8
    source_resolution : float
        [m]
    source_from_target : (3,) float64
        Pose of the target's frame in the source's frame, whose origin is the corner of cell (0, 0) [m, m, rad].
    target : (H, W) uint8
        Written within the window.
    resolution : float
        Of the target [m].
    origin : (2,) float64
        Corner of the target's cell (0, 0) in its frame [m].
    top, bottom, left, right : int
        Window, ends excluded.
    """
    cosine, sine = math.cos(source_from_target[2]), math.sin(source_from_target[2])
    for row in range(top, bottom):
        y = origin[1] + (row + 0.5) * resolution
        for column in range(left, right):
            x = origin[0] + (column + 0.5) * resolution
            greatest = -1
            for k in range(4):
                a, b = x + (k % 2 - 0.5) * 0.5 * resolution, y + (k // 2 - 0.5) * 0.5 * resolution
                across = (source_from_target[0] + cosine * a - sine * b) / source_resolution
                up = (source_from_target[1] + sine * a + cosine * b) / source_resolution
                if 0.0 <= across < source.shape[1] and 0.0 <= up < source.shape[0]:
                    cost = source[int(up), int(across)]
                    if cost != NO_INFORMATION:
                        greatest = max(greatest, int(cost))
            target[row, column] = NO_INFORMATION if greatest < 0 else greatest


@kernel
def forget(costs: Uint8Array, default: int, top: int, bottom: int, left: int, right: int, inside: bool) -> int:
    """Set all cells inside of a window, or all outside of it, to a default.

    Parameters
    ----------
    costs : (H, W) uint8
        Changed.
    default : int
        0 to 255
    top, bottom, left, right : int
        Window, ends excluded.
    inside : bool

    Returns
    -------
    int
        Number of lethal cells among them.
    """
    count = 0
    for row in range(costs.shape[0]):
        for column in range(costs.shape[1]):
            within = top <= row < bottom and left <= column < right
            if within == inside:
                count += costs[row, column] == LETHAL
                costs[row, column] = default
    return count

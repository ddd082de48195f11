# SPDX-License-Identifier: BSD-3-Clause
"""Bounding volume trees of boxes, and the poses of parts.  For the arrays see :mod:`picture_layout`."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_sim.rendering.picture_layout import (
    P_BOX,
    P_HALF,
    P_MIDDLE,
    P_POSITION,
    P_ROTATION,
)
from m2wr_sim.sensors.base_kernels import kernel, rotation

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]
    Whole = NDArray[np.int64]

BITS = 16               # of a coordinate on the Z-order curve


@kernel
def place_parts(parts: Floats, rows: Whole, poses: Floats) -> None:
    """Write poses of parts.

    Parameters
    ----------
    parts : (N, PART_SIZE) float64
        Written.
    rows : (n,) int64
    poses : (n, 7) float64
        Position in the world [m], quaternion x y z w.
    """
    for k in range(rows.shape[0]):
        part = parts[rows[k]]
        matrix = rotation(poses[k, 3], poses[k, 4], poses[k, 5], poses[k, 6])
        for column in range(9):
            part[P_ROTATION + column] = matrix[column]
        for axis in range(3):
            reach = 0.0
            shift = 0.0
            for column in range(3):
                reach += abs(part[P_ROTATION + 3 * axis + column]) * part[P_HALF + column]
                shift += part[P_ROTATION + 3 * axis + column] * part[P_MIDDLE + column]
            part[P_BOX + axis] = reach
            part[P_POSITION + axis] = poses[k, axis] + shift


@kernel
def _spread(value: int) -> int:
    """Return the bits of a number with two zeros between neighbours."""
    found = 0
    for bit in range(BITS):
        found |= ((value >> bit) & 1) << (3 * bit)
    return found


@kernel
def sort_boxes(centres: Floats) -> Whole:
    """Return the order (n,) int64 of points (n, 3) along a Z-order (Morton) curve; those not finite come first."""
    count = centres.shape[0]
    low, extent = np.zeros(3), 1e-300
    for axis in range(3):
        least, most = np.inf, -np.inf
        for k in range(count):
            value = centres[k, axis]
            if abs(value) < 1e300:
                least, most = min(least, value), max(most, value)
        if least < most:
            low[axis], extent = least, max(extent, most - least)
        elif least < np.inf:
            low[axis] = least
    codes = np.zeros(count, np.int64)
    for k in range(count):
        code = 0
        for axis in range(3):
            share = (centres[k, axis] - low[axis]) / extent * (2 ** BITS - 1)
            cell = int(share) if 0.0 <= share < 2.0 ** BITS else 0
            code |= _spread(cell) << axis
        codes[k] = code
    return np.argsort(codes, kind="mergesort")


@kernel
def count_leaves(count: int, leaf: int) -> int:
    """Return the number of leaves of a tree, a power of two.

    Parameters
    ----------
    count : int
        Number of elements.
    leaf : int
        Most elements of a leaf.
    """
    leaves = 1
    while leaves * leaf < count:
        leaves *= 2
    return leaves


@kernel
def fill_nodes(nodes: Floats, leaves: int, centres: Floats, halves: Floats, order: Whole) -> None:
    """Write the boxes of a tree.

    Parameters
    ----------
    nodes : (2 leaves - 1, 6) float64
        Written.
    leaves : int
        A power of two.
    centres, halves : (n, 3) float64
        Boxes of the elements; one that is not finite gets no place in the tree.
    order : (n,) int64
        Order of the elements along the tree.
    """
    count = order.shape[0]
    for leaf in range(leaves):
        node = nodes[leaves - 1 + leaf]
        node[:3], node[3:] = np.inf, -np.inf
        for place in range(leaf * count // leaves, (leaf + 1) * count // leaves):
            k = order[place]
            finite = True
            for axis in range(3):
                finite = finite and abs(centres[k, axis]) + halves[k, axis] < 1e300
            for axis in range(3):
                if finite:
                    node[axis] = min(node[axis], centres[k, axis] - halves[k, axis])
                    node[3 + axis] = max(node[3 + axis], centres[k, axis] + halves[k, axis])
    for k in range(leaves - 2, -1, -1):
        for axis in range(3):
            nodes[k, axis] = min(nodes[2 * k + 1, axis], nodes[2 * k + 2, axis])
            nodes[k, 3 + axis] = max(nodes[2 * k + 1, 3 + axis], nodes[2 * k + 2, 3 + axis])
    for k in range(2 * leaves - 1):         # least and most become centre and half
        for axis in range(3):
            least, most = nodes[k, axis], nodes[k, 3 + axis]
            nodes[k, axis] = 0.5 * (least + most) if least <= most else 0.0
            nodes[k, 3 + axis] = 0.5 * (most - least) if least <= most else -1.0


@kernel
def build_tree(nodes: Floats, order: Whole, parts: Floats, rows: Whole) -> int:
    """Build the tree of some parts, one in a leaf.

    Parameters
    ----------
    nodes : (K, 6) float64
        Written; K is at least twice the number of leaves.
    order : (n,) int64
        Written: the rows in the order of the leaves.
    parts : (N, PART_SIZE) float64
    rows : (n,) int64

    Returns
    -------
    int
        Number of leaves; 0 if there are no parts.
    """
    count = rows.shape[0]
    if count == 0:
        return 0
    centres, halves = np.empty((count, 3)), np.empty((count, 3))
    for k in range(count):
        for axis in range(3):
            centres[k, axis] = parts[rows[k], P_POSITION + axis]
            halves[k, axis] = parts[rows[k], P_BOX + axis]
    places = sort_boxes(centres)
    leaves = count_leaves(count, 1)
    fill_nodes(nodes, leaves, centres, halves, places)
    for k in range(count):
        order[k] = rows[places[k]]
    return leaves

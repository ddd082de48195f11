# SPDX-License-Identifier: BSD-3-Clause
"""A binary heap of numbered items."""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, Int32Array


@kernel
def push(keys: Float32Array, items: Int32Array, count: int, key: float, item: int) -> int:
    """Add an item to a binary heap with room for it.

    Parameters
    ----------
    keys : (N,) float32
        Changed.
    items : (N,) int32
        Changed.
    count : int
        Items in the heap.
    key : float
    item : int

    Returns
    -------
    int
        The new count.
    """
    at = count
    while at > 0:
        above = (at - 1) >> 1
        if keys[above] <= key:
            break
        keys[at], items[at] = keys[above], items[above]
        at = above
    keys[at], items[at] = key, item
    return count + 1


@kernel
def pop(keys: Float32Array, items: Int32Array, count: int) -> int:
    """Remove the least item, which was at index 0, from a binary heap.

    Parameters
    ----------
    keys : (N,) float32
        Changed.
    items : (N,) int32
        Changed.
    count : int
        Items in the heap, at least 1.

    Returns
    -------
    int
        The new count.
    """
    count -= 1
    key, item = keys[count], items[count]
    at = 0
    while True:
        below = 2 * at + 1
        if below >= count:
            break
        if below + 1 < count and keys[below + 1] < keys[below]:
            below += 1
        if keys[below] >= key:
            break
        keys[at], items[at] = keys[below], items[below]
        at = below
    keys[at], items[at] = key, item
    return count

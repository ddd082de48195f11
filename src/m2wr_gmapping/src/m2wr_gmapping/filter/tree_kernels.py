# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory tree: nodes in use, and paths.

Array layouts
-------------
``parent`` (M,) int64, ``pose`` (M, 3) float64
    Of each node: its predecessor, which has a lower number, -1 for none; pose.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray


@kernel
def mark_used(leaves: IndexArray, parent: IndexArray, used: BoolArray) -> None:
    """Mark the nodes that are on the path of a particle.

    Parameters
    ----------
    leaves : (N,) int64
        Newest node of each particle, -1 for none.
    parent : (M,) int64
        See the module.
    used : (K,) bool
        False; changed to True for the marked ones of the first K nodes.
    """
    for n in range(leaves.shape[0]):
        if leaves[n] >= 0:
            used[leaves[n]] = True
    for node in range(used.shape[0] - 1, -1, -1):
        if used[node] and parent[node] >= 0:
            used[parent[node]] = True


@kernel
def path_to(leaf: int, parent: IndexArray, pose: FloatArray, out: FloatArray) -> None:
    """Write the poses from the root to ``leaf``.

    Parameters
    ----------
    leaf : int
        Node.
    parent : (M,) int64
        See the module.
    pose : (M, 3) float64
        Pose of each node.
    out : (K, 3) float64
        Written; K is the number of these nodes.
    """
    row, node = out.shape[0], leaf
    while node >= 0:
        row -= 1
        out[row, 0], out[row, 1], out[row, 2] = pose[node, 0], pose[node, 1], pose[node, 2]
        node = parent[node]

# SPDX-License-Identifier: BSD-3-Clause
"""Trajectory tree: new nodes, paths, and removal of branches without particles.

Array layouts
-------------
``parent`` (M,) int64, ``children`` (M,) int32, ``pose`` (M, 3) float64, ``serial`` (M,) int64
    Of each node: predecessor, number of successors, pose, and a unique number.
``free`` (M,) int64, ``counters`` (2,) int64
    Stack of unused nodes; its height, and the next serial number.
"""
from __future__ import annotations

from typing import TYPE_CHECKING

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray, Int32Array


@kernel
def release(leaf: int, parent: IndexArray, children: Int32Array, free: IndexArray, counters: IndexArray) -> None:
    """Delete a leaf without successors, and then its ancestors that have none.

    Parameters
    ----------
    leaf : int
        Node.
    parent : (M,) int64
        See the module.
    children : (M,) int32
        See the module.
    free : (M,) int64
        Stack of unused nodes.
    counters : (2,) int64
        Height of the stack; next serial number.
    """
    node = leaf
    while node >= 0 and children[node] == 0:
        above = parent[node]
        free[counters[0]] = node
        counters[0] += 1
        if above >= 0:
            children[above] -= 1
        node = above


@kernel
def lineage(leaf: int, parent: IndexArray, out: IndexArray) -> int:
    """Write the nodes from ``leaf`` to its root.

    Parameters
    ----------
    leaf : int
        Node.
    parent : (M,) int64
        See the module.
    out : (K,) int64
        Written.

    Returns
    -------
    int
        Number of nodes.
    """
    count, node = 0, leaf
    while node >= 0:
        out[count] = node
        count += 1
        node = parent[node]
    return count


@kernel
def _added(above: int, place: FloatArray, parent: IndexArray, children: Int32Array, pose: FloatArray,
           serial: IndexArray, free: IndexArray, counters: IndexArray) -> int:
    """Add one node at ``place`` (3,) behind the node ``above``, -1 for none; return it."""
    if above >= 0:
        children[above] += 1
    counters[0] -= 1
    node = free[counters[0]]
    parent[node], children[node], serial[node] = above, 0, counters[1]
    counters[1] += 1
    pose[node, 0], pose[node, 1], pose[node, 2] = place[0], place[1], place[2]
    return node


@kernel
def extend(leaves: IndexArray, poses: FloatArray, parent: IndexArray, children: Int32Array, pose: FloatArray,
           serial: IndexArray, free: IndexArray, counters: IndexArray) -> None:
    """Add a node behind each leaf; it becomes the leaf. There must be enough unused nodes.

    Parameters
    ----------
    leaves : (N,) int64
        Changed: newest node of each particle.
    poses : (N, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    parent : (M,) int64
        See the module.
    children : (M,) int32
        See the module.
    pose : (M, 3) float64
        Pose of each node.
    serial : (M,) int64
        See the module.
    free : (M,) int64
        Stack of unused nodes.
    counters : (2,) int64
        Height of the stack; next serial number.
    """
    for n in range(leaves.shape[0]):
        leaves[n] = _added(leaves[n], poses[n], parent, children, pose, serial, free, counters)


@kernel
def chain(poses: FloatArray, parent: IndexArray, children: Int32Array, pose: FloatArray, serial: IndexArray,
          free: IndexArray, counters: IndexArray) -> int:
    """Add a root and a chain of nodes.

    Parameters
    ----------
    poses : (K, 3) float64
        Their poses.
    parent : (M,) int64
        See the module.
    children : (M,) int32
        See the module.
    pose : (M, 3) float64
        Pose of each node.
    serial : (M,) int64
        See the module.
    free : (M,) int64
        Stack of unused nodes.
    counters : (2,) int64
        Height of the stack; next serial number.

    Returns
    -------
    int
        The last node; -1 for an empty chain.
    """
    node = -1
    for n in range(poses.shape[0]):
        node = _added(node, poses[n], parent, children, pose, serial, free, counters)
    return node


@kernel
def path_to(leaf: int, parent: IndexArray, pose: FloatArray, out: FloatArray) -> int:
    """Write the poses from the root to ``leaf`` to the end of ``out``.

    Parameters
    ----------
    leaf : int
        Node.
    parent : (M,) int64
        See the module.
    pose : (M, 3) float64
        Pose of each node.
    out : (K, 3) float64
        Written.

    Returns
    -------
    int
        First row that was written.
    """
    row, node = out.shape[0], leaf
    while node >= 0:
        row -= 1
        out[row, 0], out[row, 1], out[row, 2] = pose[node, 0], pose[node, 1], pose[node, 2]
        node = parent[node]
    return row

# SPDX-License-Identifier: BSD-3-Clause
"""The trajectory tree: new nodes, paths, and branches that no particle descends from.

Array layouts
-------------
``parent`` (M,) int64, ``children`` (M,) int32, ``pose`` (M, 3) float64, ``serial`` (M,) int64
    Of each node: the one before, how many come after, where, and a number that no other node ever had.
``free`` (M,) int64, ``counters`` (2,) int64
    Stack of unused nodes; its height, and the next serial number.
"""
from numba import njit


@njit(cache=True, nogil=True, error_model='numpy')
def release(leaf, parent, children, free, counters):
    """Delete ``leaf`` if nothing hangs on it, and its ancestors that are then childless; their places become free."""
    node = leaf
    while node >= 0 and children[node] == 0:
        above = parent[node]
        free[counters[0]] = node
        counters[0] += 1
        if above >= 0:
            children[above] -= 1
        node = above


@njit(cache=True, nogil=True, error_model='numpy')
def lineage(leaf, parent, out):
    """Write the nodes from ``leaf`` up to its root into ``out``; return how many."""
    count, node = 0, leaf
    while node >= 0:
        out[count] = node
        count += 1
        node = parent[node]
    return count


@njit(cache=True, nogil=True, error_model='numpy')
def _added(above, place, parent, children, pose, serial, free, counters):
    """Add one node at ``place`` (3,) below the node ``above``, -1 for none; return it."""
    if above >= 0:
        children[above] += 1
    counters[0] -= 1
    node = free[counters[0]]
    parent[node], children[node], serial[node] = above, 0, counters[1]
    counters[1] += 1
    pose[node, 0], pose[node, 1], pose[node, 2] = place[0], place[1], place[2]
    return node


@njit(cache=True, nogil=True, error_model='numpy')
def extend(leaves, poses, parent, children, pose, serial, free, counters):
    """Add a node below each of ``leaves`` (N,) and let it be the leaf; there must be as many free ones."""
    for n in range(leaves.shape[0]):
        leaves[n] = _added(leaves[n], poses[n], parent, children, pose, serial, free, counters)


@njit(cache=True, nogil=True, error_model='numpy')
def chain(poses, parent, children, pose, serial, free, counters):
    """Add a root and one node below the other; return the last one, -1 for no poses at all."""
    node = -1
    for n in range(poses.shape[0]):
        node = _added(node, poses[n], parent, children, pose, serial, free, counters)
    return node


@njit(cache=True, nogil=True, error_model='numpy')
def path_to(leaf, parent, pose, out):
    """Write the poses from the root to ``leaf`` at the end of ``out`` (K, 3); return in which row they begin."""
    row, node = out.shape[0], leaf
    while node >= 0:
        row -= 1
        out[row, 0], out[row, 1], out[row, 2] = pose[node, 0], pose[node, 1], pose[node, 2]
        node = parent[node]
    return row

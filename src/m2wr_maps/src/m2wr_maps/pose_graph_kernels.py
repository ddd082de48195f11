# SPDX-License-Identifier: BSD-3-Clause
"""Normal equations of a graph of planar poses, and their solution by a sparse Cholesky factorisation.

The graphs are long chains with some links: poses with at most two neighbours are eliminated first, the rest in the
order of fewest neighbours (minimum degree: George, Liu: The Evolution of the Minimum Degree Ordering Algorithm, SIAM
Review 31(1), 1989; sparse factorisation: Davis: Direct Methods for Sparse Linear Systems, SIAM 2006).  Node 0 stays
where it is and takes no part.  One measurement is taken after the other, so that the result is always the same.

Array layouts
-------------
``poses`` (K, 3), ``pairs`` (E, 2), ``measured`` (E, 3), ``information`` (E, 3, 3)
    As in ``pose_graph.optimise``.
``order`` (K - 1,), ``starts`` (K,), ``columns`` (C,) int64
    The elimination: nodes in their order; where the neighbours of each begin that are still there when it is
    eliminated, in ``columns``, the next to be eliminated first.
``targets`` int64
    For each node, and each pair of its neighbours, the place in ``columns`` that holds the block of those two.
``slots`` (E,) int64
    Place in ``columns`` of the block that each measurement adds to, -1 for none.
``diagonal`` (K, 9), ``blocks`` (C, 9) float64
    Blocks of the matrix, row by row; row: the later node, column: the earlier one.
"""
from __future__ import annotations

import math
from typing import Tuple

import numpy as np

from m2wr_maps.pose_kernels import wrapped
from m2wr_node.array_types import FloatArray, IndexArray
from m2wr_node.kernel import kernel

WORD = 64


@kernel
def residuals(poses: FloatArray, pairs: IndexArray, measured: FloatArray, information: FloatArray, residual: FloatArray,
              squared: FloatArray) -> None:
    """Write the residuals and their squares.

    Parameters
    ----------
    poses : (K, 3) float64
        Poses [m, m, rad].
    pairs : (E, 2) int64
        Numbers of the two poses of each measurement.
    measured : (E, 3) float64
        Measured relative poses [m, m, rad].
    information : (E, 3, 3) float64
        Inverse covariances.
    residual : (E, 3) float64
        Written: in the axes of the measured second pose [m, m, rad].
    squared : (E,) float64
        Written: in units of the covariance.
    """
    for e in range(pairs.shape[0]):
        p, q, m = poses[pairs[e, 0]], poses[pairs[e, 1]], measured[e]
        c, s = math.cos(p[2]), math.sin(p[2])
        dx, dy = q[0] - p[0], q[1] - p[1]
        x, y = c * dx + s * dy - m[0], c * dy - s * dx - m[1]
        c, s = math.cos(m[2]), math.sin(m[2])
        r = residual[e]
        r[0], r[1], r[2] = c * x + s * y, c * y - s * x, wrapped(q[2] - p[2] - m[2])
        total = 0.0
        for i in range(3):
            for j in range(3):
                total += r[i] * information[e, i, j] * r[j]
        squared[e] = total


@kernel
def _neighbours(count: int, pairs: IndexArray) -> Tuple[IndexArray, IndexArray, IndexArray]:
    """Return the neighbours of each node, without node 0: starts (K + 1,), degrees (K,), members."""
    degree = np.zeros(count, np.int64)
    for e in range(pairs.shape[0]):
        if pairs[e, 0] != 0 and pairs[e, 1] != 0 and pairs[e, 0] != pairs[e, 1]:
            degree[pairs[e, 0]] += 1
            degree[pairs[e, 1]] += 1
    first = np.zeros(count + 1, np.int64)
    first[1:] = np.cumsum(degree)
    members = np.empty(first[count], np.int64)
    degree[:] = 0
    for e in range(pairs.shape[0]):
        for side in range(2):
            p, q = pairs[e, side], pairs[e, 1 - side]
            if p == 0 or q == 0 or p == q:
                continue
            known = False
            for k in range(first[p], first[p] + degree[p]):
                known |= members[k] == q
            if not known:
                members[first[p] + degree[p]] = q
                degree[p] += 1
    return first, degree, members


@kernel
def _replace(node: int, old: int, new: int, first: IndexArray, degree: IndexArray, members: IndexArray) -> None:
    """Replace ``old`` by ``new`` among a node's neighbours; remove it if ``new`` is there already or negative."""
    at = known = -1
    for k in range(first[node], first[node] + degree[node]):
        if members[k] == old:
            at = k
        if members[k] == new:
            known = k
    if new >= 0 and known < 0:
        members[at] = new
    else:
        degree[node] -= 1
        members[at] = members[first[node] + degree[node]]


@kernel
def _bits(word: int) -> int:
    """Number of ones of an unsigned word."""
    count = 0
    while word:
        word &= word - np.uint64(1)
        count += 1
    return count


@kernel
def _eliminate_rest(nodes: IndexArray, first: IndexArray, degree: IndexArray, members: IndexArray, done: int,
                    order: IndexArray, starts: IndexArray, columns: IndexArray) -> IndexArray:
    """Eliminate ``nodes`` in the order of fewest neighbours; returns ``columns``, which may be longer than before."""
    count = nodes.shape[0]
    words = (count + WORD - 1) // WORD
    number = np.full(first.shape[0], -1, np.int64)
    for k in range(count):
        number[nodes[k]] = k
    near, left = np.zeros((count, words), np.uint64), np.empty(count, np.int64)
    for k in range(count):
        left[k] = degree[nodes[k]]
        for m in range(first[nodes[k]], first[nodes[k]] + left[k]):
            other = number[members[m]]
            near[k, other // WORD] |= np.uint64(1) << np.uint64(other % WORD)
    mine = np.empty(count, np.int64)
    for _ in range(count):
        v = -1
        for k in range(count):
            if left[k] >= 0 and (v < 0 or left[k] < left[v]):
                v = k
        total = 0
        for k in range(count):
            if near[v, k // WORD] >> np.uint64(k % WORD) & np.uint64(1):
                mine[total] = k
                total += 1
        begin = starts[done]
        while begin + total > columns.shape[0]:
            columns = np.concatenate((columns, np.empty_like(columns)))
        for k in range(total):
            u = mine[k]
            columns[begin + k] = nodes[u]
            for w in range(words):              # it gets the neighbours of ``v``, without ``v`` and itself
                near[u, w] |= near[v, w]
            near[u, v // WORD] &= ~(np.uint64(1) << np.uint64(v % WORD))
            near[u, u // WORD] &= ~(np.uint64(1) << np.uint64(u % WORD))
            left[u] = 0
            for w in range(words):
                left[u] += _bits(near[u, w])
        left[v] = -1
        order[done] = nodes[v]
        done += 1
        starts[done] = begin + total
    return columns


@kernel
def _eliminate(count: int, pairs: IndexArray) -> Tuple[IndexArray, IndexArray, IndexArray]:
    """Return ``order``, ``starts`` and ``columns``, the members of each column in any order."""
    first, degree, members = _neighbours(count, pairs)
    order, starts = np.empty(count - 1, np.int64), np.zeros(count, np.int64)
    columns = np.empty(4 * count, np.int64)
    gone, waiting = np.zeros(count, np.bool_), np.empty(3 * count, np.int64)
    height = done = 0
    for node in range(count - 1, 0, -1):
        if degree[node] <= 2:
            waiting[height] = node
            height += 1
    while height:
        height -= 1
        node = waiting[height]
        if gone[node]:
            continue
        gone[node], order[done], begin, near = True, node, starts[done], degree[node]
        for k in range(near):
            columns[begin + k] = members[first[node] + k]
        for k in range(near):
            other = columns[begin + k]
            _replace(other, node, columns[begin + 1 - k] if near == 2 else -1, first, degree, members)
            if degree[other] <= 2:
                waiting[height] = other
                height += 1
        done += 1
        starts[done] = begin + near
    rest = np.flatnonzero(~gone)[1:]
    columns = _eliminate_rest(rest, first, degree, members, done, order, starts, columns)
    return order, starts, columns[:starts[count - 1]]


@kernel
def _place_of(row: int, column: int, starts: IndexArray, columns: IndexArray, rank: IndexArray) -> int:
    """Position in ``columns`` of the block of two nodes, of which ``column`` is eliminated first."""
    for k in range(starts[rank[column]], starts[rank[column] + 1]):
        if columns[k] == row:
            return k
    return -1


@kernel
def plan(count: int, pairs: IndexArray) -> Tuple[IndexArray, IndexArray, IndexArray, IndexArray, IndexArray]:
    """Plan the elimination of a graph.

    Parameters
    ----------
    count : int
        Number of poses, at least 2.
    pairs : (E, 2) int64
        Numbers of the two poses of each measurement.

    Returns
    -------
    order, starts, columns, targets, slots : int64 arrays
        See the module.
    """
    order, starts, columns = _eliminate(count, pairs)
    rank = np.full(count, -1, np.int64)
    for k in range(count - 1):
        rank[order[k]] = k
    total = 0
    for k in range(count - 1):
        size = starts[k + 1] - starts[k]
        total += size * (size - 1) // 2
        for i in range(starts[k] + 1, starts[k + 1]):       # few: sorted by insertion
            node, j = columns[i], i
            while j > starts[k] and rank[columns[j - 1]] > rank[node]:
                columns[j] = columns[j - 1]
                j -= 1
            columns[j] = node
    targets, t = np.empty(total, np.int64), 0
    for k in range(count - 1):
        for i in range(starts[k], starts[k + 1]):
            for j in range(i + 1, starts[k + 1]):
                targets[t] = _place_of(columns[j], columns[i], starts, columns, rank)
                t += 1
    slots = np.full(pairs.shape[0], -1, np.int64)
    for e in range(pairs.shape[0]):
        p, q = pairs[e, 0], pairs[e, 1]
        if p != 0 and q != 0 and p != q:
            slots[e] = _place_of(q, p, starts, columns, rank) if rank[p] < rank[q] else \
                _place_of(p, q, starts, columns, rank)
    return order, starts, columns, targets, slots


@kernel
def assemble(poses: FloatArray, pairs: IndexArray, measured: FloatArray, information: FloatArray, weights: FloatArray,
             residual: FloatArray, columns: IndexArray, slots: IndexArray, diagonal: FloatArray, blocks: FloatArray,
             gradient: FloatArray) -> None:
    """Write the normal equations of the residuals at ``poses``.

    Parameters
    ----------
    poses : (K, 3) float64
        Poses [m, m, rad].
    pairs : (E, 2) int64
        Numbers of the two poses of each measurement.
    measured : (E, 3) float64
        Measured relative poses [m, m, rad].
    information : (E, 3, 3) float64
        Inverse covariances.
    weights : (E,) float64
        Weights of the measurements.
    residual : (E, 3) float64
        Residuals.
    columns, slots : see the module
    diagonal : (K, 9) float64
        Written: diagonal blocks.
    blocks : (C, 9) float64
        Written: other blocks.
    gradient : (K, 3) float64
        Written: gradient.
    """
    diagonal[:], blocks[:], gradient[:] = 0.0, 0.0, 0.0
    a, b, oa, ob = np.zeros((3, 3)), np.zeros((3, 3)), np.empty((3, 3)), np.empty((3, 3))
    for e in range(pairs.shape[0]):
        p, q = pairs[e, 0], pairs[e, 1]
        theta = poses[p, 2] + measured[e, 2]
        c, s = math.cos(theta), math.sin(theta)
        dx, dy = poses[q, 0] - poses[p, 0], poses[q, 1] - poses[p, 1]
        # derivatives of the residual by both poses
        b[0, 0], b[0, 1], b[1, 0], b[1, 1], b[2, 2] = c, s, -s, c, 1.0
        a[0, 0], a[0, 1], a[1, 0], a[1, 1], a[2, 2] = -c, -s, s, -c, -1.0
        a[0, 2], a[1, 2] = -s * dx + c * dy, -c * dx - s * dy
        for i in range(3):
            for j in range(3):
                oa[i, j] = ob[i, j] = 0.0
                for k in range(3):
                    oa[i, j] += weights[e] * information[e, i, k] * a[k, j]
                    ob[i, j] += weights[e] * information[e, i, k] * b[k, j]
        for i in range(3):
            for k in range(3):
                gradient[p, i] += oa[k, i] * residual[e, k]
                gradient[q, i] += ob[k, i] * residual[e, k]
        slot = slots[e]
        for i in range(3):
            for j in range(3):
                aa = bb = ba = 0.0
                for k in range(3):
                    aa += a[k, i] * oa[k, j]
                    bb += b[k, i] * ob[k, j]
                    ba += b[k, i] * oa[k, j]
                diagonal[p, 3 * i + j] += aa
                diagonal[q, 3 * i + j] += bb
                if slot >= 0 and columns[slot] == q:
                    blocks[slot, 3 * i + j] += ba
                elif slot >= 0:
                    blocks[slot, 3 * j + i] += ba


@kernel
def _divide(d: FloatArray, w: FloatArray) -> None:
    """Multiply a block (9,) from the right by the inverse transpose of a lower triangle (9,)."""
    for i in range(0, 9, 3):
        w[i] = w[i] / d[0]
        w[i + 1] = (w[i + 1] - w[i] * d[3]) / d[4]
        w[i + 2] = (w[i + 2] - w[i] * d[6] - w[i + 1] * d[7]) / d[8]


@kernel
def factorise(order: IndexArray, starts: IndexArray, columns: IndexArray, targets: IndexArray, diagonal: FloatArray,
              blocks: FloatArray) -> bool:
    """Replace the matrix by its Cholesky factor.

    Parameters
    ----------
    order, starts, columns, targets : see the module
    diagonal : (K, 9) float64
        Diagonal blocks.
    blocks : (C, 9) float64
        Other blocks.

    Returns
    -------
    bool
        False if the matrix is not positive definite.
    """
    t = 0
    for n in range(order.shape[0]):
        d = diagonal[order[n]]
        if not d[0] > 0.0:
            return False
        d[0] = math.sqrt(d[0])
        d[3], d[6] = d[3] / d[0], d[6] / d[0]
        rest = d[4] - d[3] * d[3]
        if not rest > 0.0:
            return False
        d[4] = math.sqrt(rest)
        d[7] = (d[7] - d[6] * d[3]) / d[4]
        rest = d[8] - d[6] * d[6] - d[7] * d[7]
        if not rest > 0.0:
            return False
        d[8] = math.sqrt(rest)
        for i in range(starts[n], starts[n + 1]):
            _divide(d, blocks[i])
        for i in range(starts[n], starts[n + 1]):
            early, onto = blocks[i], diagonal[columns[i]]
            for r in range(0, 9, 3):
                for k in range(0, 9, 3):
                    onto[r + k // 3] -= (early[r] * early[k] + early[r + 1] * early[k + 1]
                                         + early[r + 2] * early[k + 2])
            for j in range(i + 1, starts[n + 1]):
                late, onto = blocks[j], blocks[targets[t]]
                t += 1
                for r in range(0, 9, 3):
                    for k in range(0, 9, 3):
                        onto[r + k // 3] -= late[r] * early[k] + late[r + 1] * early[k + 1] + late[r + 2] * early[k + 2]
    return True


@kernel
def substitute(order: IndexArray, starts: IndexArray, columns: IndexArray, diagonal: FloatArray, blocks: FloatArray,
               x: FloatArray) -> None:
    """Solve factor * factor^T * x = b.

    Parameters
    ----------
    order, starts, columns : see the module
    diagonal : (K, 9) float64
        Diagonal blocks.
    blocks : (C, 9) float64
        Other blocks.
    x : (K, 3) float64
        b on entry, the solution on return.
    """
    for n in range(order.shape[0]):
        d, v = diagonal[order[n]], x[order[n]]
        v[0] = v[0] / d[0]
        v[1] = (v[1] - d[3] * v[0]) / d[4]
        v[2] = (v[2] - d[6] * v[0] - d[7] * v[1]) / d[8]
        for i in range(starts[n], starts[n + 1]):
            w, u = blocks[i], x[columns[i]]
            for r in range(3):
                u[r] -= w[3 * r] * v[0] + w[3 * r + 1] * v[1] + w[3 * r + 2] * v[2]
    for n in range(order.shape[0] - 1, -1, -1):
        d, v = diagonal[order[n]], x[order[n]]
        for i in range(starts[n], starts[n + 1]):
            w, u = blocks[i], x[columns[i]]
            for r in range(3):
                v[r] -= w[r] * u[0] + w[r + 3] * u[1] + w[r + 6] * u[2]
        v[2] = v[2] / d[8]
        v[1] = (v[1] - d[7] * v[2]) / d[4]
        v[0] = (v[0] - d[3] * v[1] - d[6] * v[2]) / d[0]

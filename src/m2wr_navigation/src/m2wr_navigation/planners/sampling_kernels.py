# SPDX-License-Identifier: BSD-3-Clause
"""Rapidly-exploring random trees on a grid of costs: RRT, RRT* and Informed RRT*.

Points are in cells: the corner of cell (0, 0) with the least x and y is the origin, the centre of that cell (0.5, 0.5).
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

START, GOAL = 0, 1              # the first two nodes of a tree
_SHORT = 1e-6                   # cells: a shorter edge is no edge


@kernel
def line_cost(costs: Uint8Array, table: Float32Array, x: float, y: float, last_x: float, last_y: float) -> float:
    """Return the integral of the cost along a line, inf if it meets a blocked cell or leaves the grid; exact.

    The line is followed from cell to cell (Amanatides, Woo 1987).

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost to travel one cell, for each value.
    x, y, last_x, last_y : float
        Ends [cells].
    """
    rows, columns = costs.shape
    length = math.hypot(last_x - x, last_y - y)
    row, column = int(math.floor(y)), int(math.floor(x))
    last_row, last_column = int(math.floor(last_y)), int(math.floor(last_x))
    if min(row, column, last_row, last_column) < 0 or max(row, last_row) >= rows or max(column, last_column) >= columns:
        return np.inf
    run, rise = last_x - x, last_y - y
    step_x, step_y = 1 if run > 0.0 else -1, 1 if rise > 0.0 else -1
    # share of the line at the next border to the side and up, and between two borders
    next_x = ((column + (step_x > 0)) - x) / run if run != 0.0 else np.inf
    next_y = ((row + (step_y > 0)) - y) / rise if rise != 0.0 else np.inf
    wide, high = (1.0 / abs(run) if run != 0.0 else np.inf), (1.0 / abs(rise) if rise != 0.0 else np.inf)
    total, done = 0.0, 0.0
    for _ in range(abs(last_row - row) + abs(last_column - column) + 1):
        each = table[costs[row, column]]
        if each == np.inf:
            return np.inf
        ahead = min(next_x, next_y, 1.0)
        total += each * (ahead - done)
        done = ahead
        if ahead >= 1.0:
            break
        if next_x < next_y:
            column, next_x = column + step_x, next_x + wide
        else:
            row, next_y = row + step_y, next_y + high
        if row < 0 or column < 0 or row >= rows or column >= columns:
            return np.inf
    if table[costs[last_row, last_column]] == np.inf:
        return np.inf
    return total * length


@kernel
def _sample(draw: FloatArray, bias: float, nodes: FloatArray, best: float,
            shape: Tuple[int, int]) -> Tuple[float, float]:
    """Return a point: the goal, or one of the grid, or of the ellipse in which shorter paths lie (Gammell 2014)."""
    if draw[2] < bias:
        return nodes[GOAL, 0], nodes[GOAL, 1]
    if best == np.inf:
        return draw[0] * shape[1], draw[1] * shape[0]
    run, rise = nodes[GOAL, 0] - nodes[START, 0], nodes[GOAL, 1] - nodes[START, 1]
    least = math.hypot(run, rise)
    along = 0.5 * best * math.sqrt(draw[0]) * math.cos(2.0 * math.pi * draw[1])
    across = 0.5 * math.sqrt(max(best * best - least * least, 0.0)) * math.sqrt(draw[0]) \
        * math.sin(2.0 * math.pi * draw[1])
    cosine, sine = (run / least, rise / least) if least > 0.0 else (1.0, 0.0)
    x = nodes[START, 0] + 0.5 * run + cosine * along - sine * across
    y = nodes[START, 1] + 0.5 * rise + sine * along + cosine * across
    return x, y


@kernel
def _nearest(nodes: FloatArray, total: FloatArray, count: int, x: float, y: float) -> int:
    """Return the node in the tree that is nearest to a point."""
    best, at = np.inf, START
    for k in range(count):
        square = (nodes[k, 0] - x) ** 2 + (nodes[k, 1] - y) ** 2
        if square < best and total[k] < np.inf:
            best, at = square, k
    return at


@kernel
def _attach(parent: IndexArray, child: IndexArray, sibling: IndexArray, node: int, above: int) -> None:
    """Make a node the child of another one."""
    before = parent[node]
    if before >= 0:             # take it out of the list of its parent's children
        k = child[before]
        if k == node:
            child[before] = sibling[node]
        else:
            while sibling[k] != node:
                k = sibling[k]
            sibling[k] = sibling[node]
    parent[node], sibling[node], child[above] = above, child[above], node


@kernel
def _lower(total: FloatArray, child: IndexArray, sibling: IndexArray, stack: IndexArray, node: int, new: float) -> None:
    """Lower the cost of a node and of all below it."""
    gain = total[node] - new
    total[node] = new
    if not gain < np.inf:
        return                  # the goal, which had no children
    depth, stack[0] = 1, node
    while depth > 0:
        depth -= 1
        k = child[stack[depth]]
        while k >= 0:
            total[k] -= gain
            stack[depth] = k
            depth += 1
            k = sibling[k]


@kernel
def _improve(costs: Uint8Array, table: Float32Array, nodes: FloatArray, total: FloatArray, links: IndexArray,
             found: Tuple[int, int, float]) -> None:
    """Give a new node the best parent within a radius, and its neighbours the new node where that is better.

    Parameters
    ----------
    costs, table
        As in :func:`line_cost`.
    nodes : (N, 2) float64
    total : (N,) float64
        Cost from the start. Changed.
    links : (4, N) int64
        Parent, first child, next sibling, scratch. Changed.
    found : (int, int, float)
        New node, number of nodes, radius [cells].
    """
    new, count, radius = found
    parent, child, sibling, stack = links[0], links[1], links[2], links[3]
    x, y = nodes[new, 0], nodes[new, 1]
    for k in range(count):
        far = math.hypot(nodes[k, 0] - x, nodes[k, 1] - y)
        if k != new and far <= radius and total[k] + far < total[new]:
            through = total[k] + line_cost(costs, table, nodes[k, 0], nodes[k, 1], x, y)
            # a node below the new one has at least its cost, so it is no candidate
            if through < total[new]:
                _attach(parent, child, sibling, new, k)
                _lower(total, child, sibling, stack, new, through)
    for k in range(count):
        far = math.hypot(nodes[k, 0] - x, nodes[k, 1] - y)
        if k != new and k != START and far <= radius and far > _SHORT and total[new] + far < total[k]:
            through = total[new] + line_cost(costs, table, x, y, nodes[k, 0], nodes[k, 1])
            if through < total[k]:
                _attach(parent, child, sibling, k, new)
                _lower(total, child, sibling, stack, k, through)


@kernel
def grow(costs: Uint8Array, table: Float32Array, tree: Tuple[FloatArray, FloatArray, IndexArray], count: int,
         draws: FloatArray, options: Tuple[float, float, float, bool]) -> int:
    """Grow a tree by some samples; return its number of nodes.

    A sample draws the nearest node by at most one step (LaValle 1998). With rewiring, a new node gets the best parent
    in the radius min(gamma sqrt(ln n / n), step), and becomes the parent of others (Karaman, Frazzoli 2011). Without,
    the first path ends the search.

    Parameters
    ----------
    costs, table
        As in :func:`line_cost`.
    tree : ((N, 2) float64, (N,) float64, (4, N) int64)
        Of :func:`sapling`, with room for all samples. Changed.
    count : int
        Its nodes.
    draws : (M, 3) float64
        Uniform random numbers from 0 to 1; M is the number of iterations.
    options : (float, float, float, bool)
        Step [cells]; share of the samples that are the goal; gamma [cells], 0: no rewiring; whether samples are
        taken from the ellipse of shorter paths, once there is a path.

    Returns
    -------
    int
    """
    step, bias, gamma, informed = options
    nodes, total, links = tree
    for draw in draws:
        if gamma == 0.0 and total[GOAL] < np.inf:
            break
        best = total[GOAL] if informed else np.inf
        x, y = _sample(draw, bias, nodes, best, costs.shape)
        near = _nearest(nodes, total, count, x, y)
        far = math.hypot(x - nodes[near, 0], y - nodes[near, 1])
        at_goal = far <= step and x == nodes[GOAL, 0] and y == nodes[GOAL, 1]
        if far < _SHORT or (at_goal and total[GOAL] < np.inf):
            continue
        if far > step:
            x = nodes[near, 0] + (x - nodes[near, 0]) * step / far
            y = nodes[near, 1] + (y - nodes[near, 1]) * step / far
        spent = line_cost(costs, table, nodes[near, 0], nodes[near, 1], x, y)
        if spent == np.inf:
            continue
        new = GOAL if at_goal else count
        nodes[new, 0], nodes[new, 1], total[new] = x, y, total[near] + spent
        count = count if at_goal else count + 1
        _attach(links[0], links[1], links[2], new, near)
        if gamma > 0.0:
            radius = min(gamma * math.sqrt(math.log(count) / count), step)
            _improve(costs, table, nodes, total, links, (new, count, radius))
    return count


def sapling(ends: FloatArray, room: int) -> Tuple[FloatArray, FloatArray, IndexArray]:
    """Return a tree of its start: places (N, 2), costs from the start (N,), links (4, N).

    Parameters
    ----------
    ends : (2, 2) float64
        Start and goal: x, y [cells].
    room : int
        Greatest number of samples.
    """
    nodes, total = np.empty((room + 2, 2)), np.full(room + 2, np.inf)
    nodes[:2], total[START] = ends, 0.0
    return nodes, total, np.full((4, room + 2), -1, np.int64)


def path_in(tree: Tuple[FloatArray, FloatArray, IndexArray]) -> FloatArray:
    """Return the path (N, 2) from start to goal, x and y [cells]; N = 0: there is none."""
    nodes, total, links = tree
    if total[GOAL] == np.inf:
        return np.empty((0, 2))
    chain = [GOAL]
    while links[0, chain[-1]] >= 0:
        chain.append(int(links[0, chain[-1]]))
    return nodes[chain[::-1]]


@kernel
def shortcut(costs: Uint8Array, table: Float32Array, path: FloatArray) -> FloatArray:
    """Return a path (M, 2) without the corners that a straight line can leave out at no more cost.

    The best chain of straight lines between the points of the path, by dynamic programming.

    Parameters
    ----------
    costs, table
        As in :func:`line_cost`.
    path : (N, 2) float64
        x, y [cells].
    """
    count = len(path)
    total, before = np.full(count, np.inf), np.zeros(count, np.int64)
    total[0] = 0.0
    for k in range(1, count):
        for j in range(k - 1, -1, -1):
            far = math.hypot(path[k, 0] - path[j, 0], path[k, 1] - path[j, 1])
            if total[j] + far < total[k]:
                through = total[j] + line_cost(costs, table, path[j, 0], path[j, 1], path[k, 0], path[k, 1])
                if through < total[k]:
                    total[k], before[k] = through, j
    steps, at = 1, count - 1
    while at > 0:
        steps, at = steps + 1, before[at]
    kept, at = np.empty((steps, 2)), count - 1
    for k in range(steps - 1, -1, -1):
        kept[k] = path[at]
        at = before[at]
    return kept

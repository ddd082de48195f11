# SPDX-License-Identifier: BSD-3-Clause
"""Hybrid A* on a costmap, with Dubins or Reeds-Shepp paths (Dolgov, Thrun, Montemerlo, Diebel 2008; Dubins 1957).

All lengths are in cells; x counts columns, y rows, from the corner of cell (0, 0). A node is a bin of one cell and one
of HEADINGS headings, and keeps the exact pose with which the bin was reached.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_navigation.planners.heap_kernels import pop, push
from m2wr_navigation.planners.reeds_shepp_kernels import MOST_PARTS, reeds_shepp
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Int32Array, Uint8Array

HEADINGS = 72               # bins of 5 degrees
STEP = 1.5                  # cells of an arc: more than the diagonal of a cell, so that each leads to another bin
SHORT = 1e-9                # cells: shorter parts of a path are none
CHECK = 0.5                 # cells between two places of a path that are looked up
SHOTS = 12                  # headings at the goal that are tried if it has none
ROUNDING = 1e-12            # of the square of a length in radii
FAR = 10.0                  # radii: beyond, the headings change little of the length of a path with backing
_FULL = 2.0 * math.pi


@kernel
def _turn(angle: float) -> float:
    """Return an angle from 0 to 2 pi; one that is 0 but for rounding is 0."""
    angle = angle % _FULL
    return 0.0 if _FULL - angle < 1e-9 else angle


@kernel
def dubins(start: Tuple[float, float, float], goal: Tuple[float, float, float],
           radius: float) -> Tuple[float, int, float, float, float]:
    """Return the shortest path of a vehicle that drives ahead with a least turning radius.

    Parameters
    ----------
    start, goal : (float, float, float)
        x, y, heading [rad].
    radius : float

    Returns
    -------
    length : float
    word : int
        0 LSL, 1 RSR, 2 LSR, 3 RSL, 4 RLR, 5 LRL.
    first, middle, last : float
        Of its three parts, in radii.
    """
    across, up = goal[0] - start[0], goal[1] - start[1]
    far, direction = math.hypot(across, up) / radius, math.atan2(up, across)
    alpha, beta = (start[2] - direction) % _FULL, (goal[2] - direction) % _FULL
    sa, sb, ca, cb, between = math.sin(alpha), math.sin(beta), math.cos(alpha), math.cos(beta), math.cos(alpha - beta)
    best, kind, one, two, three = np.inf, -1, 0.0, 0.0, 0.0
    for word in range(6):
        t = p = q = -1.0
        if word == 0 or word == 1:
            side = 1.0 if word == 0 else -1.0
            square = 2.0 + far * far - 2.0 * between + side * 2.0 * far * (sa - sb)
            if square < -ROUNDING:
                continue
            if square < ROUNDING:           # one arc leads there
                t, p, q = _turn(side * (beta - alpha)), 0.0, 0.0
            else:
                middle = math.atan2(side * (cb - ca), far + side * (sa - sb))
                t, p, q = _turn(side * (middle - alpha)), math.sqrt(square), _turn(side * (beta - middle))
        elif word == 2 or word == 3:
            side = 1.0 if word == 2 else -1.0
            square = far * far - 2.0 + 2.0 * between + side * 2.0 * far * (sa + sb)
            if square < 0.0:
                continue
            p = math.sqrt(square)
            middle = math.atan2(-side * (ca + cb), far + side * (sa + sb)) - math.atan2(-side * 2.0, p)
            t, q = _turn(side * (middle - alpha)), _turn(side * (middle - beta))
        else:
            side = 1.0 if word == 4 else -1.0
            cosine = (6.0 - far * far + 2.0 * between + side * 2.0 * far * (sa - sb)) / 8.0
            if abs(cosine) > 1.0:
                continue
            p = _FULL - math.acos(cosine)
            t = _turn(side * (alpha - math.atan2(ca - cb, far - side * (sa - sb))) + 0.5 * p) if word == 4 \
                else _turn(-alpha + math.atan2(-(ca - cb), far + sa - sb) + 0.5 * p)
            q = _turn(alpha - beta - t + p) if word == 4 else _turn(beta - alpha - t + p)
        if t + p + q < best:
            best, kind, one, two, three = t + p + q, word, t, p, q
    return best * radius, kind, one, two, three


@kernel
def arc(pose: Tuple[float, float, float], length: float, curvature: float) -> Tuple[float, float, float]:
    """Return the pose at the end of an arc.

    Parameters
    ----------
    pose : (float, float, float)
    length : float
        Negative: backwards.
    curvature : float
        1 / radius, positive to the left; 0: straight.
    """
    x, y, yaw = pose
    if curvature == 0.0:
        return x + length * math.cos(yaw), y + length * math.sin(yaw), yaw
    after = yaw + length * curvature
    return (x + (math.sin(after) - math.sin(yaw)) / curvature, y - (math.cos(after) - math.cos(yaw)) / curvature, after)


@kernel
def cost_along(costs: Uint8Array, table: Float32Array, pose: Tuple[float, float, float], length: float,
               curvature: float) -> float:
    """Return the cost of an arc: its length times the mean cost of its cells; inf: a cell is blocked or outside.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
    pose : (float, float, float)
    length, curvature : float
    """
    count = max(1, math.ceil(abs(length) / CHECK))
    total = 0.0
    for k in range(1, count + 1):
        x, y, _ = arc(pose, length * k / count, curvature)
        if not (0.0 <= x < costs.shape[1] and 0.0 <= y < costs.shape[0]):
            return np.inf
        total += table[costs[int(y), int(x)]]
    return abs(length) * total / count


@kernel
def _curvatures(word: int, radius: float) -> Tuple[float, float, float]:
    left = 1.0 / radius
    if word == 0:
        return left, 0.0, left
    if word == 1:
        return -left, 0.0, -left
    if word == 2:
        return left, 0.0, -left
    if word == 3:
        return -left, 0.0, left
    if word == 4:
        return -left, left, -left
    return left, -left, left


@kernel
def shot(pose: Tuple[float, float, float], goal: Tuple[float, float, float], radius: float, backwards: float,
         change: float, before: float, parts: FloatArray) -> float:
    """Return the cost in free space of the best path to a goal: by Reeds and Shepp, or by Dubins without backing.

    Parameters
    ----------
    pose, goal : (float, float, float)
    radius : float
    backwards : float
        Factor of the cost backwards; 0: never.
    change : float
        Added cost of a change of direction.
    before : float
        1 or -1: how the vehicle comes to the pose.
    parts : (5, 2) float64
        Written: signed length and curvature of each part of the path.
    """
    length, word, one, two, three = dubins(pose, goal, radius)
    if backwards > 0.0:
        # where backing is dear, arcs beyond half a turn may be the best: they are Dubins' only
        cost = reeds_shepp(pose, goal, radius, backwards, change, before, parts)
        length += change if before < 0.0 else 0.0
        if cost <= length:
            return cost
    bends = _curvatures(word, radius)
    parts[:] = 0.0
    parts[0, 0], parts[1, 0], parts[2, 0] = radius * one, radius * two, radius * three
    parts[0, 1], parts[1, 1], parts[2, 1] = bends
    return length


@kernel
def shot_cost(costs: Uint8Array, table: Float32Array, pose: Tuple[float, float, float], backwards: float,
              change: float, before: float, parts: FloatArray) -> float:
    """Return the cost of a path on the costmap, inf: it is blocked.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
    pose : (float, float, float)
        Where it begins.
    backwards, change, before : float
    parts : (5, 2) float64
        As for :func:`shot`.
    """
    total, place, sense = 0.0, pose, before
    for k in range(MOST_PARTS):
        length, bend = parts[k]
        if abs(length) > SHORT:
            now = 1.0 if length > 0.0 else -1.0
            total += cost_along(costs, table, place, length, bend) * (1.0 if length > 0.0 else backwards) \
                + (change if now != sense else 0.0)
            if total == np.inf:
                return total
            place, sense = arc(place, length, bend), now
    return total


@kernel
def shot_poses(pose: Tuple[float, float, float], parts: FloatArray) -> FloatArray:
    """Return poses (N, 3) along a path, without its start.

    Parameters
    ----------
    pose : (float, float, float)
    parts : (5, 2) float64
        As for :func:`shot`.
    """
    out, count, place = np.empty((int(np.abs(parts[:, 0]).sum() / CHECK) + 2 * MOST_PARTS, 3)), 0, pose
    for k in range(MOST_PARTS):
        length, bend = parts[k]
        if abs(length) <= SHORT:
            continue
        steps = max(1, math.ceil(abs(length) / CHECK))
        for j in range(1, steps + 1):
            at = arc(place, length * j / steps, bend)
            out[count, 0], out[count, 1], out[count, 2] = at
            count += 1
        place = arc(place, length, bend)
    return out[:count].copy()


@kernel
def _least_left(there: Tuple[float, float, float], goal: Tuple[float, float, float], by_cells: float, radius: float,
                backwards: float, parts: FloatArray) -> float:
    """Return what the way to a goal with a heading costs at least."""
    if backwards == 0.0:
        return max(by_cells, dubins(there, goal, radius)[0])
    if by_cells > FAR * radius:
        return by_cells * min(1.0, backwards)
    return max(by_cells, reeds_shepp(there, goal, radius, 1.0, 0.0, 0.0, parts)) * min(1.0, backwards)


@kernel
def _slot(keys: IndexArray, key: int) -> int:
    """Return where a key is in a hash table, or the empty slot (-1) where it belongs."""
    mask = len(keys) - 1
    at = (key * 0x9E3779B1) & mask
    while keys[at] != -1 and keys[at] != key:
        at = (at + 1) & mask
    return at


@kernel
def _key(pose: Tuple[float, float, float], columns: int) -> int:
    heading = int((pose[2] % _FULL) / _FULL * HEADINGS) % HEADINGS
    return (int(pose[1]) * columns + int(pose[0])) * HEADINGS + heading


@kernel
def hybrid_search(costs: Uint8Array, table: Float32Array, distance: Float32Array, start: Tuple[float, float, float],
                  goal: Tuple[float, float, float], options: Tuple[float, float, float, float],
                  memory: Tuple[FloatArray, Float32Array, Int32Array, IndexArray, Int32Array, Float32Array,
                                Int32Array]) -> Tuple[int, int, float]:
    """Search from a start until the path in free space to the goal is the best that is left.

    Parameters
    ----------
    costs : (H, W) uint8
    table : (256,) float32
        Cost of a cell of each value, inf: blocked.
    distance : (H, W) float32
        Cost from each cell to the goal, by cells.
    start, goal : (float, float, float)
    options : four floats
        Turning radius; factor of the cost backwards, 0: never; added cost of a change of direction, in cells; 1: any
        heading at the goal.
    memory : seven arrays
        Poses of nodes (N, 3), their costs, their parents and signs of their arcs (N, 2), hash keys (a power of 2) and
        their nodes, keys and items of the heap (4 N).

    Returns
    -------
    node : int
        From which the last path in free space begins; -1: none was found.
    count : int
        Nodes.
    heading : float
        At the goal [rad].
    """
    radius, backwards, change, any_heading = options
    poses, total, links, keys, values, heap_keys, heap_items = memory
    columns, parts = costs.shape[1], np.empty((MOST_PARTS, 2))
    poses[0, 0], poses[0, 1], poses[0, 2] = start
    total[0], links[0, 0], links[0, 1] = 0.0, -1, 1
    slot = _slot(keys, _key(start, columns))
    keys[slot], values[slot] = _key(start, columns), 0
    count, waiting, expanded = 1, push(heap_keys, heap_items, 0, distance[int(start[1]), int(start[0])], 0), 0
    best, best_node, best_heading = np.inf, -1, goal[2]
    while waiting > 0:
        node, key = heap_items[0], heap_keys[0]
        waiting = pop(heap_keys, heap_items, waiting)
        if key >= best:
            break               # no path that is left is better
        here = (poses[node, 0], poses[node, 1], poses[node, 2])
        ahead = distance[int(here[1]), int(here[0])]
        if values[_slot(keys, _key(here, columns))] != node:
            continue            # its bin was reached with less cost since
        expanded += 1
        # the nearer the goal, the more often
        if expanded % max(1, int(ahead / (4.0 * radius + 1.0))) == 0:
            for k in range(SHOTS if any_heading > 0.0 else 1):
                heading = goal[2] if any_heading == 0.0 else k * _FULL / SHOTS
                end = (goal[0], goal[1], heading)
                before = float(links[node, 1])
                if total[node] + shot(here, end, radius, backwards, change, before, parts) < best:
                    found = total[node] + shot_cost(costs, table, here, backwards, change, before, parts)
                    if found < best:
                        best, best_node, best_heading = found, node, heading
        for k in range(6 if backwards > 0.0 else 3):
            sign = 1 if k < 3 else -1
            bend = (k % 3 - 1) / radius
            spent = cost_along(costs, table, here, sign * STEP, bend)
            if spent == np.inf:
                continue
            spent = total[node] + spent * (1.0 if sign > 0 else backwards) + (change if sign != links[node, 1] else 0.0)
            there = arc(here, sign * STEP, bend)
            left = distance[int(there[1]), int(there[0])]
            if any_heading == 0.0:
                left = _least_left(there, goal, left, radius, backwards, parts)
            if not spent + left < best:
                continue
            key_there = _key(there, columns)
            slot = _slot(keys, key_there)
            at = values[slot] if keys[slot] == key_there else -1
            if at >= 0 and total[at] <= spent:
                continue
            if count == len(total) or waiting == len(heap_keys):
                return best_node, count, best_heading       # out of memory
            # a new node, so that the poses of those that came from the old one stay true
            keys[slot], values[slot] = key_there, count
            poses[count, 0], poses[count, 1], poses[count, 2] = there
            total[count], links[count, 0], links[count, 1] = spent, node, sign
            waiting = push(heap_keys, heap_items, waiting, spent + left, count)
            count += 1
    return best_node, count, best_heading

# SPDX-License-Identifier: BSD-3-Clause
"""Exhaustive search for a scan in a raster of old end points, with an upper bound that saves most of the work.

After the idea of Olson, Real-Time Correlative Scan Matching, ICRA 2009: further rasters hold the maximum over blocks,
so that the score of a whole block of offsets is bounded by one evaluation.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

BLOCK = 4               # width of a block of offsets that share one bound
CENTRE, BESIDE, CORNER = 255, 170, 110     # values of an end point's cell and of its neighbours


@kernel
def stamp_points(poses: FloatArray, ends: IndexArray, points: FloatArray, corner: FloatArray, per_metre: float,
                 raster: Uint8Array) -> None:
    """Raise the cells around the end points of scans.

    Parameters
    ----------
    poses : (K, 3) float64
        Poses x, y [m], theta [rad] in ``map``.
    ends : (K,) int64
        Number of end points up to and including each scan.
    points : (2, B) float64
        End points of one scan after the other [m, laser frame].
    corner : (2,) float64
        World position of the raster's corner [m].
    per_metre : float
        Cells per metre.
    raster : (H, W) uint8
        Changed: cells take the greater value.
    """
    for k in range(ends.shape[0]):
        x, y, c, s = poses[k, 0], poses[k, 1], math.cos(poses[k, 2]), math.sin(poses[k, 2])
        for b in range(ends[k - 1] if k else 0, ends[k]):
            fx = (x + c * points[0, b] - s * points[1, b] - corner[0]) * per_metre
            fy = (y + s * points[0, b] + c * points[1, b] - corner[1]) * per_metre
            if not (fx >= 1.0 and fy >= 1.0 and fx < raster.shape[1] - 1 and fy < raster.shape[0] - 1):
                continue
            ix, iy = int(fx), int(fy)
            for dy in range(-1, 2):
                for dx in range(-1, 2):
                    value = CENTRE if dx == 0 and dy == 0 else (BESIDE if dx == 0 or dy == 0 else CORNER)
                    if raster[iy + dy, ix + dx] < value:
                        raster[iy + dy, ix + dx] = value


@kernel
def add_points(eye: FloatArray, pose: FloatArray, points: FloatArray, away: float, out: FloatArray, count: int) -> int:
    """Append the end points of a scan that are close to ``eye``, in the frame of ``eye``.

    Parameters
    ----------
    eye : (3,) float64
        Pose of the observer [m, m, rad].
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    points : (2, B) float64
        End points [m, laser frame].
    away : float
        Greatest distance from ``eye`` [m].
    out : (2, Q) float64
        Written from column ``count`` on [m].
    count : int
        Number of columns that are already written.

    Returns
    -------
    int
        Number of columns that are written afterwards.
    """
    c, s = math.cos(eye[2]), math.sin(eye[2])
    dx, dy = pose[0] - eye[0], pose[1] - eye[1]
    x, y = c * dx + s * dy, c * dy - s * dx
    c, s = math.cos(pose[2] - eye[2]), math.sin(pose[2] - eye[2])
    for b in range(points.shape[1]):
        px, py = x + c * points[0, b] - s * points[1, b], y + s * points[0, b] + c * points[1, b]
        if px * px + py * py < away * away:
            out[0, count], out[1, count] = px, py
            count += 1
    return count


@kernel
def block_maximum(raster: Uint8Array, size: int, out: Uint8Array) -> None:
    """Write the maximum of the ``size`` x ``size`` cells that start at each cell, towards larger indices.

    Parameters
    ----------
    raster : (H, W) uint8
        Raster of end points.
    size : int
        Width of a block [cells].
    out : (H, W) uint8
        Written.
    """
    height, width = raster.shape
    rows = raster.copy()
    for y in range(height):
        for k in range(1, min(size, width)):
            _raise(rows[y, :width - k], raster[y, k:])
    for y in range(height):
        out[y] = rows[y]
        for k in range(1, min(size, height - y)):
            _raise(out[y], rows[y + k])


@kernel
def _raise(values: Any, others: Any) -> None:
    """Raise each of the values (W,) to the other one; a simple loop that the compiler vectorises."""
    for k in range(values.shape[0]):
        values[k] = max(values[k], others[k])


@kernel
def _sum_at(cells: Any, spread: IndexArray, dx: int, dy: int, raster: Uint8Array, needed: int) -> int:
    """Return the sum of the raster at the shifted cells (Q,); those outside count 0.

    Cells are numbered row by row; ``spread`` (4,) holds their least and greatest x, least and greatest y. A sum that
    cannot reach ``needed`` may be too small.
    """
    total, width, count = 0, raster.shape[1], cells.shape[0]
    if spread[0] + dx >= 0 and spread[1] + dx < width and spread[2] + dy >= 0 and spread[3] + dy < raster.shape[0]:
        flat, shift, half = raster.reshape(-1), dy * width + dx, count // 2
        for k in range(half):
            total += flat[np.uint32(cells[k] + shift)]
        if total + (count - half) * CENTRE >= needed:
            for k in range(half, count):
                total += flat[np.uint32(cells[k] + shift)]
        return total
    for k in range(count):
        y = cells[k] // width
        x = cells[k] - y * width + dx
        y += dy
        if x >= 0 and y >= 0 and x < width and y < raster.shape[0]:
            total += raster[y, x]
    return total


@kernel
def _search_block(first_x: int, first_y: int, cells: Any, spread: IndexArray, raster: Uint8Array, pairs: Uint8Array,
                  needed: int, apart_cells: int, other: IndexArray, found: IndexArray) -> bool:
    """Search the offsets of one block for a sum of at least ``needed``; return whether there is one.

    ``found`` (3,) is set to the greatest sum, and to its x and y. It is farther than ``apart_cells`` along an axis from
    ``other``, of the same kind; all offsets are if ``apart_cells`` is negative.
    """
    better = False
    for quarter in range(4):
        low_x, low_y = first_x + 2 * (quarter % 2), first_y + 2 * (quarter // 2)
        if _sum_at(cells, spread, low_x, low_y, pairs, needed) < needed:
            continue
        for cell in range(4):
            dx, dy = low_x + cell % 2, low_y + cell // 2
            if abs(dx - other[1]) <= apart_cells and abs(dy - other[2]) <= apart_cells:
                continue
            value = _sum_at(cells, spread, dx, dy, raster, needed)
            if value >= needed:
                needed, better = value + 1, True
                found[0], found[1], found[2] = value, dx, dy
    return better


@kernel
def _place_points(centre: FloatArray, turn: float, points: FloatArray, corner: FloatArray, per_metre: float, width: int,
                  cells: Any, spread: IndexArray) -> None:
    """Write the cells (Q,) of the points (2, Q) after a rotation, and their spread; see ``_sum_at``."""
    c, s = math.cos(centre[2] + turn), math.sin(centre[2] + turn)
    for k in range(cells.shape[0]):
        x = int(math.floor((centre[0] + c * points[0, k] - s * points[1, k] - corner[0]) * per_metre))
        y = int(math.floor((centre[1] + s * points[0, k] + c * points[1, k] - corner[1]) * per_metre))
        cells[k] = y * width + x
        if k == 0:
            spread[0], spread[1], spread[2], spread[3] = x, x, y, y
        spread[0], spread[1] = min(spread[0], x), max(spread[1], x)
        spread[2], spread[3] = min(spread[2], y), max(spread[3], y)


@kernel
def search(centre: FloatArray, points: FloatArray, turns: FloatArray, allowed: Uint8Array, corner: FloatArray,
           per_metre: float, raster: Uint8Array, pairs: Uint8Array, coarse: Uint8Array, apart_cells: int,
           apart_turn: float, share: float, least: float, best: FloatArray) -> None:
    """Find the best offset and rotation of the points, and a rival.

    Offsets are whole cells, in blocks of BLOCK x BLOCK. Branch and bound: blocks come in the order of their bound, and
    within one only quarters whose bound suffices are searched.

    Parameters
    ----------
    centre : (3,) float64
        Pose around which is searched [m, m, rad].
    points : (2, Q) float64
        Points of the query [m].
    turns : (T,) float64
        Rotations to try [rad].
    allowed : (2 * N + 1, 2 * N + 1) uint8
        Nonzero for blocks around the centre to search, rows along y.
    corner : (2,) float64
        World position of the raster's corner [m].
    per_metre : float
        Cells per metre.
    raster : (H, W) uint8
        Raster of end points. All points lie in it without an offset.
    pairs, coarse : (H, W) uint8
        ``block_maximum`` of the raster with size BLOCK / 2 and BLOCK.
    apart_cells : int
        Least distance of a rival along either axis [cells].
    apart_turn : float
        Least rotation of a rival [rad].
    share : float
        A rival has at least this share of the best score.
    least : float
        Places with a smaller score are not searched, except for rivals.
    best : (7,) float64
        Written: pose and its score from 0 to 1, score of a rival, and the rival's x, y. A score is 0 if there is none.
    """
    count, side = points.shape[1], allowed.shape[0]
    first, places = -(side // 2) * BLOCK - BLOCK // 2, np.flatnonzero(allowed)
    full = max(1, count) * CENTRE
    lowest = max(1, int(math.ceil(least * full)))
    lowest_rival = max(1, int(math.ceil(share * lowest)))
    cells, spread = np.empty((turns.shape[0], count), np.int32), np.zeros((turns.shape[0], 4), np.int64)
    bounds = np.empty(turns.shape[0] * places.shape[0], np.int32)
    for t in range(turns.shape[0]):
        _place_points(centre, turns[t], points, corner, per_metre, raster.shape[1], cells[t], spread[t])
        for p in range(places.shape[0]):
            bounds[t * places.shape[0] + p] = _sum_at(cells[t], spread[t], first + places[p] % side * BLOCK,
                                                      first + places[p] // side * BLOCK, coarse, lowest_rival)
    kept = np.flatnonzero(bounds >= lowest_rival)
    order = kept[np.argsort(-bounds[kept])]
    top, rival, top_turn = np.zeros(3, np.int64), np.zeros(3, np.int64), 0
    for index in order:
        if bounds[index] <= top[0] or bounds[index] < lowest:
            break
        t, place = index // places.shape[0], places[index % places.shape[0]]
        if _search_block(first + place % side * BLOCK, first + place // side * BLOCK, cells[t], spread[t], raster,
                         pairs, max(lowest, top[0] + 1), -1, top, top):
            top_turn = t
    wanted = max(1, int(math.ceil(share * top[0])))
    for index in order:
        if bounds[index] < wanted or top[0] == 0:
            break
        t, place = index // places.shape[0], places[index % places.shape[0]]
        if _search_block(first + place % side * BLOCK, first + place // side * BLOCK, cells[t], spread[t], raster,
                         pairs, wanted, -1 if abs(turns[t] - turns[top_turn]) > apart_turn else apart_cells, top,
                         rival):
            break
    best[0], best[1] = centre[0] + top[1] / per_metre, centre[1] + top[2] / per_metre
    best[2] = centre[2] + turns[top_turn]
    best[3], best[4] = top[0] / full, rival[0] / full
    best[5], best[6] = centre[0] + rival[1] / per_metre, centre[1] + rival[2] / per_metre


@kernel
def mark_near(middles: FloatArray, places: FloatArray, least: FloatArray, most: FloatArray, room: FloatArray,
              near: Uint8Array) -> None:
    """Mark the offsets that lead close to one of some places and have an allowed length.

    Parameters
    ----------
    middles : (N,) float64
        Offsets along either axis, evenly spaced [m].
    places : (C, 2) float64
        Places [m].
    least : (C,) float64
        Allowed length of the offset [m].
    most : (C,) float64
        Allowed length of the offset [m].
    room : (C,) float64
        Greatest distance from the place along either axis [m].
    near : (N, N) uint8
        Written: 1 for marked offsets, rows along y.
    """
    size, count = middles[1] - middles[0], middles.shape[0]
    for k in range(places.shape[0]):
        beside = int(math.ceil(room[k] / size))
        column = int(round((places[k, 0] - middles[0]) / size))
        row = int(round((places[k, 1] - middles[0]) / size))
        for y in range(max(0, row - beside), min(count, row + beside + 1)):
            for x in range(max(0, column - beside), min(count, column + beside + 1)):
                length = math.sqrt(middles[x] * middles[x] + middles[y] * middles[y])
                if least[k] <= length <= most[k]:
                    near[y, x] = 1


@kernel
def _inside(at: float, along: float, size: int) -> Tuple[float, float]:
    """Share of a ray along one axis, from 0 to 1, after which it enters the range, and after which it leaves it."""
    if abs(along) < 1e-9:
        return (0.0, 1.0) if 0.0 <= at < size else (1.0, 0.0)
    first, last = -at / along, (size - at) / along
    return max(0.0, min(first, last)), min(1.0, max(first, last))


@kernel
def mark_seen(pose: FloatArray, rays: Float32Array, corner: FloatArray, per_metre: float, seen: Uint8Array) -> None:
    """Mark the cells that the rays of a scan pass through.

    Parameters
    ----------
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    rays : (2, S) float32
        Ends of the beams [m, laser frame].
    corner : (2,) float64
        World position of the raster's corner [m].
    per_metre : float
        Cells per metre.
    seen : (H, W) uint8
        Written: 1 for marked cells.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y = (pose[0] - corner[0]) * per_metre, (pose[1] - corner[1]) * per_metre
    for k in range(rays.shape[1]):
        dx, dy = (c * rays[0, k] - s * rays[1, k]) * per_metre, (s * rays[0, k] + c * rays[1, k]) * per_metre
        low_x, high_x = _inside(x, dx, seen.shape[1])
        low_y, high_y = _inside(y, dy, seen.shape[0])
        low, high = max(low_x, low_y), min(high_x, high_y)
        if not low <= high:
            continue
        count = int(max(abs(dx), abs(dy))) + 1
        dx, dy = dx / count, dy / count
        for step in range(int(low * count), min(count, int(high * count) + 1) + 1):
            fx, fy = x + step * dx, y + step * dy
            if fx >= 0.0 and fy >= 0.0 and fx < seen.shape[1] and fy < seen.shape[0]:
                seen[int(fy), int(fx)] = 1


@kernel
def survey(centre: FloatArray, points: FloatArray, turns: FloatArray, allowed: Uint8Array, corner: FloatArray,
           per_metre: float, raster: Uint8Array, seen: Uint8Array, against: int, share: float, rating: FloatArray,
           turn: FloatArray) -> None:
    """Rate offsets around ``centre`` by the points that fall into observed space.

    Unknown cells do not count. A point in free space counts against a place as ``against`` points on obstacles count
    for it.

    Parameters
    ----------
    centre : (3,) float64
        Pose around which is searched [m, m, rad].
    points : (2, Q) float64
        Points of the query [m].
    turns : (T,) float64
        Rotations to try [rad].
    allowed : (N, N) uint8
        Offsets to rate, in whole cells, rows along y; [N // 2, N // 2] is no offset.
    corner : (2,) float64
        World position of the raster's corner [m].
    per_metre : float
        Cells per metre.
    raster : (H, W) uint8
        Raster of ``stamp_points``.
    seen : (H, W) uint8
        Cells of ``mark_seen``.
    against : int
        Weight of points in free space.
    share : float
        Offsets with a smaller share of the best rating may get 0.
    rating : (N, N) float64
        Written: best rating of all rotations, from 0 to 1.
    turn : (N, N) float64
        Written: index of that rotation.
    """
    count, half, width = points.shape[1], rating.shape[0] // 2, raster.shape[1]
    worth = np.empty(raster.size, np.int32)
    for k in range(worth.shape[0]):
        occupied = np.int32(raster.flat[k])
        known = occupied > 0 or seen.flat[k] > 0
        worth[k] = (1 + against) * occupied - (against * CENTRE if known else 0)
    xs, ys, cells = np.empty(count, np.int64), np.empty(count, np.int64), np.empty(count, np.int64)
    rating[:], turn[:], top = 0.0, 0.0, 0
    order = np.argsort(np.abs(turns))
    for t in order:
        c, s = math.cos(centre[2] + turns[t]), math.sin(centre[2] + turns[t])
        for k in range(count):
            xs[k] = int(math.floor((centre[0] + c * points[0, k] - s * points[1, k] - corner[0]) * per_metre))
            ys[k] = int(math.floor((centre[1] + s * points[0, k] + c * points[1, k] - corner[1]) * per_metre))
            cells[k] = ys[k] * width + xs[k]
        low_x, high_x, low_y, high_y = xs.min(), xs.max(), ys.min(), ys.max()
        for number in range(rating.size + 1):
            i, j = (half, half) if number == 0 else ((number - 1) // rating.shape[1], (number - 1) % rating.shape[1])
            dx, dy = j - half, i - half
            if not allowed[i, j] or low_x + dx < 0 or low_y + dy < 0 or high_x + dx >= width \
                    or high_y + dy >= raster.shape[0]:
                continue
            total, shift, least = 0, dy * width + dx, int(share * top)
            for k in range(count):
                if k & 15 == 0 and total + (count - k) * CENTRE < least:
                    break
                total += worth[cells[k] + shift]
            else:
                top = max(top, total)
                value = total / (count * float(CENTRE))
                if value > rating[i, j]:
                    rating[i, j], turn[i, j] = value, t


@kernel
def search_window(centre: FloatArray, offsets: FloatArray, turns: FloatArray, points: FloatArray, stride: int,
                  corner: FloatArray, per_metre: float, field: Uint8Array, best: FloatArray) -> None:
    """Search all offsets and rotations around a pose in a field of match values.

    Parameters
    ----------
    centre : (3,) float64
        Pose around which is searched [m, m, rad].
    offsets : (A, 3) float64
        x, y [m, map axes], which are rounded to whole cells, and a penalty on the mean value of a point.
    turns : (T, 2) float64
        Rotation [rad], and penalty.
    points : (R, B) float64
        End points in the first two rows [m, laser frame].
    stride : int
        Every ``stride``-th point is used.
    corner : (2,) float64
        World position of the field's corner [m].
    per_metre : float
        Cells per metre.
    field : (H, W) uint8
        Match values.
    best : (4,) float64
        Written: pose and value, at most 1. Ties keep the earlier candidate: order both from the centre outwards.
    """
    count = (points.shape[1] + stride - 1) // stride
    xs, ys = np.empty(count, np.int64), np.empty(count, np.int64)
    height, width = field.shape
    best[3] = -1e9
    for t in range(turns.shape[0]):
        theta = centre[2] + turns[t, 0]
        c, s = math.cos(theta), math.sin(theta)
        for k in range(count):
            qx, qy = points[0, k * stride], points[1, k * stride]
            xs[k] = int(math.floor((centre[0] + c * qx - s * qy - corner[0]) * per_metre))
            ys[k] = int(math.floor((centre[1] + s * qx + c * qy - corner[1]) * per_metre))
        for a in range(offsets.shape[0]):
            dx = int(math.floor(offsets[a, 0] * per_metre + 0.5))
            dy = int(math.floor(offsets[a, 1] * per_metre + 0.5))
            total = 0
            # sum to exceed; the loop ends as soon as the remaining points cannot reach it
            needed = (best[3] + offsets[a, 2] + turns[t, 1]) * 255.0 * count
            for k in range(count):
                if k & 7 == 0 and total + (count - k) * 255 <= needed:
                    break
                x, y = xs[k] + dx, ys[k] + dy
                if 0 <= x < width and 0 <= y < height:
                    total += field[y, x]
            value = total / (255.0 * count) - offsets[a, 2] - turns[t, 1]
            if value > best[3]:
                best[0], best[1], best[2], best[3] = centre[0] + offsets[a, 0], centre[1] + offsets[a, 1], theta, value

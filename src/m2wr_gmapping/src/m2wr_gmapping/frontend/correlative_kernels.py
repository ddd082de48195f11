# SPDX-License-Identifier: BSD-3-Clause
"""Exhaustive search for a scan in a raster of old end points, with an upper bound that saves most of the work.

After the two-level idea of Olson, Real-Time Correlative Scan Matching, ICRA 2009: a second raster holds the maximum
over blocks, so that the score of a whole block of offsets is bounded by one evaluation.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Tuple

import numpy as np
from numba import njit

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import Float32Array, FloatArray, IndexArray, Uint8Array

BLOCK = 4               # width of a block of offsets that share one bound
CENTRE, BESIDE, CORNER = 255, 170, 110     # values of an end point's cell and of its neighbours


@njit(cache=True, nogil=True, error_model='numpy')
def stamp_points(pose: FloatArray, points: FloatArray, corner: FloatArray, per_metre: float,
                 raster: Uint8Array) -> None:
    """Raise the cells around the end points of a scan.

    Parameters
    ----------
    pose : (3,) float64
        Pose x, y [m], theta [rad] in ``map``.
    points : (2, B) float64
        End points [m, laser frame].
    corner : (2,) float64
        World position of the raster's corner [m].
    per_metre : float
        Cells per metre.
    raster : (H, W) uint8
        Changed: cells take the greater value.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    for b in range(points.shape[1]):
        fx = (pose[0] + c * points[0, b] - s * points[1, b] - corner[0]) * per_metre
        fy = (pose[1] + s * points[0, b] + c * points[1, b] - corner[1]) * per_metre
        if not (fx >= 1.0 and fy >= 1.0 and fx < raster.shape[1] - 1 and fy < raster.shape[0] - 1):
            continue
        ix, iy = int(fx), int(fy)
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                value = CENTRE if dx == 0 and dy == 0 else (BESIDE if dx == 0 or dy == 0 else CORNER)
                if raster[iy + dy, ix + dx] < value:
                    raster[iy + dy, ix + dx] = value


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
def block_maximum(raster: Uint8Array, out: Uint8Array) -> None:
    """Write the maximum of the BLOCK x BLOCK cells that start at each cell, towards larger indices.

    Parameters
    ----------
    raster : (H, W) uint8
        Raster of end points.
    out : (H, W) uint8
        Written.
    """
    height, width = raster.shape
    rows = raster.copy()
    for y in range(height):
        for k in range(1, min(BLOCK, width)):
            _raise(rows[y, :width - k], raster[y, k:])
    for y in range(height):
        out[y] = rows[y]
        for k in range(1, min(BLOCK, height - y)):
            _raise(out[y], rows[y + k])


@njit(cache=True, nogil=True, error_model='numpy')
def _raise(values: Any, others: Any) -> None:
    """Raise each of the values (W,) to the other one; a simple loop that the compiler vectorises."""
    for k in range(values.shape[0]):
        values[k] = max(values[k], others[k])


@njit(cache=True, nogil=True, error_model='numpy')
def _sum_at(xs: IndexArray, ys: IndexArray, spread: IndexArray, dx: int, dy: int, raster: Uint8Array) -> int:
    """Return the sum of the raster at the shifted cells; cells outside count 0.

    ``spread`` (4,) holds least and greatest x, least and greatest y.
    """
    total, width = 0, raster.shape[1]
    if spread[0] + dx >= 0 and spread[1] + dx < width and spread[2] + dy >= 0 and spread[3] + dy < raster.shape[0]:
        flat = raster.reshape(-1)
        for k in range(xs.shape[0]):
            total += flat[np.uint64((ys[k] + dy) * width + xs[k] + dx)]
        return total
    for k in range(xs.shape[0]):
        x, y = xs[k] + dx, ys[k] + dy
        if x >= 0 and y >= 0 and x < width and y < raster.shape[0]:
            total += raster[y, x]
    return total


@njit(cache=True, nogil=True, error_model='numpy')
def search(centre: FloatArray, points: FloatArray, turns: FloatArray, allowed: Uint8Array, corner: FloatArray,
           per_metre: float, raster: Uint8Array, coarse: Uint8Array, apart_cells: int, apart_turn: float, share: float,
           best: FloatArray) -> None:
    """Find the best offset and rotation of the points, and its best rival.

    Offsets are whole cells, in blocks of BLOCK x BLOCK.

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
        Raster of end points.
    coarse : (H, W) uint8
        ``block_maximum`` of the raster.
    apart_cells : int
        Least distance of a rival along either axis [cells].
    apart_turn : float
        Least rotation of a rival [rad].
    share : float
        Rivals with a smaller share of the best score are ignored.
    best : (7,) float64
        Written: pose, its score from 0 to 1, score of the best rival (0 if there is none), and the rival's x, y.
    """
    count, side = points.shape[1], allowed.shape[0]
    blocks = side // 2
    xs = np.empty((turns.shape[0], count), np.int64)
    ys = np.empty((turns.shape[0], count), np.int64)
    spread = np.empty((turns.shape[0], 4), np.int64)
    places = np.flatnonzero(allowed)
    bounds = np.empty(turns.shape[0] * places.shape[0], np.int64)
    shift = BLOCK // 2
    for t in range(turns.shape[0]):
        c, s = math.cos(centre[2] + turns[t]), math.sin(centre[2] + turns[t])
        for k in range(count):
            xs[t, k] = int(math.floor((centre[0] + c * points[0, k] - s * points[1, k] - corner[0]) * per_metre))
            ys[t, k] = int(math.floor((centre[1] + s * points[0, k] + c * points[1, k] - corner[1]) * per_metre))
        spread[t, 0], spread[t, 1], spread[t, 2], spread[t, 3] = xs[t].min(), xs[t].max(), ys[t].min(), ys[t].max()
        for p in range(places.shape[0]):
            bounds[t * places.shape[0] + p] = _sum_at(
                xs[t], ys[t], spread[t], (places[p] % side - blocks) * BLOCK - shift,
                (places[p] // side - blocks) * BLOCK - shift, coarse)
    order = np.argsort(-bounds)
    top, rival = -1, -1
    top_x = top_y = top_t = rival_x = rival_y = 0
    for index in order:
        if bounds[index] <= top and bounds[index] < share * top:
            break
        if bounds[index] <= top and rival >= share * top:
            break
        t, place = index // places.shape[0], places[index % places.shape[0]]
        first_y = (place // side - blocks) * BLOCK - shift
        first_x = (place % side - blocks) * BLOCK - shift
        for dy in range(first_y, first_y + BLOCK):
            for dx in range(first_x, first_x + BLOCK):
                value = _sum_at(xs[t], ys[t], spread[t], dx, dy, raster)
                apart = (abs(dx - top_x) > apart_cells or abs(dy - top_y) > apart_cells
                         or abs(turns[t] - turns[top_t]) > apart_turn)
                if value > top:
                    if apart and top > rival:
                        rival, rival_x, rival_y = top, top_x, top_y
                    top, top_x, top_y, top_t = value, dx, dy, t
                elif apart and value > rival:
                    rival, rival_x, rival_y = value, dx, dy
    full = float(max(1, count) * CENTRE)
    best[0] = centre[0] + top_x / per_metre
    best[1] = centre[1] + top_y / per_metre
    best[2] = centre[2] + turns[top_t]
    best[3] = top / full
    best[4] = rival / full if rival >= share * top else 0.0
    best[5] = centre[0] + rival_x / per_metre
    best[6] = centre[1] + rival_y / per_metre


@njit(cache=True, nogil=True, error_model='numpy')
def mark_near(middles: FloatArray, places: FloatArray, least: FloatArray, most: FloatArray, room: float,
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
    room : float
        Greatest distance along either axis [m].
    near : (N, N) uint8
        Written: 1 for marked offsets, rows along y.
    """
    size, count = middles[1] - middles[0], middles.shape[0]
    beside = int(math.ceil(room / size))
    for k in range(places.shape[0]):
        column = int(round((places[k, 0] - middles[0]) / size))
        row = int(round((places[k, 1] - middles[0]) / size))
        for y in range(max(0, row - beside), min(count, row + beside + 1)):
            for x in range(max(0, column - beside), min(count, column + beside + 1)):
                length = math.sqrt(middles[x] * middles[x] + middles[y] * middles[y])
                if least[k] <= length <= most[k]:
                    near[y, x] = 1


@njit(cache=True, nogil=True, error_model='numpy')
def _inside(at: float, along: float, size: int) -> Tuple[float, float]:
    """Share of a ray along one axis, from 0 to 1, after which it enters the range, and after which it leaves it."""
    if abs(along) < 1e-9:
        return (0.0, 1.0) if 0.0 <= at < size else (1.0, 0.0)
    first, last = -at / along, (size - at) / along
    return max(0.0, min(first, last)), min(1.0, max(first, last))


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
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


@njit(cache=True, nogil=True, error_model='numpy')
def search_window(centre: FloatArray, offsets: FloatArray, turns: FloatArray, points: FloatArray, stride: int,
                  corner: FloatArray, per_metre: float, field: Uint8Array, best: FloatArray) -> None:
    """Search all offsets and rotations around a pose in a field of match values.

    Parameters
    ----------
    centre : (3,) float64
        Pose around which is searched [m, m, rad].
    offsets : (A, 3) float64
        x, y [m, map axes], and a penalty on the mean value of a point.
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
    xs, ys = np.empty(count), np.empty(count)
    best[3] = -1e9
    for t in range(turns.shape[0]):
        theta = centre[2] + turns[t, 0]
        c, s = math.cos(theta), math.sin(theta)
        for k in range(count):
            qx, qy = points[0, k * stride], points[1, k * stride]
            xs[k] = (centre[0] + c * qx - s * qy - corner[0]) * per_metre
            ys[k] = (centre[1] + s * qx + c * qy - corner[1]) * per_metre
        for a in range(offsets.shape[0]):
            dx, dy = offsets[a, 0] * per_metre, offsets[a, 1] * per_metre
            total = 0
            # sum to exceed; the loop ends as soon as the remaining points cannot reach it
            needed = (best[3] + offsets[a, 2] + turns[t, 1]) * 255.0 * count
            for k in range(count):
                if k & 7 == 0 and total + (count - k) * 255 <= needed:
                    break
                fx, fy = xs[k] + dx, ys[k] + dy
                if fx >= 0.0 and fy >= 0.0 and fx < field.shape[1] and fy < field.shape[0]:
                    total += field[int(fy), int(fx)]
            value = total / (255.0 * count) - offsets[a, 2] - turns[t, 1]
            if value > best[3]:
                best[0], best[1], best[2], best[3] = centre[0] + offsets[a, 0], centre[1] + offsets[a, 1], theta, value

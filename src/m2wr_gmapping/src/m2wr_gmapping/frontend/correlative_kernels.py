# SPDX-License-Identifier: BSD-3-Clause
"""Exhaustive search for a scan in a raster of old end points, with an upper bound that spares most of the work.

After the two-level idea of Olson, Real-Time Correlative Scan Matching, ICRA 2009: a second raster holds the maximum
over blocks, so that the score of a whole block of offsets is bounded by one evaluation.
"""
import math

import numpy as np
from numba import njit

BLOCK = 4               # offsets a side that share one bound
CENTRE, BESIDE, CORNER = 255, 170, 110     # what an end point gives to its cell and to those around it


@njit(cache=True, nogil=True, error_model='numpy')
def stamp_points(pose, points, corner, per_metre, raster):
    """Raise the cells around the end points (2, B) of a scan at ``pose`` in ``raster`` (H, W) uint8."""
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
def add_points(eye, pose, points, away, out, count):
    """Write those end points (2, B) of a scan at ``pose`` that lie within ``away`` [m] of ``eye``, and as seen from it.

    They come into ``out`` (2, Q) from column ``count`` on; returns where they end.
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
def block_maximum(raster, out):
    """Write into ``out`` (H, W) the maximum of the BLOCK x BLOCK cells from each cell on, towards larger indices."""
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
def _raise(values, others):
    """Raise each of the values (W,) to the other one; so plain that the compiler takes many at a time."""
    for k in range(values.shape[0]):
        values[k] = max(values[k], others[k])


@njit(cache=True, nogil=True, error_model='numpy')
def _sum_at(xs, ys, spread, dx, dy, raster):
    """Sum of the raster's values at the shifted cells; cells outside count nothing.

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
def search(centre, points, turns, allowed, corner, per_metre, raster, coarse, apart_cells, apart_turn, share, best):
    """Find the best offset and turn of ``points`` (2, Q) around ``centre`` (3,), and whether it is the only one.

    Offsets are whole cells, in blocks of BLOCK x BLOCK; ``allowed`` (2 * N + 1, 2 * N + 1) uint8 tells which blocks
    around the centre are searched, rows along y.  ``best`` (7,) gets the pose, its score between 0 and 1, and the score
    of the best rival that lies more than ``apart_cells`` or ``apart_turn`` away (0 if none comes within ``share`` of
    the best), and that one's x and y.
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
def mark_near(middles, places, least, most, room, near):
    """Mark the offsets that come near one of some places, and are of the length allowed for it.

    Parameters
    ----------
    middles : (N,) float64
        Offsets along either axis [m], evenly.
    places : (C, 2) float64
    least, most : (C,) float64
        Length of the offset [m].
    room : float
        How near, along either axis [m].
    near : (N, N) uint8
        Rows along y.
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
def _inside(at, along, size):
    """Share of a ray along one axis, from 0 to 1, after which it is inside, and after which it is no longer."""
    if abs(along) < 1e-9:
        return (0.0, 1.0) if 0.0 <= at < size else (1.0, 0.0)
    first, last = -at / along, (size - at) / along
    return max(0.0, min(first, last)), min(1.0, max(first, last))


@njit(cache=True, nogil=True, error_model='numpy')
def mark_seen(pose, rays, corner, per_metre, seen):
    """Mark the cells of ``seen`` (H, W) uint8 that the rays (2, S) of a scan at ``pose`` go through."""
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
def survey(centre, points, turns, allowed, corner, per_metre, raster, seen, against, share, rating, turn):
    """Rate offsets around ``centre`` (3,) by the points (2, Q) that come to lie on ground that was looked at.

    What has not been looked at speaks neither for a place nor against it; a point in free space speaks against it as
    ``against`` of them that lie on something speak for it.

    Parameters
    ----------
    turns : (T,) float64
    allowed : (N, N) uint8
        Offsets to rate, of whole cells, rows along y; none at [N // 2, N // 2].
    raster, seen : (H, W) uint8
        Of ``stamp_points`` and ``mark_seen``.
    against : int
    share : float
        What is rated by less than that share of the best so far need not be rated: 0.
    rating, turn : (N, N) float64
        Written, likewise: the best rating of all turns, from 0, where nothing speaks for a place, to 1; and the number
        of that turn.
    """
    count, half, width = points.shape[1], rating.shape[0] // 2, raster.shape[1]
    worth = np.empty(raster.size, np.int32)
    for k in range(worth.shape[0]):
        value = np.int32(raster.flat[k])
        known = value > 0 or seen.flat[k] > 0
        worth[k] = (1 + against) * value - (against * CENTRE if known else 0)
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
def search_window(centre, offsets, turns, points, stride, corner, per_metre, field, best):
    """Search all offsets and turns around a pose in a field of match values.

    Parameters
    ----------
    centre : (3,) float64
        Middle of the window.
    offsets : (A, 3) float64
        x, y [m, map axes] and a penalty that is taken off the mean value of a point.
    turns : (T, 2) float64
        Angle [rad] and penalty.
    points : (R, B) float64
        End points in the first two rows [m, laser frame]; every ``stride``-th is used.
    corner : (2,) float64
        World place of the field's corner [m].
    field : (H, W) uint8
    best : (4,) float64
        Written: pose and value, 1 at most.  Ties keep the earlier candidate: order both from the centre outwards.
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
            # what the sum must exceed; given up as soon as the points that are left cannot bring it there
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

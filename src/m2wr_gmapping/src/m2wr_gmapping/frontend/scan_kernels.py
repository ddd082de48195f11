# SPDX-License-Identifier: BSD-3-Clause
"""End points of a scan, and surface normals at the end points."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, Float32Array, FloatArray

SPARSE, SPARSE_MOST = tuning.SCANS.sparse
STRAIGHT, CROOKED = tuning.SCANS.straight


@kernel
def surface_normals(points: FloatArray, reach: float, side: int, limit: float, out: FloatArray) -> None:
    """Fit a line through each end point and its neighbours along the scan.

    Parameters
    ----------
    points : (2, B) float64
        End points in the order of their beams [m, laser frame].
    reach : float
        Greatest distance of a neighbour [m]. At grazing incidence, neighbours a little farther than the nearest one are
        also used.
    side : int
        Greatest number of neighbours on either side.
    limit : float
        Greatest range of the laser [m]. An end point with one neighbour is isolated, like a post, unless the next one
        would be out of range: then the wall continues there.
    out : (3, B) float64
        Written: unit normal x, y and straightness in [0, 1]. An isolated point gets straightness 0 and the direction to
        the laser.
    """
    count = points.shape[1]
    for b in range(count):
        x, y = points[0, b], points[1, b]
        nearest2 = math.inf
        for other in (b - 1, b + 1):
            if 0 <= other < count:
                dx, dy = points[0, other] - x, points[1, other] - y
                nearest2 = min(nearest2, dx * dx + dy * dy)
        reach2 = max(reach * reach, min(SPARSE * SPARSE * nearest2, SPARSE_MOST * SPARSE_MOST))
        n, sx, sy, sxx, sxy, syy = 1, 0.0, 0.0, 0.0, 0.0, 0.0
        beside_x = beside_y = 0.0
        for direction in (-1, 1):
            for k in range(1, side + 1):
                other = b + direction * k
                if other < 0 or other >= count:
                    break
                dx, dy = points[0, other] - x, points[1, other] - y
                if not dx * dx + dy * dy <= reach2:
                    break
                n += 1
                beside_x, beside_y = dx, dy
                sx += dx
                sy += dy
                sxx += dx * dx
                sxy += dx * dy
                syy += dy * dy
        norm = math.sqrt(x * x + y * y)
        if norm > 0.0:
            out[0, b], out[1, b], out[2, b] = -x / norm, -y / norm, 0.0
        else:
            out[0, b], out[1, b], out[2, b] = 1.0, 0.0, 0.0
        if n == 2:
            x, y, norm = x - beside_x, y - beside_y, math.sqrt(beside_x * beside_x + beside_y * beside_y)
            if norm > 0.0 and x * x + y * y > limit * limit:
                out[0, b], out[1, b], out[2, b] = -beside_y / norm, beside_x / norm, 1.0
        if n < 3:
            continue
        cxx, cxy, cyy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        half, product = 0.5 * (cxx - cyy), 0.5 * (cxx + cyy)
        root = math.sqrt(half * half + cxy * cxy)
        large, small = product + root, max(product - root, 0.0)
        if not large > 0.0:
            continue
        # axis of the larger spread is at angle atan2(cxy, half) / 2; the normal is across it
        c, s = 1.0, 0.0
        if half > 0.0:
            c, s = root + half, cxy
        elif root > 0.0:
            c, s = abs(cxy), math.copysign(root - half, cxy)
        length = math.sqrt(c * c + s * s)
        out[0, b], out[1, b] = -s / length, c / length
        out[2, b] = min(1.0, max(0.0, (CROOKED - math.sqrt(small / large)) / (CROOKED - STRAIGHT)))


@kernel
def with_normals(points: FloatArray, reach: float, side: int, limit: float, straight: float, beams: FloatArray) -> None:
    """Write end points and their surfaces as beams, in the layout of ``match_kernels``.

    Parameters
    ----------
    points : (2, B) float64
        End points [m, laser frame].
    reach : float
        See ``surface_normals`` [m].
    side : int
        See ``surface_normals``.
    limit : float
        See ``surface_normals`` [m].
    straight : float
        Weight of the tangential residual on a straight wall.
    beams : (7, B) float64
        Written.
    """
    shape = beams[2:5]          # the third of these rows holds straightness until the lever arm takes its place
    surface_normals(points, reach, side, limit, shape)
    for b in range(points.shape[1]):
        qx, qy, nx, ny, straightness = points[0, b], points[1, b], shape[0, b], shape[1, b], shape[2, b]
        beams[0, b], beams[1, b] = qx, qy
        beams[4, b] = ny * qx - nx * qy
        beams[5, b] = nx * qx + ny * qy
        beams[6, b] = 1.0 + (straight - 1.0) * straightness


@kernel
def classify_ranges(ranges: FloatArray, directions: FloatArray, limits: FloatArray, skip: int, gap: float,
                    points: FloatArray, used: BoolArray, rays: Float32Array, ray_hits: BoolArray) -> Tuple[int, int]:
    """Classify ranges as end points, beams that only clear space, and invalid ones.

    Parameters
    ----------
    ranges : (B,) float64
        Ranges in the order of the directions [m]; NaN and infinite ones are invalid.
    directions : (2, B) float64
        Cosines and sines of the beam angles.
    limits : (4,) float64
        Ranges below the first [m] are replaced by the second. Those above the third are invalid. Those above the fourth
        only clear space, up to the fourth.
    skip : int
        Beams left out of the matching between two used ones.
    gap : float
        End points closer than this to the one before are merged into their mean [m]; 0: none. Dropping them instead
        would select points by their noise and rotate the wall.
    points : (2, B) float64
        Written: end points [m].
    used : (B,) bool
        Written: end points for the matching; of merged points the first one decides.
    rays : (2, B) float32
        Written: ends of all beams that clear space [m].
    ray_hits : (B,) bool
        Written: beams that mark their end as occupied.

    Returns
    -------
    int
        Number of end points, and of beams that clear space.
    """
    count = seen = together = 0
    first_x = first_y = 0.0
    for b in range(ranges.shape[0]):
        r = ranges[b]
        if r < limits[0]:
            r = limits[1]
        if not (r > 0.0 and r <= limits[2]):
            continue
        cut = min(r, limits[3])
        rays[0, seen], rays[1, seen] = cut * directions[0, b], cut * directions[1, b]
        ray_hits[seen] = r < limits[3]
        seen += 1
        if not r <= limits[3]:
            continue
        x, y = r * directions[0, b], r * directions[1, b]
        if together > 0 and (x - first_x) * (x - first_x) + (y - first_y) * (y - first_y) < gap * gap:
            together += 1
            points[0, count - 1] += (x - points[0, count - 1]) / together
            points[1, count - 1] += (y - points[1, count - 1]) / together
            continue
        first_x, first_y, together = x, y, 1
        points[0, count], points[1, count] = x, y
        used[count] = b % (skip + 1) == skip
        count += 1
    return count, seen


@kernel
def profile(rays: Float32Array, out: FloatArray) -> None:
    """Write the mean range of the beams in each sector around the laser.

    Parameters
    ----------
    rays : (2, S) float32
        Ends of the beams [m, laser frame].
    out : (N,) float64
        Written: mean ranges [m], 0 for sectors without beams.
    """
    counts = np.zeros(out.shape[0], np.int64)
    out[:] = 0.0
    by = out.shape[0] / (2.0 * math.pi)
    for k in range(rays.shape[1]):
        x, y = rays[0, k], rays[1, k]
        sector = int((math.atan2(y, x) + math.pi) * by) % out.shape[0]
        out[sector] += math.sqrt(x * x + y * y)
        counts[sector] += 1
    for k in range(out.shape[0]):
        if counts[k]:
            out[k] /= counts[k]


@kernel
def changed_sectors(before: FloatArray, now: FloatArray, least: float) -> Tuple[int, int]:
    """Compare two profiles (N,), as of ``profile``.

    Parameters
    ----------
    before : (N,) float64
        Mean ranges [m], 0 for sectors without beams.
    now : (N,) float64
        The same of a later scan.
    least : float
        Change of a mean range that counts [m].

    Returns
    -------
    int
        Number of sectors whose range has changed, and of those with beams in either.
    """
    changed = present = 0
    for k in range(now.shape[0]):
        changed += abs(now[k] - before[k]) > least
        present += now[k] > 0.0 or before[k] > 0.0
    return changed, present

# SPDX-License-Identifier: BSD-3-Clause
"""Ray casting of a laser scanner on triangle meshes.

All arguments are plain arrays.  ``frame``, ``beams``, ``rows``, ``spheres`` and ``shapes`` have the layouts of
:mod:`m2wr_sim.sensors.ray_kernels`.  The others are:

``nodes`` (K, 6)
    Boxes, centre and half sizes, relative to the centre of the mesh.  Each mesh has a complete binary tree in heap
    order: the children of node i are 2 i + 1 and 2 i + 2.
``triangles`` (M, 9)
    First corner, then the two edges from it, in the order of the leaves.
``trees`` (T, 4) int64
    First node, first triangle, number of triangles, number of leaves (a power of two).

All beams of a row descend a tree together.  At each box only the beams remain that lie between its extreme azimuths and
have no nearer hit; at boxes above or below the beams none remain.  At a leaf each triangle is intersected with the
remaining beams.  Its plane equation is linear in cosine and sine of the azimuth.  Both sides of a triangle are visible.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_sim.sensors.base_kernels import atan, azimuth, kernel, product, rotation

MESH = 4
ORIENTATION, RANGE_MIN, RANGE_MAX, ANGLE_MIN, ANGLE_STEP, IGNORED = 3, 7, 8, 9, 10, 12
KIND, OWNER, TREE = 12, 14, 15
AZIMUTH_MARGIN = 5e-5   # rad; more than the error of azimuth and atan together
FEW_BEAMS = 8           # with fewer beams, computing the azimuths takes more time than it saves
EDGE = 1e-10            # of an edge's length, by which triangles overlap, so that no beam passes between two of them
GRAZING = 1e-12         # rad; a beam at a smaller angle to a triangle does not hit it
STACK = 512             # a tree of 21 levels, with three ranges of beams for each of two children

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


@kernel
def _span(low: float, high: float, turn: int, frame: Floats, first: int, last: int) -> Tuple[int, int]:
    """Return the range of beams in [first, last) whose azimuth is in [low, high] plus ``turn`` full rotations."""
    shift = 2.0 * math.pi * turn - frame[ANGLE_MIN]
    one, two = (low + shift) / frame[ANGLE_STEP], (high + shift) / frame[ANGLE_STEP]
    if frame[ANGLE_STEP] < 0.0:
        one, two = two, one
    one = min(max(one, float(first)), float(last))
    two = min(max(two, first - 1.0), last - 1.0)
    return int(math.ceil(one)), int(math.floor(two)) + 1


@kernel
def _turns(low: float, high: float, frame: Floats, n: int) -> Tuple[int, int]:
    """Return by how many full rotations, first and last, to shift an interval so that it overlaps the beams."""
    least, most = frame[ANGLE_MIN], frame[ANGLE_MIN] + frame[ANGLE_STEP] * (n - 1)
    if most < least:
        least, most = most, least
    return (int(math.ceil((least - high) / (2.0 * math.pi))), int(math.floor((most - low) / (2.0 * math.pi))))


@kernel
def _box_bounds(box: Floats, a: Sequence[float], p: Sequence[float], flat: float,
                up: float) -> Tuple[float, float, float]:
    """Return the least distance of a box and its extreme azimuths; infinity if the row of beams misses it.

    ``a`` rotates from the sensor's frame to that of the mesh, ``p`` is the centre of the mesh in the sensor's frame.
    The azimuths are -inf, inf if the box surrounds the sensor.
    """
    x = p[0] + a[0] * box[0] + a[3] * box[1] + a[6] * box[2]
    y = p[1] + a[1] * box[0] + a[4] * box[1] + a[7] * box[2]
    z = p[2] + a[2] * box[0] + a[5] * box[1] + a[8] * box[2]
    thick = abs(a[2]) * box[3] + abs(a[5]) * box[4] + abs(a[8]) * box[5]
    out = math.sqrt(x * x + y * y)
    ux, uy = (x / out, y / out) if out > 1e-12 else (1.0, 0.0)
    deep = (abs(ux * a[0] + uy * a[1]) * box[3] + abs(ux * a[3] + uy * a[4]) * box[4]
            + abs(ux * a[6] + uy * a[7]) * box[5])
    wide = (abs(ux * a[1] - uy * a[0]) * box[3] + abs(ux * a[4] - uy * a[3]) * box[4]
            + abs(ux * a[7] - uy * a[6]) * box[5])
    if flat > 1e-6:         # else the beams point backwards, and azimuths do not bound the box
        reach = abs(up) * math.sqrt(deep * deep + wide * wide) + flat * thick
        if abs(out * up - z * flat) > reach + 1e-9 * (out + abs(z) + reach):
            return np.inf, -np.inf, np.inf
    gap, gap_z = max(out - deep, 0.0), max(abs(z) - thick, 0.0)
    near = math.sqrt(gap * gap + gap_z * gap_z) * (1.0 - 1e-9)
    if flat > 1e-6 and gap > 1e-6 * out:
        half, middle = atan(wide / gap) + AZIMUTH_MARGIN, azimuth(y, x)
        return near, middle - half, middle + half
    return near, -np.inf, np.inf


@kernel
def _triangle_bounds(v: Floats, a: Sequence[float], o: Sequence[float], flat: float,
                     up: float) -> Tuple[bool, float, float]:
    """Return whether a row of beams can hit a triangle, and its extreme azimuths; -inf, inf if it surrounds."""
    x, y = np.empty(3), np.empty(3)
    above, below = 0, 0
    for corner in range(3):
        lx, ly, lz = v[0] - o[0], v[1] - o[1], v[2] - o[2]
        if corner > 0:
            lx, ly, lz = lx + v[3 * corner], ly + v[3 * corner + 1], lz + v[3 * corner + 2]
        x[corner], y[corner] = a[0] * lx + a[3] * ly + a[6] * lz, a[1] * lx + a[4] * ly + a[7] * lz
        z = a[2] * lx + a[5] * ly + a[8] * lz
        out = math.sqrt(x[corner] * x[corner] + y[corner] * y[corner])
        side, doubt = out * up - z * flat, 1e-9 * (out + abs(z))
        above += 1 if side < -doubt else 0
        below += 1 if side > doubt else 0
    # the distance from the cone is convex for beams that rise and concave for those that fall
    if (above == 3 and up >= 0.0) or (below == 3 and up <= 0.0):
        return False, 0.0, 0.0
    mx, my = x[0] + x[1] + x[2], y[0] + y[1] + y[2]
    low, high = 0.0, 0.0
    for corner in range(3):
        along, across = mx * x[corner] + my * y[corner], mx * y[corner] - my * x[corner]
        angle = azimuth(across, along)
        low, high = min(low, angle), max(high, angle)
    if not high - low < math.pi - 2.0 * AZIMUTH_MARGIN:
        return True, -np.inf, np.inf
    middle = azimuth(my, mx)
    return True, middle + low - AZIMUTH_MARGIN, middle + high + AZIMUTH_MARGIN


@kernel
def _intersect(v: Floats, a: Sequence[float], o: Sequence[float], flat: float, up: float, cosine: Floats, sine: Floats,
               nearest: float, ranges: Floats, hits: NDArray[np.int64], row: int) -> None:
    """Lower the ranges of adjacent beams to a triangle, by the Moeller-Trumbore test with precomputed constants."""
    sx, sy, sz = o[0] - v[0], o[1] - v[1], o[2] - v[2]
    nx, ny, nz = v[4] * v[8] - v[5] * v[7], v[5] * v[6] - v[3] * v[8], v[3] * v[7] - v[4] * v[6]
    ax, ay, az = v[7] * sz - v[8] * sy, v[8] * sx - v[6] * sz, v[6] * sy - v[7] * sx        # second edge x offset
    bx, by, bz = sy * v[5] - sz * v[4], sz * v[3] - sx * v[5], sx * v[4] - sy * v[3]        # offset x first edge
    top = v[6] * bx + v[7] * by + v[8] * bz
    n0, n1, n2 = -(nx * a[0] + ny * a[3] + nz * a[6]) * flat, -(nx * a[1] + ny * a[4] + nz * a[7]) * flat, \
        -(nx * a[2] + ny * a[5] + nz * a[8]) * up
    a0, a1, a2 = (ax * a[0] + ay * a[3] + az * a[6]) * flat, (ax * a[1] + ay * a[4] + az * a[7]) * flat, \
        (ax * a[2] + ay * a[5] + az * a[8]) * up
    b0, b1, b2 = (bx * a[0] + by * a[3] + bz * a[6]) * flat, (bx * a[1] + by * a[4] + bz * a[7]) * flat, \
        (bx * a[2] + by * a[5] + bz * a[8]) * up
    least = GRAZING * math.sqrt(nx * nx + ny * ny + nz * nz)
    for i in range(ranges.size):
        slope = n0 * cosine[i] + n1 * sine[i] + n2
        inverse = 1.0 / slope
        u = (a0 * cosine[i] + a1 * sine[i] + a2) * inverse
        w = (b0 * cosine[i] + b1 * sine[i] + b2) * inverse
        t = top * inverse
        hit = (u >= -EDGE) & (w >= -EDGE) & (u + w <= 1.0 + EDGE) & (abs(slope) > least) & (t > nearest)
        if hit and t < ranges[i]:
            ranges[i] = t
            if hits.size > 0:
                hits[i] = row


@kernel
def _leaf(triangles: Floats, first_triangle: int, last_triangle: int, first: int, last: int, bounded: bool, row: int,
          start: int, ranges: Floats, hits: NDArray[np.int64], beams: Floats, frame: Floats, a: Sequence[float],
          o: Sequence[float],
          flat: float, up: float) -> None:
    """Cast adjacent beams of one row on the triangles of a leaf; ``start`` is the index of the row's first range."""
    for number in range(first_triangle, last_triangle):
        v = triangles[number]
        low, high, turn, last_turn = -np.inf, np.inf, 0, 0
        if bounded and last - first > FEW_BEAMS:
            possible, low, high = _triangle_bounds(v, a, o, flat, up)
            if not possible:
                continue
            if low > -np.inf:
                turn, last_turn = _turns(low, high, frame, beams.shape[1])
        while turn <= last_turn:
            one, two = first, last
            if low > -np.inf:
                one, two = _span(low, high, turn, frame, first, last)
            if one < two:
                run = slice(start + one, start + two)
                _intersect(v, a, o, flat, up, beams[0, one:two], beams[1, one:two], frame[RANGE_MIN], ranges[run],
                           hits[run] if hits.size > 0 else hits, row)
            turn += 1


@kernel
def _cast_tree(tree: NDArray[np.int64], nodes: Floats, triangles: Floats, row: int, start: int, ranges: Floats,
               hits: NDArray[np.int64], beams: Floats, frame: Floats, a: Sequence[float], p: Sequence[float],
               o: Sequence[float], flat: float, up: float, stack: NDArray[np.int64]) -> None:
    """Cast one row of beams on one mesh."""
    n = beams.shape[1]
    node_base, triangle_base, count, leaves = tree[0], tree[1], tree[2], tree[3]
    fan = n > FEW_BEAMS and 1e-12 < abs(frame[ANGLE_STEP]) * (n - 1) < 4.0 * math.pi
    stack[0, 0], stack[0, 1], stack[0, 2] = 0, 0, n
    depth = 1
    while depth > 0:
        depth -= 1
        node, begin, end = stack[depth, 0], stack[depth, 1], stack[depth, 2]
        near, low, high = _box_bounds(nodes[node_base + node], a, p, flat, up)
        if not near <= frame[RANGE_MAX]:
            continue
        bounded = fan and low > -np.inf and high - low < 2.0 * math.pi
        turn, last_turn = _turns(low, high, frame, n) if bounded else (0, 0)
        while turn <= last_turn:
            first, last = _span(low, high, turn, frame, begin, end) if bounded else (begin, end)
            turn += 1
            while first < last and ranges[start + first] <= near:
                first += 1
            while last > first and ranges[start + last - 1] <= near:
                last -= 1
            if first >= last:
                continue
            if node >= leaves - 1:
                leaf = node - (leaves - 1)
                _leaf(triangles, triangle_base + leaf * count // leaves, triangle_base + (leaf + 1) * count // leaves,
                      first, last, fan and flat > 1e-6, row, start, ranges, hits, beams, frame, a, o, flat, up)
                continue
            one, two = nodes[node_base + 2 * node + 1], nodes[node_base + 2 * node + 2]
            first_is_near = ((one[0] - o[0]) ** 2 + (one[1] - o[1]) ** 2 + (one[2] - o[2]) ** 2
                             < (two[0] - o[0]) ** 2 + (two[1] - o[1]) ** 2 + (two[2] - o[2]) ** 2)
            for child in range(2):      # the nearer one is pushed last and visited first
                stack[depth, 0] = 2 * node + 1 + (1 if (child == 0) == first_is_near else 0)
                stack[depth, 1], stack[depth, 2] = first, last
                depth += 1


@kernel
def cast_meshes(ranges: Floats, hits: NDArray[np.int64], beams: Floats, rows: Floats, frame: Floats, spheres: Floats,
                shapes: Floats, order: NDArray[np.int32], found: int, nodes: Floats, triangles: Floats,
                trees: NDArray[np.int64]) -> None:
    """Lower ranges to the meshes among the first ``found`` rows of ``order``, after ``ray_kernels.cast_rays``.

    Parameters
    ----------
    ranges : (V * N,) float64
        Lowered where a mesh is nearer [m].
    hits : (V * N,) or (0,) int64
        Unless empty, set to the row of the mesh that is hit.
    beams, rows, frame, spheres, shapes, nodes, triangles : float64
        Read only.
    order : (2, C) int32
        In the first row, the shapes within reach, from near to far.
    found : int
        Number of shapes within reach.
    trees : (T, 4) int64
    """
    n = beams.shape[1]
    stack = np.empty((STACK, 3), np.int64)
    for k in range(found):
        row = order[0, k]
        if shapes[row, KIND] != MESH or (frame[IGNORED] >= 0.0 and shapes[row, OWNER] == frame[IGNORED]):
            continue
        b = shapes[row]
        cx, cy, cz = spheres[0, row] - frame[0], spheres[1, row] - frame[1], spheres[2, row] - frame[2]
        a = product(b, rotation(frame[3], frame[4], frame[5], frame[6]))
        o = (-(b[0] * cx + b[3] * cy + b[6] * cz), -(b[1] * cx + b[4] * cy + b[7] * cz),
             -(b[2] * cx + b[5] * cy + b[8] * cz))
        p = (-(a[0] * o[0] + a[3] * o[1] + a[6] * o[2]), -(a[1] * o[0] + a[4] * o[1] + a[7] * o[2]),
             -(a[2] * o[0] + a[5] * o[1] + a[8] * o[2]))
        for j in range(rows.shape[0]):
            _cast_tree(trees[int(b[TREE])], nodes, triangles, row, j * n, ranges, hits, beams, frame, a, p, o,
                       rows[j, 0], rows[j, 1], stack)

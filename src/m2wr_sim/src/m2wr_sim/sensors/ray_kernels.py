# SPDX-License-Identifier: BSD-3-Clause
"""Ray casting of a laser scanner on boxes, spheres, cylinders and planes.

All arguments are plain arrays.  ``cast_rays`` visits the shapes from near to far.  For each shape it visits only the
beams between the extreme azimuths of its outline, in loops without branches that the compiler vectorises.  Without
numba the functions run as plain Python with the same results, but slowly.

Array layouts
-------------
``frame`` (14,)
    Sensor position in the world [m], sensor orientation x y z w, shortest range, longest range [m], azimuth of beam 0
    and step between beams [rad], number of rows in use, id of an owner to ignore (-1: none), unused.
``beams`` (2, N), ``rows`` (V, 2)
    Cosine and sine of every beam's azimuth; cosine and sine of every row's elevation (positive is up).
``spheres`` (4, C)
    Bounding sphere of each shape: centre in the world, radius [m].  A NaN centre marks an unused row.
``shapes`` (C, 16)
    Rotation world-from-shape (row-major, 9), half sizes (3; radius first for round shapes, half length third), kind,
    laser_retro, owner id, tree.  A plane has its unit normal in the first three columns.  A mesh, which is handled by
    :mod:`m2wr_sim.sensors.mesh_kernels`, has the centre of its bounding sphere in place of half sizes; so has a
    heightmap (GROUND), see :mod:`m2wr_sim.sensors.height_ray_kernels`.

The ray parameter t is the distance from the sensor's origin.  A ray starts at the shortest range.  If that point is
inside a shape, the hit is where the ray leaves the shape.  A surface exactly at the shortest range is not hit.
"""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence, Tuple

import numpy as np

from m2wr_sim.sensors.base_kernels import (  # noqa: F401
    HAVE_NUMBA,
    atan,
    azimuth,
    inlined,
    kernel,
    product,
    rotation,
)
from m2wr_sim.sensors.range_kernels import BOX, CYLINDER, PLANE, SPHERE, TINY, sweep  # noqa: F401

MESH, GROUND = 4, 5             # further kinds of shapes, see range_kernels for those before
POSITION, ORIENTATION, RANGE_MIN, RANGE_MAX, ANGLE_MIN, ANGLE_STEP = 0, 3, 7, 8, 9, 10
COUNT, IGNORED, FRAME_SIZE = 11, 12, 14
HALF, KIND, RETRO, OWNER, TREE, SHAPE_SIZE = 9, 12, 13, 14, 15, 16
RINGS = 64              # classes of distance for the near-to-far order
AZIMUTH_MARGIN = 5e-5   # rad; more than the error of azimuth and atan together
FEW_BEAMS = 8           # with fewer beams, computing the azimuths takes more time than it saves
MANY = 100              # with more shapes within reach most are hidden, and testing for that first saves time
OUTSIDE, CROSSING, INSIDE = 0, 1, 2     # beams relative to the height of a shape

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.sensors.range_kernels import Terms

    Floats = NDArray[np.float64]
    Vector = Tuple[float, float, float]


@kernel
def write_poses(spheres: Floats, shapes: Floats, rows: NDArray[np.int64], poses: Floats) -> None:
    """Move shapes: write the centre and rotation of each.

    Parameters
    ----------
    spheres : (4, C) float64
        Written.
    shapes : (C, 16) float64
        Written.
    rows : (n,) int64
        Rows of the shapes; others than those of the table are ignored.
    poses : (n, 7) float64
        Poses in the world: position x y z [m], quaternion x y z w.
    """
    for k in range(rows.shape[0]):
        row = rows[k]
        if row < 0 or row >= shapes.shape[0]:
            continue
        for axis in range(3):
            spheres[axis, row] = poses[k, axis]
        if shapes[row, KIND] != PLANE:      # a plane's normal is given in world axes
            matrix = rotation(poses[k, 3], poses[k, 4], poses[k, 5], poses[k, 6])
            for column in range(9):
                shapes[row, column] = matrix[column]
            if shapes[row, KIND] >= MESH:
                x, y, z = shapes[row, HALF], shapes[row, HALF + 1], shapes[row, HALF + 2]
                for axis in range(3):
                    spheres[axis, row] += matrix[3 * axis] * x + matrix[3 * axis + 1] * y + matrix[3 * axis + 2] * z


@kernel
def _ahead(beams: Floats, rows: Floats, frame: Floats, sensor: Sequence[float]) -> Vector:
    """Return the direction in the world that is at most 90 degrees from each beam; zeros if there is none."""
    half = 0.5 * frame[ANGLE_STEP] * (beams.shape[1] - 1)
    if not abs(half) <= 0.5 * math.pi + 1e-12:      # a field of view of 180 degrees is common, and has rounding errors
        return 0.0, 0.0, 0.0
    for j in range(rows.shape[0]):
        if rows[j, 0] < 0.0:
            return 0.0, 0.0, 0.0
    x, y = math.cos(frame[ANGLE_MIN] + half), math.sin(frame[ANGLE_MIN] + half)
    return sensor[0] * x + sensor[1] * y, sensor[3] * x + sensor[4] * y, sensor[6] * x + sensor[7] * y


@kernel
def _near_to_far(order: NDArray[np.int32], near: NDArray[np.int32], frame: Floats, spheres: Floats,
                 ahead: Vector) -> int:
    """Write the rows within reach, sorted by distance in ``RINGS`` classes, to ``order[0]``; return their number."""
    listed = near.shape[0] > 0
    count = near.shape[0] if listed else min(int(frame[COUNT]), order.shape[1])
    x, y, z, longest = frame[0], frame[1], frame[2], frame[RANGE_MAX]
    scale = RINGS / longest
    cx, cy, cz, radius, ring = spheres[0], spheres[1], spheres[2], spheres[3], order[1]
    ax, ay, az = ahead
    if listed:          # a loop of its own, as the one over all rows is vectorised
        for k in range(count):
            row = near[k]
            dx, dy, dz, reach = cx[row] - x, cy[row] - y, cz[row] - z, longest + radius[row]
            squared = dx * dx + dy * dy + dz * dz
            key = math.sqrt(squared) * scale
            key = key if key < RINGS - 1.0 else RINGS - 1.0
            seen = (squared <= reach * reach) & (dx * ax + dy * ay + dz * az >= -1.000001 * radius[row] - 1e-6)
            ring[k] = int(key) if seen else RINGS       # also for NaN
    else:
        for k in range(count):
            dx, dy, dz, reach = cx[k] - x, cy[k] - y, cz[k] - z, longest + radius[k]
            squared = dx * dx + dy * dy + dz * dz
            key = math.sqrt(squared) * scale
            key = key if key < RINGS - 1.0 else RINGS - 1.0
            seen = (squared <= reach * reach) & (dx * ax + dy * ay + dz * az >= -1.000001 * radius[k] - 1e-6)
            key = key if seen else RINGS + 0.0      # also for NaN
            ring[k] = int(key)
    starts = np.zeros(RINGS + 2, np.int64)
    for k in range(count):
        starts[ring[k] + 1] += 1
    for k in range(RINGS):
        starts[k + 1] += starts[k]
    found = starts[RINGS]
    for k in range(count):
        if ring[k] < RINGS:
            order[0, starts[ring[k]]] = near[k] if listed else k
            starts[ring[k]] += 1
    return found


@kernel
def _box_interval(px: float, py: float, u: Tuple[float, float], v: Tuple[float, float],
                  w: Tuple[float, float]) -> Tuple[float, float]:
    """Return the extreme azimuths of the corners of a box relative to its centre; -inf, inf if it surrounds the sensor.

    ``px, py`` is the centre and ``u, v, w`` are the half edges, both projected on the scan plane.  If the span is pi or
    more, the outline contains the sensor, because the outline is convex.
    """
    square = px * px + py * py
    du, dv, dw = px * u[0] + py * u[1], px * v[0] + py * v[1], px * w[0] + py * w[1]
    xu, xv, xw = px * u[1] - py * u[0], px * v[1] - py * v[0], px * w[1] - py * w[0]
    low, high = 0.0, 0.0
    if square - abs(du) - abs(dv) - abs(dw) > 1e-3 * square:    # all corners in front: slopes have the order of angles
        for corner in range(4):
            sv, sw = 1.0 - (corner & 1) * 2.0, 1.0 - (corner & 2)
            across, along = xu + sv * xv + sw * xw, du + sv * dv + sw * dw
            first, second = across / (square + along), -across / (square - along)
            low, high = min(low, min(first, second)), max(high, max(first, second))
        return atan(low), atan(high)
    if not square > 1e-12:
        return -np.inf, np.inf
    for corner in range(4):
        sv, sw = 1.0 - (corner & 1) * 2.0, 1.0 - (corner & 2)
        across, along = xu + sv * xv + sw * xw, du + sv * dv + sw * dw
        first, second = azimuth(across, square + along), azimuth(-across, square - along)
        low, high = min(low, min(first, second)), max(high, max(first, second))
    if high - low < math.pi - AZIMUTH_MARGIN:
        return low, high
    return -np.inf, np.inf


@kernel
def _disc_interval(px: float, py: float, radius: float) -> Tuple[float, float]:
    """Return the extreme azimuths of a disc in the scan plane relative to its centre; -inf, inf if it surrounds."""
    left = px * px + py * py - radius * radius
    if not left > 1e-12:
        return -np.inf, np.inf
    half = atan(radius / math.sqrt(left))
    return -half, half


@kernel
def _beam_span(low: float, high: float, turn: int, frame: Floats, count: int) -> Tuple[int, int]:
    """Return the half-open range of beams whose azimuth lies in [low, high] shifted by ``turn`` full turns."""
    shift = 2.0 * math.pi * turn - frame[ANGLE_MIN]
    first, last = (low + shift) / frame[ANGLE_STEP], (high + shift) / frame[ANGLE_STEP]
    if frame[ANGLE_STEP] < 0.0:
        first, last = last, first
    first = min(max(first, 0.0), float(count))
    last = min(max(last, -1.0), count - 1.0)
    return int(math.ceil(first)), int(math.floor(last)) + 1


@inlined
def _cast_run(row: int, tall: bool, out: Floats, hits: NDArray[np.int64], scratch: Floats, cosine: Floats, sine: Floats,
              x: Terms, y: Terms, z: Terms, half: Vector, kind: int, nearest: float) -> None:
    """Cast adjacent beams on one shape; if ``hits`` is not empty, write the shape's row for beams that hit it first."""
    if hits.size == 0:
        sweep(kind, tall, out, cosine, sine, x, y, z, half, nearest)
        return
    found = scratch[:out.size]
    found[:] = np.inf
    sweep(kind, tall, found, cosine, sine, x, y, z, half, nearest)
    for i in range(out.size):
        if found[i] < out[i]:
            out[i], hits[i] = found[i], row


@kernel
def _cast_plane(row: int, ranges: Floats, hits: NDArray[np.int64], scratch: Floats, beams: Floats, rows: Floats,
                frame: Floats, sensor: Sequence[float], centre: Vector, shapes: Floats) -> None:
    """Cast all beams on a plane, except rows of beams that are too short to reach it."""
    n = beams.shape[1]
    nx, ny, nz = shapes[row, 0], shapes[row, 1], shapes[row, 2]
    height = -(nx * centre[0] + ny * centre[1] + nz * centre[2])        # of the sensor above the plane
    x0, x1 = nx * sensor[0] + ny * sensor[3] + nz * sensor[6], nx * sensor[1] + ny * sensor[4] + nz * sensor[7]
    x2 = nx * sensor[2] + ny * sensor[5] + nz * sensor[8]
    for j in range(rows.shape[0]):
        flat, up = rows[j, 0], rows[j, 1]
        if abs(height) > frame[RANGE_MAX] * (math.hypot(x0, x1) * abs(flat) + abs(x2 * up)):
            continue
        x, run = (x0 * flat, x1 * flat, x2 * up, height), slice(j * n, j * n + n)
        _cast_run(row, False, ranges[run], hits[run] if hits.size > 0 else hits, scratch, beams[0], beams[1],
                  x, x, x, x[:3], PLANE, frame[RANGE_MIN])


@kernel
def _interval(kind: int, px: float, py: float, a: Sequence[float], half: Vector, radius: float) -> Tuple[float, float]:
    """Return the extreme azimuths of a shape in the sensor's frame; -inf, inf if it surrounds the sensor."""
    if kind == BOX:
        low, high = _box_interval(px, py, (a[0] * half[0], a[1] * half[0]), (a[3] * half[1], a[4] * half[1]),
                                  (a[6] * half[2], a[7] * half[2]))
    elif kind == CYLINDER:      # projected, it lies in a disc of its radius plus half the projected length of its axis
        low, high = _disc_interval(px, py, min(radius, half[0] + half[2] * math.sqrt(a[6] * a[6] + a[7] * a[7])))
    else:
        low, high = _disc_interval(px, py, radius)
    if low > -np.inf:
        middle = azimuth(py, px)
        low, high = middle + low - AZIMUTH_MARGIN, middle + high + AZIMUTH_MARGIN
        if high - low < 2.0 * math.pi:      # false for NaN
            return low, high
    return -np.inf, np.inf


@kernel
def _nearest_point(kind: int, o: Vector, half: Vector) -> float:
    """Return the distance from a point ``o`` in the shape's frame to the shape; 0 inside."""
    if kind == SPHERE:
        return max(math.sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2]) - half[0], 0.0)
    dz = max(abs(o[2]) - half[2], 0.0)
    if kind == CYLINDER:
        dx, dy = max(math.sqrt(o[0] * o[0] + o[1] * o[1]) - half[0], 0.0), 0.0
    else:
        dx, dy = max(abs(o[0]) - half[0], 0.0), max(abs(o[1]) - half[1], 0.0)
    return math.sqrt(dx * dx + dy * dy + dz * dz)


@kernel
def _turns(low: float, high: float, frame: Floats, n: int) -> Tuple[int, int]:
    """Return by how many full rotations, first and last, to shift an interval so that it overlaps the beams."""
    least, most = frame[ANGLE_MIN], frame[ANGLE_MIN] + frame[ANGLE_STEP] * (n - 1)
    if most < least:
        least, most = most, least
    return (int(math.ceil((least - high) / (2.0 * math.pi))), int(math.floor((most - low) / (2.0 * math.pi))))


@kernel
def _height_over(z: Terms, beams: Floats, first: int, last: int, step: float, near: float, far: float,
                 half: float) -> int:
    """Return where adjacent beams are along the axis z of a shape while they are from ``near`` to ``far`` away.

    Their rise per metre is a sinusoid of the azimuth.  Between two azimuths it exceeds its values at both by at most
    amplitude * (1 - cos(angle / 2)).
    """
    one = z[0] * beams[0, first] + z[1] * beams[1, first] + z[2]
    two = z[0] * beams[0, last] + z[1] * beams[1, last] + z[2]
    angle = step * (last - first)
    spare = 0.125 * angle * angle * math.sqrt(z[0] * z[0] + z[1] * z[1]) + 1e-9
    low, high = min(one, two) - spare, max(one, two) + spare
    low = z[3] + low * (near if low > 0.0 else far)
    high = z[3] + high * (far if high > 0.0 else near)
    if low > half or high < -half:
        return OUTSIDE
    return INSIDE if -half <= low and high <= half else CROSSING


@kernel
def _cast_solid(row: int, ranges: Floats, hits: NDArray[np.int64], scratch: Floats, beams: Floats, rows: Floats,
                frame: Floats, sensor: Sequence[float], centre: Vector, radius: float, shapes: Floats) -> None:
    """Cast the beams that can hit a box, sphere or cylinder and have no nearer hit."""
    n, b = beams.shape[1], shapes[row]
    kind, half = int(b[KIND]), (b[HALF], b[HALF + 1], b[HALF + 2])
    px = sensor[0] * centre[0] + sensor[3] * centre[1] + sensor[6] * centre[2]
    py = sensor[1] * centre[0] + sensor[4] * centre[1] + sensor[7] * centre[2]
    pz = sensor[2] * centre[0] + sensor[5] * centre[1] + sensor[8] * centre[2]
    out_there, margin = math.sqrt(px * px + py * py), radius * (1.0 + 1e-9) + 1e-9
    away = math.sqrt(px * px + py * py + pz * pz)
    if away + margin < frame[RANGE_MIN]:        # as the laser's own housing
        return
    if rows.shape[0] == 1 and rows[0, 0] > 1e-6 and abs(out_there * rows[0, 1] - pz * rows[0, 0]) > margin:
        return
    a = product(b, sensor)     # shape-from-sensor
    o = (-(b[0] * centre[0] + b[3] * centre[1] + b[6] * centre[2]),
         -(b[1] * centre[0] + b[4] * centre[1] + b[7] * centre[2]),
         -(b[2] * centre[0] + b[5] * centre[1] + b[8] * centre[2]))
    near = _nearest_point(kind, o, half) * (1.0 - 1e-9)
    if near > frame[RANGE_MAX]:
        return
    low, high, first_turn, last_turn = -np.inf, np.inf, 0, 0
    if n > FEW_BEAMS and 1e-12 < abs(frame[ANGLE_STEP]) * (n - 1) < 4.0 * math.pi:
        low, high = _interval(kind, px, py, a, half, radius)
        if low > -np.inf:
            first_turn, last_turn = _turns(low, high, frame, n)
    tilt = math.sqrt(a[6] * a[6] + a[7] * a[7])
    farthest = min(frame[RANGE_MAX], away + margin)
    for j in range(rows.shape[0]):
        flat, up = rows[j, 0], rows[j, 1]
        rise = farthest * (tilt * abs(flat) + abs(a[8] * up))       # of any beam along the shape's z
        if kind != SPHERE and abs(o[2]) - rise > half[2]:
            continue
        tall, over = abs(o[2]) + rise <= half[2], CROSSING
        x, y = (a[0] * flat, a[1] * flat, a[2] * up, o[0]), (a[3] * flat, a[4] * flat, a[5] * up, o[1])
        z = (a[6] * flat, a[7] * flat, a[8] * up, o[2])
        upright = flat > 1e-6       # else the beams point backwards, and azimuths do not bound the shape
        if upright and abs(out_there * up - pz * flat) > margin:
            continue
        bounded = upright and low > -np.inf
        for turn in range(first_turn if bounded else 0, last_turn + 1 if bounded else 1):
            first, last = _beam_span(low, high, turn, frame, n) if bounded else (0, n)
            while first < last and ranges[j * n + first] <= near:
                first += 1
            while last > first and ranges[j * n + last - 1] <= near:
                last -= 1
            if first < last:
                if not tall and kind != SPHERE:
                    over = _height_over(z, beams, first, last - 1, frame[ANGLE_STEP], near, farthest, half[2])
                    if over == OUTSIDE:
                        continue
                run = slice(j * n + first, j * n + last)
                _cast_run(row, tall or over == INSIDE, ranges[run], hits[run] if hits.size > 0 else hits, scratch,
                          beams[0, first:last], beams[1, first:last], x, y, z, half, kind, frame[RANGE_MIN])


@kernel
def _tests_hidden(found: int, beams: Floats, rows: Floats, frame: Floats) -> bool:
    """Return whether to test first if shapes are hidden: there are many, and the azimuths are within [-pi, pi]."""
    most = frame[ANGLE_MIN] + frame[ANGLE_STEP] * (beams.shape[1] - 1)
    if found <= MANY or not (frame[ANGLE_STEP] > 1e-12 and frame[ANGLE_MIN] >= -math.pi and most <= math.pi):
        return False
    for j in range(rows.shape[0]):
        if not rows[j, 0] > 1e-6:
            return False
    return True


@kernel
def _hidden(ranges: Floats, rows: Floats, frame: Floats, sensor: Sequence[float], centre: Vector, radius: float,
            shape: Floats, n: int, beams_per_angle: float) -> bool:
    """Return whether every beam that could hit a box, sphere or cylinder has a nearer hit."""
    if shape[KIND] != SPHERE:       # in the plane, a tall upright shape is much smaller than its bounding sphere
        upright = sensor[2] * shape[2] + sensor[5] * shape[5] + sensor[8] * shape[8]
        wide = shape[HALF] if shape[KIND] == CYLINDER else math.sqrt(shape[HALF] ** 2 + shape[HALF + 1] ** 2)
        radius = min(radius, wide + shape[HALF + 2] * math.sqrt(max(1.0 - upright * upright, 0.0)) + 1e-7)
    px = sensor[0] * centre[0] + sensor[3] * centre[1] + sensor[6] * centre[2]
    py = sensor[1] * centre[0] + sensor[4] * centre[1] + sensor[7] * centre[2]
    flat = px * px + py * py
    left = flat - radius * radius
    if not left > 1e-6:
        return False
    half, middle = atan(radius / math.sqrt(left)) + AZIMUTH_MARGIN, azimuth(py, px)
    if not (middle - half > -math.pi and middle + half < math.pi):
        return False
    begin = int(math.ceil(max((middle - half - frame[ANGLE_MIN]) * beams_per_angle - 1e-6, 0.0)))
    end = int(math.floor(min((middle + half - frame[ANGLE_MIN]) * beams_per_angle + 1e-6, n - 1.0))) + 1
    near = (math.sqrt(flat) - radius) * (1.0 - 1e-9)
    for j in range(rows.shape[0]):
        for i in range(j * n + begin, j * n + end):
            if ranges[i] > near:
                return False
    return True


@kernel
def cast_rays(ranges: Floats, hits: NDArray[np.int64], beams: Floats, rows: Floats, frame: Floats, spheres: Floats,
              shapes: Floats, order: NDArray[np.int32], near: NDArray[np.int32]) -> int:
    """Cast all beams; see the module for the layouts of the arrays.

    Parameters
    ----------
    ranges : (V * N,) float64
        Written: distance from the sensor's origin to the first hit [m], the longest range without a hit.
    hits : (V * N,) or (0,) int64
        Written, unless empty: row of the shape that is hit, -1 for none.
    beams, rows, frame, spheres, shapes : float64
        Read only.
    order : (2, C) int32
        Written: in the first row, the shapes within reach, meshes and heightmaps among them, from near to far.
    near : (n,) int32
        Ascending rows of the shapes to look at, see :mod:`m2wr_sim.sensors.listing_kernels`; empty: all.

    Returns
    -------
    int
        Number of shapes within reach.

    Notes
    -----
    A pose of the sensor or a shape that is not finite gives no hit.  Directions are (cos e cos a, cos e sin a, sin e)
    in the sensor's frame for azimuth a and elevation e.
    """
    ranges[:] = frame[RANGE_MAX]
    hits[:] = -1
    scratch = np.empty(beams.shape[1] if hits.size > 0 else 0)
    q = frame[ORIENTATION:]
    sensor = rotation(q[0], q[1], q[2], q[3])
    found = _near_to_far(order, near, frame, spheres, _ahead(beams, rows, frame, sensor))
    many, n, beams_per_angle = _tests_hidden(found, beams, rows, frame), beams.shape[1], 1.0 / frame[ANGLE_STEP]
    for k in range(found):
        row = order[0, k]
        if shapes[row, KIND] >= MESH:
            continue
        if frame[IGNORED] >= 0.0 and shapes[row, OWNER] == frame[IGNORED]:
            continue
        centre = (spheres[0, row] - frame[0], spheres[1, row] - frame[1], spheres[2, row] - frame[2])
        if many and shapes[row, KIND] != PLANE and _hidden(
                ranges, rows, frame, sensor, centre, spheres[3, row], shapes[row], n, beams_per_angle):
            continue
        if shapes[row, KIND] == PLANE:
            _cast_plane(row, ranges, hits, scratch, beams, rows, frame, sensor, centre, shapes)
        else:
            _cast_solid(row, ranges, hits, scratch, beams, rows, frame, sensor, centre, spheres[3, row], shapes)
    return found

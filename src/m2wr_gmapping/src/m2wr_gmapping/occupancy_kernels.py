"""Tracing beams into counts of hits and visits, and reading counts out as an occupancy grid."""
import math

from numba import njit

FREE, OCCUPIED, UNKNOWN = 0, 100, -1


@njit(cache=True, nogil=True, error_model='numpy')
def _trace(x0, y0, x1, y1, sign, visits):
    """Add ``sign`` to the visits of all cells on the line from (x0, y0) to (x1, y1) but the last one.

    An integer line drawn from the end with the smaller x, or the smaller y if it is steep.
    """
    dx, dy = abs(x1 - x0), abs(y1 - y0)
    steep = dy > dx
    if steep:
        a0, b0, a1, b1, da, db = y0, x0, y1, x1, dy, dx
    else:
        a0, b0, a1, b1, da, db = x0, y0, x1, y1, dx, dy
    last_a = a1
    if a0 > a1:
        a0, b0, a1, b1 = a1, b1, a0, b0
    rise = 1 if b1 > b0 else -1
    d, b = 2 * db - da, b0
    for a in range(a0, a1 + 1):
        if a != last_a:
            if steep:
                x, y = b, a
            else:
                x, y = a, b
            if x >= 0 and y >= 0 and x < visits.shape[1] and y < visits.shape[0]:
                visits[y, x] += sign
        if d > 0:
            b += rise
            d += 2 * (db - da)
        else:
            d += 2 * db


@njit(cache=True, nogil=True, error_model='numpy')
def add_scan(pose, rays, ray_hits, origin, per_metre, sign, hits, visits, dirty):
    """Add (``sign`` 1) or take out (-1) a scan.

    Parameters
    ----------
    pose : (3,) float64
        Of the laser, in ``map``.
    rays : (2, S) float32
        Ends of the beams [m, laser frame].
    ray_hits : (S,) bool
        Which of them mark their end.
    origin : (2,) float64
        Centre of cell (0, 0) in ``map``.
    hits, visits : (H, W) int32
        Changed in place; cells outside are left out.
    dirty : (4,) int64
        First and last column and row that have changed; widened in place.
    """
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x0 = int(math.floor((pose[0] - origin[0]) * per_metre + 0.5))
    y0 = int(math.floor((pose[1] - origin[1]) * per_metre + 0.5))
    for k in range(rays.shape[1]):
        wx = pose[0] + c * rays[0, k] - s * rays[1, k]
        wy = pose[1] + s * rays[0, k] + c * rays[1, k]
        x1 = int(math.floor((wx - origin[0]) * per_metre + 0.5))
        y1 = int(math.floor((wy - origin[1]) * per_metre + 0.5))
        _trace(x0, y0, x1, y1, sign, visits)
        if ray_hits[k] and x1 >= 0 and y1 >= 0 and x1 < visits.shape[1] and y1 < visits.shape[0]:
            visits[y1, x1] += sign
            hits[y1, x1] += sign
        dirty[0], dirty[1] = min(dirty[0], x0, x1), max(dirty[1], x0, x1)
        dirty[2], dirty[3] = min(dirty[2], y0, y1), max(dirty[3], y0, y1)


@njit(cache=True, nogil=True, error_model='numpy')
def read_out(hits, visits, threshold, first_x, last_x, first_y, last_y, grid):
    """Write the cells of a rectangle (both ends included) of ``grid`` (H, W) int8 from the counts."""
    for y in range(max(0, first_y), min(grid.shape[0] - 1, last_y) + 1):
        for x in range(max(0, first_x), min(grid.shape[1] - 1, last_x) + 1):
            if visits[y, x] <= 0:
                grid[y, x] = UNKNOWN
            elif hits[y, x] > threshold * visits[y, x]:
                grid[y, x] = OCCUPIED
            else:
                grid[y, x] = FREE

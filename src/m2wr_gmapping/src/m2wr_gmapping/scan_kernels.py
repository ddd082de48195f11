"""Surface normals of a scan's end points, from the end points themselves."""
import math

from numba import njit

STRAIGHT, CROOKED = 0.15, 0.4       # spread across the line by that along it: of a wall with noise, and of a corner


@njit(cache=True, nogil=True, error_model='numpy')
def surface_normals(points, reach, side, out):
    """Fit a line through each end point and its neighbours along the scan.

    Parameters
    ----------
    points : (2, B) float64
        End points in the order of their beams [m], laser frame.
    reach : float
        Neighbours farther than this from the point, or beyond the first that is, do not belong to its surface [m].
    side : int
        Most neighbours taken on either side.
    out : (3, B) float64
        Written: unit normal x, y and straightness in [0, 1]; 0 where fewer than three points lie together, with the
        direction to the laser as normal.
    """
    count = points.shape[1]
    reach2 = reach * reach
    for b in range(count):
        x, y = points[0, b], points[1, b]
        n, sx, sy, sxx, sxy, syy = 1, 0.0, 0.0, 0.0, 0.0, 0.0
        for direction in (-1, 1):
            for k in range(1, side + 1):
                other = b + direction * k
                if other < 0 or other >= count:
                    break
                dx, dy = points[0, other] - x, points[1, other] - y
                if not dx * dx + dy * dy <= reach2:
                    break
                n += 1
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
        if n < 3:
            continue
        cxx, cxy, cyy = sxx - sx * sx / n, sxy - sx * sy / n, syy - sy * sy / n
        half, product = 0.5 * (cxx - cyy), 0.5 * (cxx + cyy)
        root = math.sqrt(half * half + cxy * cxy)
        large, small = product + root, max(product - root, 0.0)
        if not large > 0.0:
            continue
        # axis of the larger spread is at angle atan2(2 cxy, cxx - cyy) / 2; the normal is across it
        angle = 0.5 * math.atan2(cxy, half)
        out[0, b], out[1, b] = -math.sin(angle), math.cos(angle)
        out[2, b] = min(1.0, max(0.0, (CROOKED - math.sqrt(small / large)) / (CROOKED - STRAIGHT)))


@njit(cache=True, nogil=True, error_model='numpy')
def apart(points, gap, keep):
    """Mark in ``keep`` (B,) the end points (2, B) that lie at least ``gap`` [m] from the one marked before."""
    last = -1
    for b in range(points.shape[1]):
        keep[b] = True
        if last >= 0:
            dx, dy = points[0, b] - points[0, last], points[1, b] - points[1, last]
            keep[b] = dx * dx + dy * dy >= gap * gap
        if keep[b]:
            last = b

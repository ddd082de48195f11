# SPDX-License-Identifier: BSD-3-Clause
"""``<polyline>`` of SDF: extrudes outlines in the plane to a body of triangles."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Iterator, List, Sequence, Tuple

import numpy as np

from m2wr_sim.model.mesh.files import has_area

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Point = Tuple[float, float]
    Corner = Tuple[float, float, float]
    Triangle = Tuple[Corner, Corner, Corner]


def extrude(outlines: Sequence[Any], height: float) -> Tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Extrude outlines to a closed body.

    Parameters
    ----------
    outlines : list of (n, 2) array_like
        Corners of closed polygons [m], n at least 3, in either direction.  Points inside an odd number of polygons are
        solid, so an outline inside another one is a hole.
    height : float
        Of the body, from z = 0 upwards [m].

    Returns
    -------
    vertices : (k, 3) float64
    triangles : (m, 3) int32
        Counter-clockwise seen from outside; none if the outlines enclose no area.

    Notes
    -----
    The plane is divided into bands at the y of each corner; inside a band the edges, sorted by x, bound trapezoids.
    For outlines that cross themselves or one another elsewhere than in a corner, the result is approximate.
    """
    starts = np.concatenate([np.asarray(outline, dtype=float) for outline in outlines])
    ends = np.concatenate([np.roll(np.asarray(outline, dtype=float), -1, axis=0) for outline in outlines])
    levels = np.unique(starts[:, 1])
    corners: List[Triangle] = []
    walls: List[Tuple[Triangle, Triangle]] = []
    area = 0.0
    for low, high in zip(levels[:-1], levels[1:]):
        spans = (np.minimum(starts[:, 1], ends[:, 1]) <= low) & (np.maximum(starts[:, 1], ends[:, 1]) >= high)
        one, two = starts[spans], ends[spans]
        slope = (two[:, 0] - one[:, 0]) / (two[:, 1] - one[:, 1])
        at_low, at_high = one[:, 0] + slope * (low - one[:, 1]), one[:, 0] + slope * (high - one[:, 1])
        order = np.argsort(at_low + at_high, kind="stable")
        for left, right in zip(order[0::2], order[1::2]):
            a, b = (at_low[left], low), (at_low[right], low)
            c, d = (at_high[right], high), (at_high[left], high)
            area += 0.5 * (high - low) * (b[0] - a[0] + c[0] - d[0])
            corners.extend(_cap(a, b, c, d, height))
            walls.extend((_wall(b, c, height), _wall(d, a, height)))    # the solid is to the left of a b c d
    if not area > 1e-12 * float(np.ptp(starts, axis=0).max()) ** 2:
        return np.zeros((0, 3)), np.zeros((0, 3), np.int32)
    for one, two in _level_edges(starts, ends):
        walls.append(_wall(one, two, height) if _solid_above(one, two, starts, ends) else _wall(two, one, height))
    corners.extend(triangle for wall in walls for triangle in wall)
    triangles = np.array(corners, dtype=float).reshape(-1, 3, 3)
    points = triangles[has_area(triangles)].reshape(-1, 3)
    return points, np.arange(len(points), dtype=np.int32).reshape(-1, 3)


def _cap(a: Point, b: Point, c: Point, d: Point, height: float) -> Iterator[Triangle]:
    """Return the bottom and top triangles of a trapezoid a b c d, counter-clockwise seen from above."""
    for one, two, three in ((a, b, c), (a, c, d)):
        yield (one + (0.0,), three + (0.0,), two + (0.0,))
        yield (one + (height,), two + (height,), three + (height,))


def _wall(one: Point, two: Point, height: float) -> Tuple[Triangle, Triangle]:
    """Return the two triangles of a wall; the solid is to the left of the direction from ``one`` to ``two``."""
    ax, ay, bx, by = float(one[0]), float(one[1]), float(two[0]), float(two[1])
    return (((ax, ay, 0.0), (bx, by, 0.0), (bx, by, height)), ((ax, ay, 0.0), (bx, by, height), (ax, ay, height)))


def _level_edges(starts: NDArray[np.float64], ends: NDArray[np.float64]) -> Iterator[Tuple[Any, Any]]:
    """Yield the edges along x, from left to right."""
    for one, two in zip(starts, ends):
        if one[1] == two[1] and one[0] != two[0]:
            yield (one, two) if one[0] < two[0] else (two, one)


def _solid_above(one: Point, two: Point, starts: NDArray[np.float64], ends: NDArray[np.float64]) -> bool:
    """Return whether the solid is above the middle of a level edge: an odd number of edges is above it."""
    x, y = 0.5 * (one[0] + two[0]), one[1]
    crosses = (np.minimum(starts[:, 0], ends[:, 0]) <= x) & (np.maximum(starts[:, 0], ends[:, 0]) > x)
    first, last = starts[crosses], ends[crosses]
    heights = first[:, 1] + (x - first[:, 0]) * (last[:, 1] - first[:, 1]) / (last[:, 0] - first[:, 0])
    return int(np.sum(heights > y)) % 2 == 1

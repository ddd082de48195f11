# SPDX-License-Identifier: BSD-3-Clause
"""Check of a pose by occlusion: rays of a scan must not end behind surfaces that other scans have seen."""
from __future__ import annotations

from typing import TYPE_CHECKING, Iterable, Tuple

import numpy as np

from m2wr_gmapping.se2 import between

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_gmapping.frontend.scan import ScanReading

OCCLUSION_MARGIN = 0.4      # a ray conflicts with a surface if it ends this much behind it [m]
MOST_CONFLICT = 0.15        # greatest share of end points in conflict at a right pose: people, glass, thin posts
FARTHEST_GAP = 2.5          # beams farther apart than this, in median gaps, have an unknown area between them


def conflict_share(pairs: Iterable[Tuple[FloatArray, ScanReading, FloatArray, ScanReading]]) -> float:
    """Return the share of end points that conflict with rays of the other scan of a pair, among those in view.

    Both scans of a pair are tested against each other. Areas that one of them has not seen do not count.

    Parameters
    ----------
    pairs : iterable of (pose, reading, pose, reading)
        Poses (3,) of the lasers in one frame [m, m, rad], and their scans.

    Returns
    -------
    float
        0 if nothing is in view.
    """
    through = total = 0
    for here, reading, there, other in pairs:
        for eye, seen, rays, points in ((here, there, reading.rays, other.points),
                                        (there, here, other.rays, reading.points)):
            a, b = _through(rays, between(eye, seen), points)
            through, total = through + a, total + b
    return through / max(1, total)


def _through(rays: FloatArray, seen: FloatArray, points: FloatArray) -> Tuple[int, int]:
    """Count the points (2, B) of a scan at pose ``seen`` that the rays (2, S) pass through, and the points in view."""
    if rays.shape[1] < 2:
        return 0, 0
    angle, reach = np.arctan2(rays[1], rays[0]), np.hypot(rays[0], rays[1])
    order = np.argsort(angle, kind="stable")
    angle, reach = angle[order], reach[order]
    c, s = np.cos(seen[2]), np.sin(seen[2])
    x, y = seen[0] + c * points[0] - s * points[1], seen[1] + s * points[0] + c * points[1]
    at, far = np.arctan2(y, x), np.hypot(x, y)
    after = np.searchsorted(angle, at)
    inside = (after > 0) & (after < len(angle))
    at, far, after = at[inside], far[inside], after[inside]
    gap = angle[after] - angle[after - 1]
    least = np.minimum(reach[after], reach[after - 1])
    beside = gap < FARTHEST_GAP * np.median(np.diff(angle))
    through, in_view = far + OCCLUSION_MARGIN < least, far < least + OCCLUSION_MARGIN
    return int((beside & through).sum()), int((beside & in_view).sum())

# SPDX-License-Identifier: BSD-3-Clause
"""Check of a pose by occlusion: rays of a scan must not end behind surfaces that other scans have seen."""
from __future__ import annotations

from typing import TYPE_CHECKING, Iterable, Sequence, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.occlusion_kernels import passed_through
from m2wr_gmapping.se2 import between

if TYPE_CHECKING:
    from m2wr_gmapping.array_types import FloatArray
    from m2wr_gmapping.frontend.scan import ScanReading

MOST_CONFLICT = tuning.OCCLUSION.most_conflict


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
            a, b = passed_through(rays, tuple(between(eye, seen)), points, tuning.OCCLUSION.margin,
                                  tuning.OCCLUSION.gap)
            through, total = through + a, total + b
    return through / max(1, total)


def conflict_with_nearest(pose: FloatArray, reading: ScanReading, path: FloatArray, readings: Sequence[ScanReading],
                          count: int) -> float:
    """Return ``conflict_share`` of a scan at ``pose`` with the scans of the nearest nodes of a path.

    Parameters
    ----------
    pose : (3,) float64
        Assumed pose of the scan [m, m, rad].
    reading : ScanReading
    path : (K, 3) float64
        Poses of other scans, in the same frame.
    readings : sequence of ScanReading
        The other scans; only the first K are used.
    count : int
        Number of nodes.
    """
    distance = np.hypot(path[:, 0] - pose[0], path[:, 1] - pose[1])
    near = np.argsort(distance, kind="stable")[:count]
    return conflict_share((pose, reading, path[node], readings[node]) for node in near)

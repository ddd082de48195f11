# SPDX-License-Identifier: BSD-3-Clause
"""Check of a pose by occlusion: rays of a scan must not end behind surfaces that other scans have seen."""
from __future__ import annotations

from typing import TYPE_CHECKING, Iterable, NamedTuple, Sequence, Tuple

import numpy as np

from m2wr_gmapping import tuning
from m2wr_gmapping.frontend.occlusion_kernels import passed_through
from m2wr_maps.se2 import between

if TYPE_CHECKING:
    from m2wr_gmapping.frontend.scan import ScanReading
    from m2wr_node.array_types import FloatArray

MOST_CONFLICT = tuning.OCCLUSION.most_conflict


class Conflict(NamedTuple):
    """End points that conflict with rays of the other scan of a pair.

    Attributes
    ----------
    gone, old : int
        Old end points that rays of the new scan pass through, and all in its view.
    appeared, new : int
        End points of the new scan that rays of old ones pass through, and all in their view.
    """

    gone: int = 0
    old: int = 0
    appeared: int = 0
    new: int = 0

    @property
    def in_view(self) -> int:
        """All end points in view."""
        return self.old + self.new

    @property
    def share(self) -> float:
        """Share of all end points in view; 0 if nothing is."""
        return (self.gone + self.appeared) / max(1, self.in_view)

    @property
    def mutual(self) -> float:
        """The lesser of the two shares. A person who comes, or leaves, causes one of them; a wrong pose causes both."""
        return min(self.gone / max(1, self.old), self.appeared / max(1, self.new))


NO_CONFLICT = Conflict()


def conflict_of(pairs: Iterable[Tuple[FloatArray, ScanReading, FloatArray, ScanReading]]) -> Conflict:
    """Return the end points that conflict with rays of the other scan of a pair.

    Both scans of a pair are tested against each other. Areas that one of them has not seen do not count.

    Parameters
    ----------
    pairs : iterable of (pose, reading, pose, reading)
        Poses (3,) of the lasers in one frame [m, m, rad], and their scans: the new one, then the old one.
    """
    counts = np.zeros((2, 2), np.int64)
    for here, reading, there, other in pairs:
        for row, (eye, seen, rays, points) in enumerate(((here, there, reading.rays, other.points),
                                                         (there, here, other.rays, reading.points))):
            counts[row] += passed_through(rays, between(eye, seen), points, tuning.OCCLUSION.margin,
                                          tuning.OCCLUSION.gap)
    return Conflict(*counts.ravel().tolist())


def conflict_with_nearest(pose: FloatArray, reading: ScanReading, path: FloatArray, readings: Sequence[ScanReading],
                          count: int) -> Conflict:
    """Return ``conflict_of`` a scan at ``pose`` with the scans of the nearest nodes of a path.

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
    return conflict_of((pose, reading, path[node], readings[node]) for node in near)

# SPDX-License-Identifier: BSD-3-Clause
"""The shortest open tour over places."""
from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from m2wr_node.kernel import kernel

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, IndexArray

_NO_WAY = 1e9       # m: between two places that are not connected


@kernel
def shortest_tour(first: FloatArray, between: FloatArray) -> IndexArray:
    """Return the order of places with the least length of an open tour, by dynamic programming (Held, Karp 1962).

    Parameters
    ----------
    first : (N,) float64
        From the start to each place [m]; N is at most 20.
    between : (N, N) float64
        Between places [m]; inf: no way.

    Returns
    -------
    (N,) int64
    """
    count = len(first)
    length = np.full((1 << count, count), np.inf)
    before = np.full((1 << count, count), -1, np.int64)
    for place in range(count):
        length[1 << place, place] = first[place]
    for visited in range(1, 1 << count):
        for last in range(count):
            here = length[visited, last]
            if not here < np.inf:
                continue
            for following in range(count):
                if visited >> following & 1:
                    continue
                there, total = visited | 1 << following, here + min(between[last, following], _NO_WAY)
                if total < length[there, following]:
                    length[there, following], before[there, following] = total, last
    order = np.empty(count, np.int64)
    visited, place = (1 << count) - 1, int(np.argmin(length[-1]))
    for position in range(count - 1, -1, -1):
        order[position] = place
        visited, place = visited & ~(1 << place), int(before[visited, place])
    return order

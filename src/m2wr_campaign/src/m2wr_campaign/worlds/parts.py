# SPDX-License-Identifier: BSD-3-Clause
"""What generators of worlds share."""
from __future__ import annotations

from typing import Optional, Sequence, Tuple

import numpy as np

from m2wr_view.outlines import Outline, point_distances

Disc = Tuple[float, float, float]       # centre x, y, radius [m]
_TRIES = 100


def free_point(area: Tuple[float, float, float, float], obstacles: Sequence[Outline], clearance: float,
               random: np.random.Generator) -> Optional[Tuple[float, float]]:
    """Return a point [m] with a clearance, or None if none of 100 drawn points has it.

    Parameters
    ----------
    area : (4,) float
        Least x and y, length, width [m].
    obstacles : sequence of Outline
    clearance : float
        [m]
    random : numpy.random.Generator
    """
    points = np.round(np.array(area[:2]) + random.random((_TRIES, 2)) * np.array(area[2:]), 3)
    nearest = np.min([point_distances(points, outline) for outline in obstacles] + [np.full(_TRIES, np.inf)], axis=0)
    found = points[nearest > clearance]
    return (float(found[0][0]), float(found[0][1])) if len(found) else None

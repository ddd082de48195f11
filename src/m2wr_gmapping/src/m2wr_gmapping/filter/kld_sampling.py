# SPDX-License-Identifier: BSD-3-Clause
"""How many particles it takes: few where they agree, many where they spread."""
import math

import numpy as np

from m2wr_gmapping.se2 import wrap

BIN = np.array([0.1, 0.1, 0.05])    # poses within such a box are as good as one [m, m, rad]
ERROR = 0.15                # Kullback-Leibler distance that the boxes' shares may have from the true ones
QUANTILE = 2.326            # of the normal distribution: in 99 of 100 cases
CHANGED = 0.2               # share by which another number must differ to be worth a resampling


def needed(poses, best):
    """Return the number of particles by KLD-sampling.

    Parameters
    ----------
    poses : (N, 3) float64
    best : int
        The particle at the middle of its box.

    Notes
    -----
    D. Fox, Adapting the sample size in particle filters through KLD-sampling, IJRR 22(12), 2003.
    """
    away = poses - poses[best]
    away[:, 2] = wrap(away[:, 2])
    free = len(np.unique(np.rint(away / BIN).astype(np.int64), axis=0)) - 1
    if not free:
        return 1
    part = 2.0 / (9.0 * free)
    return math.ceil(free / (2.0 * ERROR) * (1.0 - part + math.sqrt(part) * QUANTILE)**3)


def next_count(poses, best, least, most):
    """Return how many particles the next scans take, ``least`` to ``most``; as many as now if that is about it."""
    count = len(poses)
    wanted = min(max(needed(poses, best), least), most)
    return wanted if abs(wanted - count) > CHANGED * count or not least <= count <= most else count

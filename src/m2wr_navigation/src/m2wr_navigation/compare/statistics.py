# SPDX-License-Identifier: BSD-3-Clause
"""Intervals of what was measured in several worlds."""
from __future__ import annotations

import math
from typing import Sequence, Tuple

import numpy as np

QUANTILE = 1.959964         # of the normal distribution, for 95 %
DRAWS = 2000                # of a bootstrap


def wilson(successes: int, total: int) -> Tuple[float, float]:
    """Return the 95 % interval of a probability (Wilson 1927).

    Parameters
    ----------
    successes : int
    total : int
        0: nothing is known, (0, 1).
    """
    if total == 0:
        return 0.0, 1.0
    share, square = successes / total, QUANTILE * QUANTILE
    middle = (share + square / (2.0 * total)) / (1.0 + square / total)
    half = QUANTILE * math.sqrt(share * (1.0 - share) / total + square / (4.0 * total * total)) / (1.0 + square / total)
    return max(middle - half, 0.0), min(middle + half, 1.0)


def bootstrap(values: Sequence[float], seed: int = 0) -> Tuple[float, float, float]:
    """Return the mean and its 95 % interval by the percentiles of a bootstrap (Efron 1979); NaN without values.

    Parameters
    ----------
    values : sequence of float
    seed : int, optional
    """
    if not len(values):
        return math.nan, math.nan, math.nan
    given = np.asarray(values, float)
    drawn = np.random.default_rng(seed).integers(0, len(given), (DRAWS, len(given)))
    low, high = np.percentile(given[drawn].mean(axis=1), (2.5, 97.5))
    return float(given.mean()), float(low), float(high)

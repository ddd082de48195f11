# SPDX-License-Identifier: BSD-3-Clause
"""How the time of an exploration falls with the number of robots: means over buildings, with intervals."""
from __future__ import annotations

import math
from typing import Any, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_navigation.compare.statistics import bootstrap

Interval = Tuple[float, float, float]


def times(rows: Sequence[Mapping[str, Any]], robots: int) -> Dict[int, float]:
    """Return the time until enough was seen, by place; only of places where all numbers of robots saw enough [s].

    Otherwise a large team that fails in the large buildings would seem to be faster.

    Parameters
    ----------
    rows : sequence of mapping
        Of :func:`m2wr_exploration.study.team_command.perform`.
    robots : int
    """
    missed = {row["place"] for row in rows if not math.isfinite(row["enough"])}
    return {row["place"]: row["enough"] for row in rows if row["robots"] == robots and row["place"] not in missed}


def mean_time(rows: Sequence[Mapping[str, Any]], robots: int) -> Interval:
    """Return the mean time over places and its 95 % interval [s]; NaN without places.

    Parameters
    ----------
    rows : sequence of mapping
    robots : int
    """
    return bootstrap(list(times(rows, robots).values()))


def against(rows: Sequence[Mapping[str, Any]], robots: int, fewest: int) -> Interval:
    """Return the time of a team over that of the smallest team in the same place, and its 95 % interval.

    The geometric mean: half the time and twice the time average to 1.

    Parameters
    ----------
    rows : sequence of mapping
    robots, fewest : int
        Numbers of robots.
    """
    own, base = times(rows, robots), times(rows, fewest)
    logs: List[float] = [math.log(own[place] / base[place]) for place in own if place in base]
    mean, low, high = np.exp(bootstrap(logs))
    return float(mean), float(low), float(high)

# SPDX-License-Identifier: BSD-3-Clause
"""The score of the BARN challenge, and tables of it."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Dict, List, Mapping, Sequence

import numpy as np

from m2wr_navigation.compare.statistics import bootstrap, wilson

if TYPE_CHECKING:
    from typing import Tuple

    Record = Dict[str, Any]

LEAST, MOST = 4.0, 8.0      # times the optimal time, of the challenge in 2022; later 2 and 8
LATER_LEAST = 2.0
CLIPS = LEAST, MOST
COLLISION = "collision"
#: Published figures: success, time of the successes [s], score.
PUBLISHED = {"TrajectoryPlanner of the challenge": (0.850, 34.1, 0.158), "DRL-VO (2022)": (0.936, 15.0, 0.234),
             "LiCS-KI (2024)": (0.980, 7.7, 0.245)}


def score(success: bool, time: float, optimal: float, limits: Tuple[float, float] = CLIPS) -> float:
    """Return the score of a run: 0, or the optimal time over the time, clipped to multiples of the optimal time.

    Parameters
    ----------
    success : bool
    time, optimal : float
        [s]
    limits : (float, float), optional
        Multiples of the optimal time.
    """
    return optimal / min(max(time, limits[0] * optimal), limits[1] * optimal) if success else 0.0


def _mean_of_worlds(records: Sequence[Record], values: Sequence[float]) -> List[float]:
    """Return the mean of each world."""
    worlds: Dict[str, List[float]] = {}
    for record, value in zip(records, values):
        worlds.setdefault(record["scene"], []).append(value)
    return [float(np.mean(each)) for each in worlds.values()]


def summary(name: str, records: Sequence[Record], optimal: Mapping[str, float]) -> Record:
    """Return the figures of a method: means of the worlds' means, as in the challenge.

    Parameters
    ----------
    name : str
    records : sequence of dict
        Of :func:`m2wr_navigation.barn.runs.run`, of all methods.
    optimal : mapping of str to float
        Optimal time of each world [s].
    """
    mine = [record for record in records if record["name"] == name]
    good = [record for record in mine if record["success"]]
    found: Record = {"name": name, "runs": len(mine), "worlds": len({record["scene"] for record in mine}),
                     "successes": len(good), "success_interval": list(wilson(len(good), len(mine))),
                     "success": float(np.mean(_mean_of_worlds(mine, [record["success"] for record in mine]))),
                     "cpu_ms": float(np.mean([record["cpu_ms"] for record in mine]))}
    for outcome in (COLLISION, "time out", "stuck"):
        found[outcome.replace(" ", "_")] = sum(record["outcome"] == outcome for record in mine)
    times = _mean_of_worlds(good, [record["time"] for record in good])
    found["time"] = [value if math.isfinite(value) else None for value in bootstrap(times)]
    for key, limits in (("score", CLIPS), ("later_score", (LATER_LEAST, MOST))):
        values = [score(record["success"], record["time"], optimal[record["scene"]], limits) for record in mine]
        found[key] = list(bootstrap(_mean_of_worlds(mine, values)))
    return found


def ranked(records: Sequence[Record], optimal: Mapping[str, float]) -> List[Record]:
    """Return the summaries of all methods, the best score first.

    Parameters
    ----------
    records : sequence of dict
    optimal : mapping of str to float
        [s]
    """
    names = sorted({record["name"] for record in records})
    return sorted((summary(name, records, optimal) for name in names), key=lambda row: -float(row["score"][0]))

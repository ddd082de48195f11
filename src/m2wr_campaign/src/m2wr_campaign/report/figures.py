# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a study: each method with intervals, two methods in the same runs, success against difficulty."""
from __future__ import annotations

import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Callable, Dict, List, Mapping, Sequence, Tuple

import numpy as np

from m2wr_campaign.store.table_export import parameters_of
from m2wr_navigation.compare.statistics import bootstrap, wilson

Row = Dict[str, Any]
Interval = Tuple[float, float, float]       # mean, low and high end; NaN: no values

#: Measures of a run with the digits after the point that are shown.
MEASURES = {"ratio": 3, "time": 1, "clearance": 2, "turning": 1, "cpu_ms": 2}
DIFFICULTIES = {"optimum": "length of the shortest path [m]", "openness": "mean distance from obstacles [m]",
                "tortuosity": "shortest path over straight line"}
MOST_BINS = 4


def variants(runs: Sequence[Row]) -> Dict[str, List[Row]]:
    """Return the runs of each method, by its name, parameters, and robot, noise and fault if there are several.

    Parameters
    ----------
    runs : sequence of dict
    """
    robots, noises, faults = ({run[name] for run in runs} for name in ("robot", "noise", "fault"))
    found: Dict[str, List[Row]] = {}
    for run in runs:
        label = parameters_of(run)
        if len(robots) > 1:
            label += ", " + run["robot"]
        if len(noises) > 1:
            label += ", noise as described" if run["noise"] is None else ", noise {:g} m".format(run["noise"])
        if len(faults) > 1:
            label += ", " + (run["fault"] or "no fault")
        found.setdefault(label, []).append(run)
    return found


def by_worlds(pairs: Sequence[Tuple[str, float]], seed: int = 0) -> Interval:
    """Return a mean over worlds with its interval by a bootstrap of worlds; of one world, of its values.

    Runs in one world resemble one another. So a world counts once, with the mean of its runs.

    Parameters
    ----------
    pairs : sequence of (str, float)
        World and value.
    seed : int, optional
        Of the bootstrap.
    """
    worlds: Dict[str, List[float]] = {}
    for world, value in pairs:
        worlds.setdefault(world, []).append(value)
    if len(worlds) == 1:
        return bootstrap([value for _, value in pairs], seed)
    return bootstrap([math.fsum(values) / len(values) for values in worlds.values()], seed)


@dataclass(frozen=True)
class MethodFigures:
    """Figures of one method.

    Attributes
    ----------
    label : str
    runs, successes : int
    share : (3,) float
        Of successes, with Wilson's interval.
    means : dict of str to (3,) float
        Of MEASURES, over worlds: of the successes, and CPU time of all runs.
    outcomes : dict of str to int
        Number of runs without success by what happened.
    """

    label: str
    runs: int
    successes: int
    share: Interval
    means: Dict[str, Interval]
    outcomes: Dict[str, int]


def failure_of(run: Row) -> str:
    """Return in a word what happened in a run without success."""
    return "contact" if run["outcome"] == "reached" else str(run["outcome"])


def figures_of(label: str, runs: Sequence[Row]) -> MethodFigures:
    """Return the figures of one method.

    Parameters
    ----------
    label : str
    runs : sequence of dict
    """
    good = [run for run in runs if run["success"]]
    means = {name: by_worlds([(run["world"], run[name]) for run in (runs if name == "cpu_ms" else good)
                              if run[name] is not None]) for name in MEASURES}
    share = len(good) / len(runs) if runs else math.nan
    return MethodFigures(label, len(runs), len(good), (share, *wilson(len(good), len(runs))), means,
                         dict(Counter(failure_of(run) for run in runs if not run["success"]).most_common()))


def ranked(groups: Mapping[str, Sequence[Row]]) -> List[MethodFigures]:
    """Return the figures of all methods: most successes first, then the shortest paths.

    Parameters
    ----------
    groups : mapping of str to sequence of dict
        As :func:`variants` makes them.
    """
    def rank(one: MethodFigures) -> Tuple[float, float, str]:
        ratio = one.means["ratio"][0]
        return -one.share[0], ratio if math.isfinite(ratio) else math.inf, one.label
    return sorted((figures_of(label, runs) for label, runs in groups.items()), key=rank)


@dataclass(frozen=True)
class Paired:
    """Two methods in the same worlds with the same seeds.

    Attributes
    ----------
    pairs : int
    only_first, only_second : int
        Pairs in which one of both had success.
    gain : (3,) float
        Share of successes of the first less that of the second.
    ratio, time : (3,) float
        Length over the optimum, and time [s], of the first less those of the second where both had success.
    """

    pairs: int
    only_first: int
    only_second: int
    gain: Interval
    ratio: Interval
    time: Interval


def _pairs(first: Sequence[Row], second: Sequence[Row]) -> List[Tuple[Row, Row]]:
    others = {(run["world"], run["repeat"]): run for run in second}
    return [(run, others[run["world"], run["repeat"]]) for run in first if (run["world"], run["repeat"]) in others]


def gain_of(first: Sequence[Row], second: Sequence[Row]) -> Interval:
    """Return the share of successes of a method less that of another in the same worlds with the same seeds.

    Parameters
    ----------
    first, second : sequence of dict
        Runs of both.
    """
    return by_worlds([(one["world"], float(one["success"] - two["success"])) for one, two in _pairs(first, second)])


def compared(first: Sequence[Row], second: Sequence[Row]) -> Paired:
    """Return what differs between two methods in the same worlds with the same seeds.

    Parameters
    ----------
    first, second : sequence of dict
        Runs of both.
    """
    pairs = _pairs(first, second)
    both = [(one, two) for one, two in pairs if one["success"] and two["success"]]

    def difference(name: str) -> Interval:
        return by_worlds([(one["world"], one[name] - two[name]) for one, two in both])
    return Paired(len(pairs), sum(one["success"] > two["success"] for one, two in pairs),
                  sum(one["success"] < two["success"] for one, two in pairs), gain_of(first, second),
                  difference("ratio"), difference("time"))


def difficulties(runs: Sequence[Row], name: str) -> Dict[Tuple[str, str], float]:
    """Return a measure of difficulty of each world with each robot, from the runs that have it.

    Parameters
    ----------
    runs : sequence of dict
    name : str
        Of DIFFICULTIES.
    """
    return {(run["world"], run["robot"]): run[name] for run in runs if run[name] is not None}


def edges_of(values: Sequence[float]) -> List[float]:
    """Return the ends of bins that hold as many worlds each; empty if all worlds are alike.

    Parameters
    ----------
    values : sequence of float
        Of the worlds.
    """
    different = len(set(values))
    if different < 2:
        return []
    edges = np.quantile(np.array(values, float), np.linspace(0.0, 1.0, min(MOST_BINS, different) + 1))
    return [float(edge) for edge in np.unique(edges)]


def shares_by(runs: Sequence[Row], at: Callable[[Row], float], edges: Sequence[float]) -> List[
        Tuple[float, int, int]]:
    """Return for each bin the mean of a measure, successes and runs; bins without runs are left out.

    Parameters
    ----------
    runs : sequence of dict
        Of one method.
    at : callable
        Returns the measure of a run; NaN: it has none.
    edges : sequence of float
        Ends of the bins.
    """
    inner = list(edges[1:-1])
    bins: Dict[int, List[Tuple[float, int]]] = {}
    for run in runs:
        value = at(run)
        if math.isfinite(value):
            bins.setdefault(int(np.searchsorted(inner, value, side="right")), []).append((value, run["success"]))
    return [(math.fsum(value for value, _ in found) / len(found), sum(success for _, success in found), len(found))
            for _, found in sorted(bins.items())]


def best_median_worst(runs: Sequence[Row]) -> List[Tuple[str, Row]]:
    """Return the best, the median and the worst run: successes by length over the optimum, then the others.

    Parameters
    ----------
    runs : sequence of dict
        Of one method; not empty.
    """
    def rank(run: Row) -> Tuple[bool, bool, float, str]:
        return not run["success"], run["ratio"] is None, run["ratio"] or 0.0, run["key"]
    ordered = sorted(runs, key=rank)
    return [("best", ordered[0]), ("median", ordered[(len(ordered) - 1) // 2]), ("worst", ordered[-1])]

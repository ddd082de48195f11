# SPDX-License-Identifier: BSD-3-Clause
"""Table of the benchmark over logs with named difficulties: one row for each class, over all logs that have it."""
from __future__ import annotations

from collections import OrderedDict
from typing import TYPE_CHECKING, Any, Dict, Iterable, List, Optional, Tuple

import numpy as np

from m2wr_tools.slam_benchmark.benchmark_table import CLOSED, growth

if TYPE_CHECKING:
    Run = Dict[str, Any]

HEAD = ("set", "aspect", "class", "closed", "loop closures, median", "worst", "live, 10 s", "live, loop closures",
        "laser yaw, worst", "CPU s a log", "end : begin", "peak MiB")
FAIR = 0.1                  # greatest error of odometry that is called fair, relative to the length of the drive


def _values(runs: Iterable[Run], part: str, name: str) -> List[float]:
    return [run[part][name] for run in runs if run[part] and name in run[part]]


def _median(values: List[float], form: str) -> str:
    return form.format(float(np.median(values))) if values else ""


def _most(values: List[float], form: str) -> str:
    return form.format(max(values)) if values else ""


def _row(name: str, aspect: str, kind: str, runs: List[Run]) -> Tuple[str, ...]:
    errors = _values(runs, "score", "again_metres")
    statistics = [run["statistics"] for run in runs]
    return (name, aspect, kind, "{} of {}".format(sum(error <= CLOSED for error in errors), len(errors)),
            _median(errors, "{:.3f} m"), _most(errors, "{:.2f} m"),
            _median(_values(runs, "score", "live_metres"), "{:.3f} m"),
            _median(_values(runs, "score", "live_again_metres"), "{:.3f} m"),
            _most(_values(runs, "score", "laser_degrees"), "{:.2f}°"),
            "{:.1f}".format(float(np.mean([one["processScan"]["cpu"]["total_s"] for one in statistics]))),
            _most([value for value in map(growth, statistics) if value is not None], "{:.1f}"),
            "{:.0f}".format(max(one["peak_memory_mib"] for one in statistics)))


def _groups(runs: List[Run]) -> Dict[Tuple[str, str], List[Run]]:
    """Return the runs of each (aspect, class), sorted, after all runs and those with fair odometry."""
    fair = [run for run in runs if run["score"] and run["score"].get("odometry_drift", 1.0) < FAIR]
    found: Dict[Tuple[str, str], List[Run]] = OrderedDict({("all", ""): runs})
    if fair:
        found[("odometry", "less than {:.0%} off".format(FAIR))] = fair
    keys = {item for run in runs for item in run["difficulties"].items()}
    for key in sorted(keys):
        found[key] = [run for run in runs if run["difficulties"].get(key[0]) == key[1]]
    return found


def markdown(results: List[Run]) -> Optional[str]:
    """Return the table, for each set of parameters; None if no log names its difficulties."""
    results = [run for run in results if run.get("difficulties")]
    if not results:
        return None
    lines = ["| {} |".format(" | ".join(HEAD)), "|" + "---|" * len(HEAD)]
    for name, particles in sorted({(run["set"], run["particles"]) for run in results}):
        runs = [run for run in results if (run["set"], run["particles"]) == (name, particles)]
        title = "{}, {}".format(name, particles)
        lines += ["| {} |".format(" | ".join(_row(title, *key, found))) for key, found in _groups(runs).items()]
    return "\n".join(lines) + "\n"

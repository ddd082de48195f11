# SPDX-License-Identifier: BSD-3-Clause
"""Table of the benchmark, and its insertion into a document."""
from __future__ import annotations

import os
import tempfile
from collections import OrderedDict
from typing import Any, Callable, Dict, Iterable, List, Optional, Tuple

BEGIN, END = "<!-- benchmark: begin -->", "<!-- benchmark: end -->"
HEAD = ("log", "set", "particles", "processed", "CPU s a log", "CPU ms a processed scan", "end : begin", "longest ms",
        "CPU ms a map", "peak MiB", "truth", "error", "loop closures", "worst seed, loop closures", "live, 10 s",
        "live, loop closures", "laser", "odometry, loop closures")
LONG = 50                   # processed scans from which the begin and the end of a run are compared
CLOSED = 0.3                # mean error at revisits up to which loops count as closed: half a door's width [m]


def _mean(values: Iterable[Optional[float]]) -> Any:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def _pair(metres: Any, degrees: Any) -> str:
    return "" if metres is None else "{:.3f} m, {:.2f}°".format(metres, degrees)


def growth(statistics: Dict[str, Any]) -> Optional[float]:
    """Return the CPU time of a scan in the last tenth of a run relative to the first one; None for a short run."""
    cpu = statistics["processScan"]["cpu"]
    return cpu["last_ms"] / cpu["first_ms"] if cpu["first_ms"] > 0.0 and statistics["processed"] >= LONG else None


def row(runs: List[Dict[str, Any]]) -> Tuple[str, ...]:
    """Return the cells for the runs of one log, set and number of particles."""
    first, count = runs[0], len(runs)
    statistics = [run["statistics"] for run in runs]
    scores = [run["score"] for run in runs if run["score"]]

    def error(metres: str, degrees: str, choose: Callable[..., Any] = _mean) -> str:
        found = [(entry[metres], entry[degrees]) for entry in scores if metres in entry]
        return _pair(choose([a for a, _ in found]), choose([b for _, b in found])) if found else ""

    map_times = [entry["map_updates"]["cpu"]["mean_ms"] for entry in statistics if entry["map_updates"]["count"]]
    growths = [value for value in map(growth, statistics) if value is not None]
    return (first["log"], first["set"], str(first["particles"]),
            "{:.0f}".format(sum(entry["processed"] for entry in statistics) / count),
            "{:.1f}".format(_mean(entry["processScan"]["cpu"]["total_s"] for entry in statistics)),
            "{:.1f}".format(_mean(entry["processScan"]["cpu"]["mean_ms"] for entry in statistics)),
            "{:.1f}".format(max(growths)) if growths else "",
            "{:.0f}".format(max(entry["processScan"]["wall"]["max_ms"] for entry in statistics)),
            "{:.1f}".format(_mean(map_times)) if map_times else "",
            "{:.0f}".format(max(entry["peak_memory_mib"] for entry in statistics)),
            scores[0]["kind"] if scores else "none", error("metres", "degrees"),
            error("again_metres", "again_degrees"), error("again_metres", "again_degrees", max),
            error("live_metres", "live_degrees"), error("live_again_metres", "live_again_degrees"),
            error("laser_metres", "laser_degrees", max), error("odometry_again_metres", "odometry_again_degrees"))


def closed(results: List[Dict[str, Any]]) -> str:
    """Return a line for each set and number of particles: how many runs closed their loops, and their errors."""
    groups: Dict[Tuple[str, int], List[float]] = OrderedDict()
    for run in results:
        if run["score"] and "again_metres" in run["score"]:
            groups.setdefault((run["set"], run["particles"]), []).append(run["score"]["again_metres"])
    return "".join("\n\n{}, {} particles: loops closed (mean error at revisits at most {:g} m) in {} of {} runs; that "
                   "error: median {:.3f} m, worst {:.3f} m.".format(
                       name, particles, CLOSED, sum(error <= CLOSED for error in errors), len(errors),
                       sorted(errors)[(len(errors) - 1) // 2], max(errors))
                   for (name, particles), errors in groups.items())


def markdown(results: List[Dict[str, Any]]) -> str:
    """Return the table of all runs: one row per log, set and number of particles, with means over the seeds."""
    groups: Dict[Tuple[str, str, int], List[Dict[str, Any]]] = OrderedDict()
    for run in results:
        groups.setdefault((run["log"], run["set"], run["particles"]), []).append(run)
    lines = ["| {} |".format(" | ".join(HEAD)), "|" + "---|" * len(HEAD)]
    lines += ["| {} |".format(" | ".join(row(runs))) for runs in groups.values()]
    seeds = sorted({len(runs) for runs in groups.values()})
    return "\n".join(lines) + closed(results) + "\n\nMeans over {} seeds; memory and worst seed: the largest.\n".format(
        seeds[0] if len(seeds) == 1 else "{} to {}".format(seeds[0], seeds[-1]))


def check(path: str) -> str:
    """Raise ValueError unless a file has both marker lines once and in order; return its text."""
    with open(path, encoding="utf-8") as stream:
        text = stream.read()
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise ValueError("{}: expected the lines '{}' and '{}' once each, in this order".format(path, BEGIN, END))
    return text


def put(path: str, table: str) -> None:
    """Replace the text between the marker lines of a file atomically.

    Parameters
    ----------
    path : str
        The document.
    table : str
        The table.
    """
    text = check(path)
    before, rest = text.split(BEGIN)
    after = rest.split(END)[1]
    folder = os.path.dirname(os.path.abspath(path))
    descriptor, temporary = tempfile.mkstemp(prefix=".benchmark-", dir=folder)
    try:
        with os.fdopen(descriptor, "w", encoding="utf-8") as stream:
            stream.write(before + BEGIN + "\n" + table + END + after)
        os.chmod(temporary, os.stat(path).st_mode & 0o777)
        os.replace(temporary, path)
    except OSError:
        os.unlink(temporary)
        raise

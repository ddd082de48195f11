# SPDX-License-Identifier: BSD-3-Clause
"""The table of the benchmark, and putting it into a README."""
import os
import tempfile
from collections import OrderedDict

BEGIN, END = "<!-- benchmark: begin -->", "<!-- benchmark: end -->"
HEAD = ("log", "set", "particles", "beams", "processed", "CPU ms a processed scan", "wall ms", "CPU ms a map",
        "peak MiB", "truth", "error", "places met again", "worst seed",
        "worst seed, met again")


def _mean(values):
    values = [value for value in values if value is not None]
    return sum(values) / len(values) if values else None


def _pair(metres, degrees):
    return "" if metres is None else "{:.3f} m, {:.2f}°".format(metres, degrees)


def row(runs):
    """Return the cells for the runs of one log, set and number of particles."""
    first, count = runs[0], len(runs)
    statistics = [run["statistics"] for run in runs]
    scores = [run["score"] for run in runs if run["score"]]

    def error(metres, degrees, choose=_mean):
        found = [(entry[metres], entry[degrees]) for entry in scores if metres in entry]
        return _pair(choose([a for a, _ in found]), choose([b for _, b in found])) if found else ""

    map_times = [entry["map_updates"]["cpu"]["mean_ms"] for entry in statistics if entry["map_updates"]["count"]]
    return (first["log"], first["set"], str(first["particles"]), str(statistics[0]["beams"]),
            "{:.0f}".format(sum(entry["processed"] for entry in statistics) / count),
            "{:.1f}".format(_mean(entry["processScan"]["cpu"]["mean_ms"] for entry in statistics)),
            "{:.1f}".format(_mean(entry["processScan"]["wall"]["mean_ms"] for entry in statistics)),
            "{:.1f}".format(_mean(map_times)) if map_times else "",
            "{:.0f}".format(max(entry["peak_memory_mib"] for entry in statistics)),
            scores[0]["kind"] if scores else "none", error("metres", "degrees"),
            error("again_metres", "again_degrees"), error("metres", "degrees", max),
            error("again_metres", "again_degrees", max))


def markdown(results):
    """Return the table of all runs, one row a log, set and number of particles, means over the seeds."""
    groups = OrderedDict()
    for run in results:
        groups.setdefault((run["log"], run["set"], run["particles"]), []).append(run)
    lines = ["| {} |".format(" | ".join(HEAD)), "|" + "---|" * len(HEAD)]
    lines += ["| {} |".format(" | ".join(row(runs))) for runs in groups.values()]
    seeds = sorted({len(runs) for runs in groups.values()})
    return "\n".join(lines) + "\n\nMeans over {} seeds; memory and worst seed: the largest.\n".format(
        seeds[0] if len(seeds) == 1 else "{} to {}".format(seeds[0], seeds[-1]))


def check(path):
    """Raise ValueError unless a file has the two lines, in their order and once each."""
    with open(path, encoding="utf-8") as stream:
        text = stream.read()
    if text.count(BEGIN) != 1 or text.count(END) != 1 or text.index(BEGIN) > text.index(END):
        raise ValueError("{}: expected the lines '{}' and '{}' once each, in this order".format(path, BEGIN, END))
    return text


def put(path, table):
    """Replace what stands between the two lines of a file; the old file stays until the new one is complete."""
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

# SPDX-License-Identifier: BSD-3-Clause
"""The tables of docs/explanation/performance.md, and the plain lines for one case."""
from __future__ import annotations

import importlib.util
import json
import statistics
import subprocess
import sys
from typing import Any, Callable, Dict, Iterable, List, Tuple

from m2wr_sim.errors import SimError
from m2wr_tools.benchmark import hardware, others

_MEANINGS = (
    ("factor", "simulated seconds per second of processor time", "%.1f"),
    ("wall_factor", "simulated seconds per second", "%.1f"),
    ("step_us", "physics step of all robots [us]", "%.2f"),
    ("scan_us", "scan [us]", "%.1f"),
    ("physics_share", "share of physics", "%.2f"),
    ("scan_share", "share of rays", "%.2f"),
    ("message_share", "share of messages and the rest of the node", "%.2f"),
    ("messages_per_s", "messages received per simulated second", "%.0f"),
    ("startup_s", "start of the node to the first scan [s]", "%.2f"),
    ("load", "processor time per time", "%.3f"),
    ("memory_mb", "peak memory [MB]", "%.0f"),
    ("growth_mb", "growth of memory in the span [MB]", "%.2f"),
    ("late_growth_mb", "growth of memory after the first minute [MB]", "%.2f"),
    ("call_median_ms", "a call of /gazebo/get_model_state, median [ms]", "%.2f"),
    ("call_p99_ms", "99 % of the calls take at most [ms]", "%.2f"),
    ("call_longest_ms", "the longest call [ms]", "%.2f"),
    ("messages", "messages of the solver", "%d"),
    ("contacts", "contacts of robots", "%d"),
    ("c_step_us", "the same step in C [us]", "%.2f"),
    ("ratio", "ratio to C", "%.3f"),
    ("bounded_us", "with broad-phase bounds, as it runs [us]", "%.2f"),
    ("other_factor", "simulated seconds per second of processor time of the other", "%.1f"),
    ("faster", "times as fast as the other", "%.2f"),
    ("speed", "speed that the other reaches, 0.5 asked [m/s]", "%.3f"),
    ("turn_rate", "turn rate that the other reaches, 1.0 asked [rad/s]", "%.3f"),
)

#: Name of a case -> its options.
CASES: Tuple[Tuple[str, Tuple[str, ...]], ...] = (
    ("1 robot, 1 ms", ("--duration", "20")),
    ("1 robot, 5 ms", ("--step", "0.005", "--duration", "60")),
    ("1 robot, 1 ms, 2000 obstacles", ("--obstacles", "2000", "--duration", "20")),
    ("1 robot, 5 ms, 2000 obstacles", ("--obstacles", "2000", "--step", "0.005", "--duration", "60")),
    ("10 robots, 5 ms", ("--robots", "10", "--step", "0.005", "--duration", "10")),
    ("50 robots, 5 ms", ("--robots", "50", "--step", "0.005", "--duration", "4")),
    ("1 robot, 1 ms, engine pyode", ("--engine", "pyode", "--duration", "10")),
    ("node, 1 ms, no subscriber", ("--node", "--duration", "40")),
    ("node, 1 ms, one subscriber on every topic", ("--clients", "1", "--duration", "40")),
    ("node, 5 ms, no subscriber", ("--node", "--step", "0.005", "--duration", "100")),
    ("node, 5 ms, one subscriber on every topic", ("--clients", "1", "--step", "0.005", "--duration", "100")),
    ("node at real-time factor 1, one subscriber", ("--clients", "1", "--factor", "1", "--duration", "10")),
)
COMPARISONS: Tuple[Tuple[str, Tuple[str, ...]], ...] = (
    ("1 robot, 1 ms", ()),
    ("1 robot, 5 ms", ("--step", "0.005")),
    ("50 robots, 5 ms", ("--robots", "50", "--step", "0.005")),
)
OTHERS: Tuple[Tuple[str, Tuple[str, ...]], ...] = (
    ("1 robot, 1 ms", ("--duration", "10")),
    ("1 robot, 5 ms", ("--step", "0.005", "--duration", "20")),
    ("50 robots, 5 ms", ("--robots", "50", "--step", "0.005", "--duration", "1")),
)


def lines(result: Dict[str, Any]) -> str:
    """Return the figures of one case as text, one in each line."""
    rows = [(meaning, form % result[key]) for key, meaning, form in _MEANINGS if result.get(key) is not None]
    width, by_minute = max(len(meaning) for meaning, _ in rows), result.get("memory_by_minute_mb", ())
    rows += [("memory after minute %d [MB]" % minute, "%.2f" % memory) for minute, memory in enumerate(by_minute)]
    return "".join("%-*s  %s\n" % (width, meaning, value) for meaning, value in rows)


def run_case(arguments: Iterable[str]) -> Dict[str, Any]:
    """Measure one case in a process of its own, so that memory and caches are not shared with other cases."""
    command = [sys.executable, "-m", "m2wr_tools.benchmark.command", "--json"] + list(arguments)
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, universal_newlines=True)
    if done.returncode:
        raise SimError("%s failed: %s" % (" ".join(command[1:]), done.stderr.strip()))
    return json.loads(done.stdout.splitlines()[-1])["result"]


def _cell(results: List[Dict[str, Any]], key: str, form: str) -> str:
    values = [result[key] for result in results if result.get(key) is not None]
    return form % statistics.median(values) if values else ""


def _other_simulators(repeats: int) -> List[str]:
    """Return the lines of the table that compares with the other simulators that are installed."""
    rows = []
    for simulator in sorted(others.MAKERS):
        if importlib.util.find_spec(simulator.split("-")[0]) is None:
            continue
        for name, arguments in OTHERS:
            result = run_case(("--compare", simulator, "--repeats", str(repeats)) + arguments)
            rows.append("| %s, %s | %.4g | %.4g | %.1f | %.2f m/s, %.2f rad/s |"
                        % (simulator, name, result["factor"], result["other_factor"], result["faster"],
                           result["speed"], result["turn_rate"]))
    if not rows:
        return []
    return ["", "| against | this | the other | times as fast | the other reaches (asked: 0.5 m/s, 1 rad/s) |",
            "| --- | --- | --- | --- | --- |"] + rows


def make(repeats: int, progress: Callable[[float], object]) -> str:
    """Return the table of all cases as Markdown, with the description of the machine.

    Parameters
    ----------
    repeats : int
        Number of measurements of each case; the cases alternate.
    progress : callable
        Called with the completed share, 0 to 1.

    Raises
    ------
    SimError
        If a case cannot be measured.
    """
    found: Dict[str, List[Dict[str, Any]]] = {name: [] for name, _ in CASES}
    for repeat in range(repeats):
        for index, (name, arguments) in enumerate(CASES):
            found[name].append(run_case(arguments))
            progress((repeat * len(CASES) + index + 1) / (repeats * len(CASES) + len(COMPARISONS)))
    text = ["| case | real-time factor | step [us] | scan [us] | messages and the rest | start to first scan [s] "
            "| peak memory [MB] | solver messages |", "| --- " * 8 + "|"]
    for name, arguments in CASES:
        results = found[name]
        factor = _cell(results, "factor", "%.0f")
        if "--factor" in arguments:
            factor = "1, with %.1f %% of a core" % (100.0 * statistics.median(result["load"] for result in results))
        share = statistics.median(result.get("message_share", -1.0) for result in results)
        text.append("| %s |" % " | ".join((
            name, factor, _cell(results, "step_us", "%.1f"), _cell(results, "scan_us", "%.1f"),
            "%.0f %%" % (100.0 * share) if share >= 0.0 else "", _cell(results, "startup_s", "%.2f"),
            _cell(results, "memory_mb", "%.0f"), "%d" % max(result["messages"] for result in results))))
    text += ["", "| the stepping loop against the same loop in C | this [us] | C [us] | ratio "
             "| with broad-phase bounds [us] |",
             "| --- | --- | --- | --- | --- |"]
    for index, (name, arguments) in enumerate(COMPARISONS):
        result = run_case(("--compare", "c", "--repeats", str(2 * repeats + 1)) + arguments)
        progress((repeats * len(CASES) + index + 1) / (repeats * len(CASES) + len(COMPARISONS)))
        text.append("| %s | %.2f | %.2f | %.2f | %.2f |" % (name, result["step_us"], result["c_step_us"],
                                                            result["ratio"], result["bounded_us"]))
    text += _other_simulators(repeats)
    text += ["", "Medians of %d runs in turns, simulated seconds per second of processor time; %s."
             % (repeats, hardware.sentence(hardware.describe()))]
    return "\n".join(text) + "\n"

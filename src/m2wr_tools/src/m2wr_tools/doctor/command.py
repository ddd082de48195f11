# SPDX-License-Identifier: BSD-3-Clause
"""The doctor command.  Exit code 0: all is well, 1: warnings, 2: problems."""
import argparse
import json
import logging
import sys

from m2wr_tools.doctor import environment, frames, graph, installation
from m2wr_tools.doctor.finding import LEVELS, OK, warning, worst
from m2wr_tools.doctor.machine import Machine

_SIGNS = {OK: "ok     ", "warning": "warning", "problem": "PROBLEM"}
_NETWORK = 3.0              # s for any connection


def examine(machine, live=True):
    """Return all findings on a machine and, if ``live``, on what runs under its master."""
    found = []
    for name, check in (("installation", installation.check), ("environment", environment.check_environment),
                        ("display", environment.check_display)):
        found += _guarded(name, check, machine)
    state = graph.read_graph(machine.environ)
    found += _guarded("master", graph.check_master, machine, state)
    if state is not None and live:
        found += _guarded("topics", graph.check_topics, state)
        if state.publishers.get("/clock") or state.types.keys() - {"/rosout", "/rosout_agg"}:
            found += _guarded("frames", _listen, state)
    return found


def _guarded(area, check, *arguments):
    """Return what a check finds; one that fails itself must not keep the others from being made."""
    try:
        return check(*arguments)
    except Exception as error:
        return [warning(area, "a check failed itself: %s: %s" % (type(error).__name__, error),
                        "what it would have looked at is not known")]


def _listen(state):
    listener = frames.Listener(state)
    try:
        return frames.check(state, listener.listen())
    finally:
        listener.close()


def format_findings(found, quiet=False):
    """Return the lines for the screen; the last one counts all findings, also those that ``quiet`` leaves out."""
    lines, area = [], None
    for entry in found:
        if quiet and entry.level == OK:
            continue
        if entry.area != area:
            area = entry.area
            lines.append(area)
        lines.append("  %s  %s" % (_SIGNS[entry.level], entry.what))
        if entry.cure:
            lines.append("           -> %s" % entry.cure)
    counts = {level: sum(entry.level == level for entry in found) for level in LEVELS}
    lines.append("%d problems, %d warnings, %d ok" % (counts["problem"], counts["warning"], counts["ok"]))
    return "\n".join(lines)


def main(argv=None, machine=None):
    """Entry point; returns the exit code."""
    parser = argparse.ArgumentParser(prog="doctor", description="Check installation, environment, display, master, "
                                     "topics and frames, and say what to do. Exit code 0: all is well; 1: warnings; 2: "
                                     "problems.")
    parser.add_argument("--json", action="store_true", help="for programs")
    parser.add_argument("--quiet", action="store_true", help="only warnings and problems")
    parser.add_argument("--not-running", action="store_true", help="leave out what needs a running simulation")
    words = [word for word in (sys.argv[1:] if argv is None else argv) if ":=" not in word]
    given = parser.parse_args(words)
    logging.getLogger("rosout").setLevel(logging.ERROR)
    graph.time_limit(_NETWORK)
    found = examine(machine or Machine(), not given.not_running)
    code = LEVELS.index(worst(found))
    if given.json:
        kept = [dict(entry._asdict()) for entry in found if not (given.quiet and entry.level == OK)]
        print(json.dumps({"exit_code": code, "findings": kept}, indent=1))
    else:
        print(format_findings(found, given.quiet))
    return code

# SPDX-License-Identifier: BSD-3-Clause
"""The command ``doctor``.  Exit code 0: no fault, 1: warnings, 2: problems."""
from __future__ import annotations

import argparse
import json
import logging
import sys
from typing import TYPE_CHECKING, Any, Callable, List, Optional, Sequence

from m2wr_tools.doctor import environment, frames, graph, installation
from m2wr_tools.doctor.finding import LEVELS, OK, problem, warning, worst
from m2wr_tools.doctor.machine import Machine

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.graph import Graph

_SIGNS = {OK: "ok     ", "warning": "warning", "problem": "PROBLEM"}
_NETWORK = 3.0              # s for any connection


def examine(machine: Machine, live: bool = True) -> List[Finding]:
    """Return all findings.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    live : bool
        Whether to look at the nodes of its master too.
    """
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


def _guarded(area: str, check: Callable[..., List[Finding]], *arguments: Any) -> List[Finding]:
    """Return the findings of a check; one that raises an error does not stop the others."""
    try:
        return check(*arguments)
    except Exception as error:
        return [warning(area, "the check itself failed: %s: %s" % (type(error).__name__, error),
                        "its result is not known")]


def _listen(state: Graph) -> List[Finding]:
    listener = frames.Listener(state)
    try:
        return frames.check(state, listener.listen())
    finally:
        listener.close()


def examine_file(machine: Machine, words: Sequence[str]) -> List[Finding]:
    """Return the findings on a launch file, or on a robot description.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    words : sequence of str
        As for roslaunch: ``[PACKAGE] FILE [NAME:=VALUE ...]``.
    """
    from m2wr_tools.doctor import launch_check  # loads XML and the readers of robots
    from m2wr_tools.doctor.launch_reader import RobotFile

    names = [word for word in words if ":=" not in word]
    arguments = dict(word.split(":=", 1) for word in words if ":=" in word and not word.startswith("__"))
    packages = installation.PackageList(machine)
    path = launch_check.launch_path(packages, names)
    if path is None:
        return [problem("launch file", "there is no file %s" % " ".join(names), "give its path, or a package and the "
                        "name of a launch file in it; source the workspace that has it first")]
    if path.endswith((".xacro", ".urdf", ".sdf")):
        return _guarded("robot", launch_check.check_robot_file, machine, packages, RobotFile(path, arguments, path))
    return _guarded("launch file", launch_check.check, machine, packages, path, arguments)


def format_findings(found: Sequence[Finding], quiet: bool = False) -> str:
    """Return the lines for the screen; the last one counts all findings.

    Parameters
    ----------
    found : sequence of Finding
        In the order of their areas.
    quiet : bool
        Leave out findings without a fault.
    """
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


def main(argv: Optional[List[str]] = None, machine: Optional[Machine] = None) -> int:
    """Run the command.

    Parameters
    ----------
    argv : list of str, optional
        Arguments; default: those of this process.
    machine : Machine, optional
        The machine to look at; default: this one.

    Returns
    -------
    int
        The exit code.
    """
    parser = argparse.ArgumentParser(prog="doctor", description="Check installation, environment, display, master, "
                                     "topics and frames, and say what to do. With a launch file: check that instead, "
                                     "and start nothing. Exit code 0: all is well; 1: warnings; 2: problems.")
    parser.add_argument("file", nargs="*", metavar="[PACKAGE] FILE [NAME:=VALUE ...]", help="a launch file, as for "
                        "roslaunch, or a robot description: what is missing, what will be left out, what to install")
    parser.add_argument("--json", action="store_true", help="JSON output, for programs")
    parser.add_argument("--quiet", action="store_true", help="only warnings and problems")
    parser.add_argument("--not-running", action="store_true", help="skip checks that need a running simulation")
    words = sys.argv[1:] if argv is None else argv
    given = parser.parse_args([word for word in words if ":=" not in word])
    logging.getLogger("rosout").setLevel(logging.ERROR)
    graph.time_limit(_NETWORK)
    if given.file:
        found = examine_file(machine or Machine(), given.file + [word for word in words if ":=" in word])
    else:
        found = examine(machine or Machine(), not given.not_running)
    code = LEVELS.index(worst(found))
    if given.json:
        kept = [dict(entry._asdict()) for entry in found if not (given.quiet and entry.level == OK)]
        print(json.dumps({"exit_code": code, "findings": kept}, indent=1))
    else:
        print(format_findings(found, given.quiet))
    return code

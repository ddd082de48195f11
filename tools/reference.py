#!/usr/bin/env python3
# SPDX-License-Identifier: BSD-3-Clause
"""Writes docs/reference.md: packages, programs, launch arguments, parameters, topics and services, from the code.

Also writes docs/reference/mapping_constants.md: the tuned constants of the mapper.

    tools/reference.py            write it; topics and services are those of the last --graph
    tools/reference.py --graph    start the nodes first and ask them for their topics and services (half a minute)
    tools/reference.py --check    write nothing; exit code 1, and the lines that differ, if it is not what the code says

Topics and services are kept in tools/reference_graph.yaml.  Needs a shell that has sourced devel/setup.bash.
"""
from __future__ import annotations

import argparse
import ast
import difflib
import glob
import os
import re
import signal
import socket
import subprocess
import sys
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import MISSING, fields
from typing import Any, Dict, Iterable, List, Optional, Sequence, Set, Tuple

import yaml

from m2wr_tools.slam_benchmark import tuning_table

#: Name, default and meaning of a parameter.
Parameter = Tuple[str, Any, str]
#: {node: {"publishes", "subscribes", "serves": {name: type}}}
Graph = Dict[str, Dict[str, Dict[str, str]]]

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
TARGET = os.path.join(ROOT, "docs", "reference.md")
CONSTANTS = os.path.join(ROOT, "docs", "reference", "mapping_constants.md")
GRAPH = os.path.join(ROOT, "tools", "reference_graph.yaml")
LAUNCH = os.path.join(ROOT, "test", "rostest", "reference_base.launch")
HEAD = """# Reference

Written by `tools/reference.py` from the code; a test fails when it is out of date. The README of each package
explains the values or links to the pages that do.
"""
#: Services and topics that every node has.
COMMON_TOPICS = {"/rosout", "/rosout_agg"}
COMMON_SERVICES = ("/get_loggers", "/set_logger_level")
DIRECTIONS = (("publishes", "out"), ("subscribes", "in"), ("serves", "service"))
PATIENCE, QUIET = 120.0, 6.0        # s: for the start of the nodes; without a change until the graph is complete


# ---- from files ------------------------------------------------------------------------------------------------

def packages(root: str = ROOT) -> List[Tuple[str, str]]:
    """Return (name, folder) of every package for users, in the order of the tree."""
    found = []
    for path in sorted(glob.glob(os.path.join(root, "src", "*", "package.xml"))
                       ) + sorted(glob.glob(os.path.join(root, "dropin", "*", "package.xml"))):
        found.append((ElementTree.parse(path).getroot().findtext("name", ""), os.path.dirname(path)))
    return found


def cell(text: Any) -> str:
    """Return a text escaped for a cell of a table."""
    return " ".join(str(text).split()).replace("|", "\\|")


def code(text: Any) -> str:
    """Return a value as code, or an empty cell."""
    return "`%s`" % cell(text) if str(text).strip() else ""


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> List[str]:
    """Return the lines of a table."""
    return ["| %s |" % " | ".join(head), "|%s" % (" --- |" * len(head))] + ["| %s |" % " | ".join(row) for row in rows]


def first_sentence(text: Optional[str]) -> str:
    """Return a text up to its first full stop at the end of a word."""
    return re.split(r"(?<=[a-z0-9)`])\.(?:\s|$)", " ".join((text or "").split()), maxsplit=1)[0]


def programs(name: str, folder: str) -> List[Tuple[str, str, str]]:
    """Return (package, name, sentence) of the Python programs in a package's folders scripts/ and nodes/.

    ``package`` is the one that rosrun finds the program by: a folder below scripts/ has the name of another package.
    """
    found = []
    for path in sorted(glob.glob(os.path.join(folder, "scripts", "**"), recursive=True)
                       + glob.glob(os.path.join(folder, "nodes", "*"))):
        if not os.path.isfile(path) or path.endswith(".pyc"):
            continue
        with open(path, encoding="utf-8") as stream:
            text = stream.read()
        if re.match(r"#!.*python", text):
            above = os.path.basename(os.path.dirname(path))
            found.append((name if above in ("scripts", "nodes") else above, os.path.basename(path),
                          first_sentence(ast.get_docstring(ast.parse(text)))))
    return sorted(found)


def launch_files(folder: str) -> List[Tuple[str, str, List[Tuple[Any, Optional[str], str]]]]:
    """Return (name, comment, [(argument, default or None, meaning)]) of a package's launch files."""
    found = []
    for path in sorted(glob.glob(os.path.join(folder, "launch", "*.launch"))):
        with open(path, encoding="utf-8") as stream:
            text = stream.read()
        comment = re.search(r"<!--(.*?)-->", text.split("<launch")[0], re.S)
        arguments = [(tag.get("name"), tag.get("default"), tag.get("doc") or "")
                     for tag in ElementTree.fromstring(text).findall("arg") if tag.get("value") is None]
        found.append((os.path.basename(path), first_sentence(comment.group(1)) if comment else "", arguments))
    return found


def readable_default(text: Optional[str]) -> str:
    """Return a default in readable form: the folders and conditions of launch files in few words."""
    if text is None:
        return "required"
    if text == "$(eval optenv('DISPLAY', '') != '')":
        return "where there is a display"
    return code(re.sub(r"\$\(find ([\w]+)\)", r"\1", text)) or "empty"


def read_parameters(folder: str, pages: Optional[str] = None) -> List[Parameter]:
    """Return (name, default, meaning) of the parameters that Python sources of a package read by a literal name.

    The meaning is that of the row for the name in the package's README, or in docs/reference/PACKAGE.md.
    """
    found: Dict[str, Any] = {}
    for path in sorted(glob.glob(os.path.join(folder, "src", "**", "*.py"), recursive=True)):
        with open(path, encoding="utf-8") as stream:
            tree = ast.parse(stream.read())
        for node in ast.walk(tree):
            for name, default in _parameters_of(node):
                found.setdefault(name, default)
    rows = []
    files = (os.path.join(folder, "README.md"),
             os.path.join(pages or os.path.join(ROOT, "docs", "reference"), os.path.basename(folder) + ".md"))
    for path in filter(os.path.isfile, files):
        with open(path, encoding="utf-8") as stream:
            rows += [[part.strip() for part in line.strip().strip("|").split("|")]
                     for line in stream if line.startswith("| `")]
    meanings = {name: row[-1] for row in reversed(rows) for part in row[:2] for name in re.findall(r"`(~?\w+)`", part)}
    return [(name, default, meanings.get(name) or meanings.get(name.lstrip("~"), ""))
            for name, default in sorted(found.items())]


def _parameters_of(node: ast.AST) -> List[Tuple[str, Any]]:
    """(name, default) of the parameters that one node of a syntax tree reads."""
    def value(part: Any) -> Any:
        return ast.literal_eval(part)

    try:
        if isinstance(node, ast.Assign) and getattr(node.targets[0], "id", "") == "_DEFAULTS":
            return [("~" + name, default) for name, default in value(node.value).items()]
        if not isinstance(node, ast.Call) or not isinstance(value(node.args[0]), str) or value(node.args[0]) == "~":
            return []
        called, name = getattr(node.func, "attr", getattr(node.func, "id", "")), value(node.args[0])
        if called in ("get_param", "optional_number"):
            return [(name, value(node.args[1]) if len(node.args) > 1 else "required")]
        if called == "required_number":
            return [(name, "required")]
        if called == "_parameter":          # (name, value from the command line, default)
            return [("~" + name, value(node.args[2]))]
    except (ValueError, IndexError):        # not a literal: no fixed name
        pass
    return []


def config_rows(entries: Iterable[Parameter]) -> List[Tuple[str, str, str]]:
    """Return rows of (name, default, meaning) triples; None is no default."""
    return [(code(name), "unset" if default is None else code(default) or "empty", cell(meaning))
            for name, default, meaning in entries]


def node_parameters() -> List[Parameter]:
    """Return (name, default, meaning) of the parameters of the simulation node."""
    from m2wr_sim.ros.params import NodeConfig
    return [("~" + entry.name, entry.default_factory() if entry.default is MISSING else entry.default,  # type: ignore
             entry.metadata["help"]) for entry in fields(NodeConfig)]


def mapper_parameters() -> List[Parameter]:
    """Return (name, default, meaning) of the parameters of the mapping node."""
    from m2wr_gmapping.config import PARAMETERS
    return [("~" + name, parameter.default, parameter.meaning + (" [%s]" % parameter.unit if parameter.unit else ""))
            for name, parameter in PARAMETERS.items()]


# ---- from running nodes ----------------------------------------------------------------------------------------

def free_port() -> int:
    """Return a free port of the loopback interface."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def expected_nodes() -> Set[str]:
    """Return the names of the nodes in the launch file that this script starts."""
    with open(LAUNCH, encoding="utf-8") as stream:
        return set(re.findall(r"nodes: ([\w\s]+)", stream.read())[0].split())


def graph_of(master: Any) -> Graph:
    """Return {node: {"publishes", "subscribes", "serves": {name: type}}} of the nodes registered at a master."""
    import rosservice
    publishers, subscribers, services = master.getSystemState()
    types = dict(master.getTopicTypes())
    found: Graph = {}
    for kind, part in (("publishes", publishers), ("subscribes", subscribers)):
        for topic, nodes in part:
            for node in nodes:
                if topic not in COMMON_TOPICS and not (topic == "/clock" and kind == "subscribes"):
                    found.setdefault(node.lstrip("/"), {}).setdefault(kind, {})[topic] = types.get(topic, "*")
    for service, nodes in services:
        for node in nodes:
            if not service.endswith(COMMON_SERVICES):
                kind = rosservice.get_service_type(service)
                found.setdefault(node.lstrip("/"), {}).setdefault("serves", {})[service] = kind or "*"
    return {node: found[node] for node in found if node in expected_nodes()}


def running_graph() -> Graph:
    """Start the nodes, wait until all are registered and the graph is stable, and return the graph.

    Raises
    ------
    RuntimeError
        If the nodes do not come up; with what they said.
    """
    os.environ["ROS_MASTER_URI"] = "http://127.0.0.1:%d" % free_port()
    import rosgraph
    log = open(os.path.join("/tmp", "m2wr_reference_%d.log" % os.getpid()), "w+", encoding="utf-8")
    launch = subprocess.Popen(["roslaunch", LAUNCH], stdout=log, stderr=subprocess.STDOUT, start_new_session=True,
                              env=dict(os.environ, DISPLAY="", WAYLAND_DISPLAY=""))
    try:
        master, last, since, start = rosgraph.Master("/reference"), None, 0.0, time.monotonic()
        while True:
            time.sleep(0.5)
            try:
                graph = graph_of(master)
            except (rosgraph.MasterException, OSError, TypeError):      # not registered yet
                graph = {}
            if graph != last:
                last, since = graph, time.monotonic()
            missing = expected_nodes() - set(graph)
            if not missing and time.monotonic() - since > QUIET:
                return graph
            if time.monotonic() - start > PATIENCE or launch.poll() is not None:
                log.seek(0)
                raise RuntimeError("waited %g s for %s; the nodes said\n%s" % (
                    time.monotonic() - start, ", ".join(sorted(missing)) or "an end of changes", log.read()))
    finally:
        if launch.poll() is None:
            os.killpg(launch.pid, signal.SIGINT)
        launch.wait()
        log.close()
        os.remove(log.name)


# ---- the page --------------------------------------------------------------------------------------------------

def render(graph: Graph) -> str:
    """Return the text of the page."""
    lines = HEAD.splitlines() + ["", "## Packages", ""]
    found = packages()
    rows = []
    for name, folder in found:
        text = ElementTree.parse(os.path.join(folder, "package.xml")).getroot().findtext("description")
        rows.append(("[%s](../%s/README.md)" % (name, os.path.relpath(folder, ROOT)), cell(first_sentence(text))))
    lines += table(("package", "what"), rows)
    lines += ["", "## Programs", "", "Started with `rosrun PACKAGE PROGRAM`; those that are no nodes tell their "
              "options with `-h`.", ""]
    lines += table(("package", "program", "what"), [
        (name, code(program), cell(what)) for name, program, what in sorted(
            (entry for package, folder in found for entry in programs(package, folder)),
            key=lambda entry: [name for name, _ in found].index(entry[0]))])
    lines += ["", "## Nodes, topics and services", "",
              "As `mapping.launch` starts them, with some more beside it; names of a robot in a namespace begin with "
              "that. Every node has `/rosout` and two services for its log besides.", ""]
    for node in sorted(graph):
        lines += ["### %s" % node, ""]
        lines += table(("name", "", "type"), [
            (code(name), word, kind) for part, word in DIRECTIONS
            for name, kind in sorted(graph[node].get(part, {}).items())]) + [""]
    lines += ["## Parameters"]
    head = ("parameter", "default", "meaning")
    lines += ["", "### m2wr_sim_node (node gazebo)", ""] + table(head, config_rows(node_parameters()))
    lines += ["", "### slam_gmapping and slam_gmapping_replay", "",
              "Those of the live node alone, such as `~save_on_exit`, are in "
              "[its reference](reference/mapping_nodes.md#parameters).", ""]
    lines += table(head, config_rows(mapper_parameters()))
    for name, folder in found:
        parameters = read_parameters(folder)
        if parameters and name not in ("m2wr_sim", "m2wr_gmapping", "m2wr_tools"):
            lines += ["", "### nodes of %s" % name, ""] + table(head, config_rows(parameters))
    lines += ["", "## Launch files", ""]
    for name, folder in found:
        for file, comment, arguments in launch_files(folder):
            lines += ["### %s %s" % (name, file), ""] + ([cell(comment) + ".", ""] if comment else [])
            if arguments:
                lines += table(("argument", "default", "meaning"), [
                    (code(argument), readable_default(default), cell(meaning))
                    for argument, default, meaning in arguments])
                lines += [""]
    return "\n".join(lines).rstrip() + "\n"


def differences(before: str, now: str, name: str) -> List[str]:
    """Return the lines that differ between two texts."""
    return list(difflib.unified_diff(before.splitlines(), now.splitlines(), name, name + " as the code says",
                                     lineterm="", n=0))


def main(arguments: Optional[List[str]] = None) -> int:
    """Write or check the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--graph", action="store_true", help="start the nodes and read the graph")
    parser.add_argument("--check", action="store_true", help="write nothing")
    options = parser.parse_args(arguments)
    with open(GRAPH, encoding="utf-8") as stream:
        kept = stream.read()
    graph = running_graph() if options.graph else yaml.safe_load(kept)
    stored = "# Written by tools/reference.py --graph: what test/rostest/reference_base.launch registers.\n" + \
        yaml.safe_dump(graph, default_flow_style=False, sort_keys=True)
    text = render(graph)
    if options.check:
        with open(TARGET, encoding="utf-8") as stream:
            wrong = differences(stream.read(), text, "docs/reference.md")
        with open(CONSTANTS, encoding="utf-8") as stream:
            wrong += differences(stream.read(), tuning_table.markdown(), "docs/reference/mapping_constants.md")
        if options.graph:
            wrong += differences(kept, stored, "tools/reference_graph.yaml")
        print("\n".join(wrong + ["run tools/reference.py%s" % (" --graph" if options.graph else "")] if wrong else []))
        return 1 if wrong else 0
    for path, content in ((TARGET, text), (GRAPH, stored), (CONSTANTS, tuning_table.markdown())):
        with open(path, "w", encoding="utf-8") as stream:
            stream.write(content)
    return 0


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: BSD-3-Clause
"""Reads descriptions and worlds as the simulator will, in a process of its own with limits, and reports as JSON.

xacro evaluates Python, as roslaunch's own ``<param command="xacro ...">`` does; a file may also be endless or huge.
"""
from __future__ import annotations

import json
import os
import re
import resource
import subprocess
import sys
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Set, Tuple

from lxml import etree

from m2wr_sim.api.loading import read_robot, read_world
from m2wr_sim.errors import ModelError, WorldError
from m2wr_sim.model.types import PluginSpec
from m2wr_sim.model.xml.safe import XmlError, parse_xml, read_file
from m2wr_sim.plugins.registry import PLUGINS, library_name
from m2wr_sim.plugins.unsupported import explain

PATIENCE = 60.0             # s of wall time for one description
MEMORY = 3 << 30            # bytes of address space
MOST_FILES = 300            # xacro files
_FIND = re.compile(r"\$\(find\s+([^)\s]+)\s*\)")


class ModelReport(NamedTuple):
    """What the simulator will say about a description.

    ``error`` is empty if it can be used.  ``plugins`` are the libraries that work, ``left_out`` the sentences on those
    that do not, ``notes`` other warnings.
    """

    name: str
    error: str
    plugins: List[str]
    left_out: List[str]
    notes: List[str]


def read_apart(kind: str, path: str, arguments: Dict[str, str], environ: Dict[str, str]) -> ModelReport:
    """Return the report on a file, made by another process.

    Parameters
    ----------
    kind : str
        robot or world.
    path : str
        The file.
    arguments : dict of str to str
        Of xacro.
    environ : dict of str to str
        Environment of the process.
    """
    command = [sys.executable, "-m", "m2wr_tools.doctor.robot_files", kind, path, json.dumps(arguments)]
    try:
        done = subprocess.run(command, env=environ, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.PIPE, timeout=PATIENCE)
        return ModelReport(**json.loads(done.stdout.decode().splitlines()[-1]))
    except subprocess.TimeoutExpired:
        return ModelReport("", "reading it takes longer than %.0f s" % PATIENCE, [], [], [])
    except (OSError, ValueError, IndexError, TypeError) as error:
        return ModelReport("", "it cannot be read: %s" % (error or "no memory"), [], [], [])


def report_on(kind: str, path: str, arguments: Dict[str, str]) -> ModelReport:
    """Return the report on a file.

    Parameters
    ----------
    kind : str
        robot or world.
    path : str
        The file.
    arguments : dict of str to str
        Of xacro.
    """
    try:
        if kind == "world":
            world = read_world(path)
            owners: List[Tuple[str, Any]] = [("the world", world)] + [(model.name, model) for model in world.models]
            name, notes = world.name, world.notes
        else:
            model = read_robot(path, arguments)
            owners, name, notes = [(model.name, model)], model.name, model.notes
    except (ModelError, WorldError, XmlError) as error:
        return ModelReport("", str(error), [], [], [])
    plugins: List[str] = []
    left_out: List[str] = []
    for owner, holder in owners:
        for spec in _plugins(holder):
            library = library_name(spec.filename)
            if library in PLUGINS:
                plugins.append(library)
                continue
            sentence, lacks = explain(spec, owner)
            if lacks:
                left_out.append(sentence)
    return ModelReport(name, "", sorted(set(plugins)), sorted(set(left_out)), list(notes))


def _plugins(holder: Any) -> List[PluginSpec]:
    """Return the plugins of a model or world, and of the sensors of its links."""
    found = list(getattr(holder, "plugins", ()))
    for link in getattr(holder, "links", ()):
        for sensor in link.sensors:
            found += list(sensor.plugins)
    return found


class XacroNames(NamedTuple):
    """Names in a xacro file and its includes; ``sometimes``: only within a condition or macro."""

    missing: Dict[str, str]         # package -> place of an include that is always read
    sometimes: Dict[str, str]
    libraries: Set[str]


def scan_xacro(path: str, find: Callable[[str], Optional[str]]) -> XacroNames:
    """Return the packages that the includes of a xacro file name and that do not exist, without expanding it.

    Parameters
    ----------
    path : str
        The file.
    find : callable
        Package name -> its folder, or None.
    """
    names = XacroNames({}, {}, set())
    waiting, seen = [(path, False)], set()  # type: Tuple[List[Tuple[str, bool]], Set[str]]
    while waiting and len(seen) < MOST_FILES:
        file, conditional = waiting.pop()
        if file in seen:
            continue
        seen.add(file)
        try:
            root = parse_xml(read_file(file), file)
        except (XmlError, OSError):
            continue                    # expansion reports it
        for element in root.iter("*"):
            name = etree.QName(element).localname
            if name == "plugin" and element.get("filename"):
                names.libraries.add(library_name(element.get("filename")))
            if name != "include" or element.tag == name or not element.get("filename"):
                continue
            inner = conditional or any(etree.QName(parent).localname in ("if", "unless", "macro")
                                       for parent in element.iterancestors())
            target = _FIND.sub(lambda match: find(match.group(1)) or "/", element.get("filename"))
            for package in _FIND.findall(element.get("filename")):
                if find(package) is None:
                    (names.sometimes if inner else names.missing).setdefault(
                        package, "%s:%d" % (file, element.sourceline or 0))
            waiting.append((os.path.join(os.path.dirname(file), target), inner))
    return names


def main() -> int:
    """Print the report on the file of the command line as JSON."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    kind, path, arguments = sys.argv[1:4]
    print(json.dumps(report_on(kind, path, json.loads(arguments))._asdict()))
    return 0


if __name__ == "__main__":
    sys.exit(main())

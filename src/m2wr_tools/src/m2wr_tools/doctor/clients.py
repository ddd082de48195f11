# SPDX-License-Identifier: BSD-3-Clause
"""Checks for what programs written for Gazebo expect of a full desktop installation of ROS.  The list is a file."""
from __future__ import annotations

import os
import sysconfig
from typing import TYPE_CHECKING, Iterable, List, NamedTuple

from m2wr_tools.doctor.finding import ok, warning

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.installation import PackageList
    from m2wr_tools.doctor.machine import Machine

_AREA = "installation"
LIST = "config/client_packages.txt"             # below the folder of m2wr_sim
_NOETIC = "/opt/ros/noetic"
_KINDS = {"module": 1, "node": 1, "program": 1, "cmake": 0, "package": 0}     # and how many names follow
_PYTHON = "python"


class Entry(NamedTuple):
    """One line of the list; ``ros`` is empty for what is no ROS package, ``name`` for kinds that have none."""

    debian: str
    ros: str
    kind: str
    name: str


def parse(lines: Iterable[str]) -> List[Entry]:
    """Return the Entries of the list's lines; ValueError names one that cannot be read."""
    found = []
    for number, line in enumerate(lines, 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        if len(words) < 3 or words[2] not in _KINDS or len(words) != 3 + _KINDS[words[2]]:
            raise ValueError("line %d: expected DEBIAN_PACKAGE ROS_PACKAGE KIND [NAME], read %r" % (
                number, line.strip()))
        found.append(Entry(words[0], "" if words[1] == "-" else words[1], words[2], words[3] if len(words) > 3 else ""))
    return found


def check(machine: Machine, packages: PackageList) -> List[Finding]:
    """Return the findings on every entry of the list; missing entries are one finding with one command.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    packages : PackageList
        Its ROS packages.
    """
    folder = packages.find("m2wr_sim") or ""
    try:
        entries = parse(machine.lines(os.path.join(folder, LIST)))
    except (OSError, ValueError) as error:
        return [warning(_AREA, "the list of packages for other people's programs cannot be read: %s" % error,
                        "build or install m2wr_sim again")]
    missing = [entry for entry in entries if not _is_there(machine, packages, entry)]
    found = [warning(_AREA, "there is no program `%s`: scripts that begin with \"#!/usr/bin/env %s\" end with exit "
                     "code 127" % (entry.name, entry.name), _install(machine, [entry]))
             for entry in missing if (entry.kind, entry.name) == ("program", _PYTHON)]
    missing = [entry for entry in missing if (entry.kind, entry.name) != ("program", _PYTHON)]
    if missing:
        found.append(warning(_AREA, "missing, but expected by programs written for Gazebo: %s" % ", ".join(
            _describe(entry) for entry in missing), _install(machine, missing)))
    return found or [ok(_AREA, "%d modules, programs and libraries expected by programs for Gazebo are installed",
                        len(entries))]


def _is_there(machine: Machine, packages: PackageList, entry: Entry) -> bool:
    prefixes = [prefix for prefix in machine.environ.get("CMAKE_PREFIX_PATH", "").split(":") if prefix]
    prefixes += [_NOETIC, "/usr"]
    if entry.kind == "module":
        return machine.has_module(entry.name)
    if entry.kind == "program":
        return bool(machine.which(entry.name))
    if entry.kind == "package":
        return bool(packages.find(entry.ros))
    if entry.kind == "node":
        return bool(packages.find(entry.ros)) and any(
            machine.exists(os.path.join(prefix, place, entry.ros, entry.name))
            for prefix in prefixes for place in ("lib", "share"))
    places = ["share/%s/cmake" % entry.ros,
              "lib/%s/cmake/%s" % (sysconfig.get_config_var("MULTIARCH"), entry.ros)]
    return any(machine.exists(os.path.join(prefix, place, entry.ros + "Config.cmake"))
               for prefix in prefixes for place in places)


def _describe(entry: Entry) -> str:
    return {"module": "Python module %s" % entry.name, "program": entry.name, "package": "package %s" % entry.ros,
            "node": "%s/%s" % (entry.ros, entry.name), "cmake": "C++ of %s" % entry.ros}[entry.kind]


def _install(machine: Machine, entries: List[Entry]) -> str:
    noetic = machine.exists(os.path.join(_NOETIC, "setup.bash"))
    names = {"ros-noetic-" + entry.ros.replace("_", "-") if noetic and entry.ros else entry.debian for entry in entries}
    return "make setup, or: sudo apt install %s" % " ".join(sorted(names))

# SPDX-License-Identifier: BSD-3-Clause
"""Checks a launch file before its start: what is missing, what the simulator will leave out, and what to do."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, Dict, List, Mapping, Optional, Set

from m2wr_tools.doctor import nodelets
from m2wr_tools.doctor.finding import ok, problem, some, warning
from m2wr_tools.doctor.launch_reader import LaunchReader
from m2wr_tools.doctor.launch_words import not_found
from m2wr_tools.doctor.package_sources import how_to_get
from m2wr_tools.doctor.robot_files import read_apart, scan_xacro

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.installation import PackageList
    from m2wr_tools.doctor.launch_reader import LaunchContents, NodeEntry, RobotFile
    from m2wr_tools.doctor.machine import Machine

_FILES, _PACKAGES, _NODES, _ROBOT, _WORLD = "launch file", "packages", "nodes", "robot", "world"
_OWN = b"m2wr.example"      # in the package.xml of our packages and stand-ins
#: Programs that need a display, and what to start where there is none.
_WINDOWS = {
    ("joint_state_publisher_gui", "joint_state_publisher_gui"):
        'without sliders it is pkg="joint_state_publisher" type="joint_state_publisher"; controllers move joints',
    ("rviz", "rviz"): "leave it out by the launch file's argument for it; live:=true shows the robots in a browser",
}
_MOST_NOTES = 10            # warnings on one description


def check(machine: Machine, packages: PackageList, path: str, arguments: Mapping[str, str]) -> List[Finding]:
    """Return the findings on a launch file.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    packages : PackageList
        Its ROS packages.
    path : str
        Of the launch file.
    arguments : mapping of str to str
        As ``name:=value`` on the command line of roslaunch.
    """
    contents = LaunchReader(packages.find, machine.environ).read(path, arguments)
    found = _check_files(contents, path)
    found += _check_packages(machine, packages, contents)
    found += _check_nodes(machine, packages, contents)
    checked: Set[str] = set()
    for robot in contents.robots:
        key = robot.path + repr(sorted(robot.arguments.items()))
        if key not in checked:
            checked.add(key)
            found += _check_robot(machine, packages, robot)
    return found + _check_worlds(machine, packages, contents)


def launch_path(packages: PackageList, words: List[str]) -> Optional[str]:
    """Return the path of the launch file that ``[PACKAGE] FILE`` names as for roslaunch, or None.

    Parameters
    ----------
    packages : PackageList
        ROS packages.
    words : list of str
        One or two words of the command line.
    """
    if len(words) == 1:
        return words[0] if os.path.isfile(words[0]) else None
    folder = packages.find(words[0])
    if folder is None or len(words) != 2:
        return None
    for where, _, names in os.walk(folder):
        if words[1] in names:
            return os.path.join(where, words[1])
    return None


# ---- files ---------------------------------------------------------------------------------------------------------

def _check_files(contents: LaunchContents, path: str) -> List[Finding]:
    found = [problem(_FILES, "%s (%s)" % (sentence, place) if not sentence.startswith(place) else sentence,
                     "correct the file; roslaunch says the same") for sentence, place in contents.faults]
    for file, place in contents.absent:
        found.append(problem(_FILES, "%s does not exist, named in %s" % (file, place),
                             "correct the name, or build the package that makes the file"))
    for name, place in contents.unset.items():
        kind, _, word = name.rpartition(" ")
        found.append(problem(_FILES, "the %s has no value, used in %s" % (name, place),
                             "add %s:=VALUE to the command" % word if kind == "argument" else
                             "export %s=VALUE before roslaunch" % word))
    for reason, place in contents.unknown:
        found.append(warning(_FILES, "%s (%s)" % (reason, place), "not examined further; roslaunch will tell"))
    for command, place in contents.commands:
        found.append(warning(_FILES, "the command %s in %s makes a parameter; it is not run here" % (command, place),
                             "if it writes a robot description: examine that with rosrun m2wr_sim doctor FILE.xacro"))
    return found or [ok(_FILES, "%s can be read; %d files with all includes", path, len(contents.files))]


# ---- packages and nodes --------------------------------------------------------------------------------------------

def _check_packages(machine: Machine, packages: PackageList, contents: LaunchContents) -> List[Finding]:
    found = [problem(_PACKAGES, "package %s is missing: roslaunch refuses the whole file ($(find %s) in %s)" % (
        name, name, place), how_to_get(machine, name)) for name, place in sorted(contents.missing.items())]
    used = {node.package for node in contents.nodes if packages.find(node.package)}
    served = sorted(name for name in used if _is_own(machine, packages, name))
    if served:
        found.append(ok(_PACKAGES, "served by this workspace: %s", some(served, 20)))
    if used - set(served):
        found.append(ok(_PACKAGES, "installed: %s", some(used - set(served), 20)))
    return found


def _is_own(machine: Machine, packages: PackageList, name: str) -> bool:
    try:
        return any(_OWN in line.encode() for line in machine.lines(
            os.path.join(packages.find(name) or "", "package.xml")))
    except (OSError, UnicodeError):
        return False


def _check_nodes(machine: Machine, packages: PackageList, contents: LaunchContents) -> List[Finding]:
    found, there = [], 0
    for node in contents.nodes:
        level = problem if node.required else warning
        effect = "roslaunch ends" if node.required else "this node does not start, the others do"
        if not packages.find(node.package):
            if node.package not in contents.missing:
                found.append(level(_NODES, "node %s (%s): package %s is missing; %s" % (
                    node.name, node.place, node.package, effect), how_to_get(machine, node.package)))
        elif not _executable(machine, packages, node):
            found.append(level(_NODES, "node %s (%s): package %s has no executable %s; %s" % (
                node.name, node.place, node.package, node.kind, effect), _other_names(machine, packages, node)))
        else:
            wrong = _check_display(machine, packages, node) + _check_words(machine, packages, contents, node)
            found += wrong
            there += not wrong or node.package == "controller_manager"
    return found + ([ok(_NODES, "%d nodes can be started", there)] if there else [])


def _executable(machine: Machine, packages: PackageList, node: NodeEntry) -> bool:
    prefixes = [prefix for prefix in machine.environ.get("CMAKE_PREFIX_PATH", "").split(":") if prefix]
    prefixes += ["/opt/ros/noetic", "/usr"]
    folder = packages.find(node.package) or ""
    places = [os.path.join(prefix, part, node.package, node.kind) for prefix in prefixes for part in ("lib", "share")]
    places += [path for path in machine.below(folder) if os.path.basename(path) == node.kind]
    return any(machine.exists(path) and machine.executable(path) for path in places)


def _other_names(machine: Machine, packages: PackageList, node: NodeEntry) -> str:
    folder = packages.find(node.package) or ""
    for path in machine.below(folder):
        if os.path.basename(path) == node.kind and not machine.executable(path):
            return "chmod +x %s" % path
    if (node.package, node.kind) == ("robot_state_publisher", "state_publisher"):
        return 'write type="robot_state_publisher": the name state_publisher was removed in Noetic'
    return "build the package (make build), or correct type=\"%s\"" % node.kind


def _check_display(machine: Machine, packages: PackageList, node: NodeEntry) -> List[Finding]:
    """Check whether a program with a window has a display; our stand-ins need none."""
    instead = _WINDOWS.get((node.package, node.kind))
    if instead is None or any(machine.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY")) \
            or _is_own(machine, packages, node.package):
        return []
    return [warning(_NODES, "node %s (%s): %s opens a window, and there is no display" % (
        node.name, node.place, node.kind), instead)]


def _check_words(machine: Machine, packages: PackageList, contents: LaunchContents, node: NodeEntry) -> List[Finding]:
    """Check what a node is to load: nodelets, controllers."""
    if node.package == "nodelet" and node.words[:1] in (["load"], ["standalone"]) and len(node.words) > 1:
        wrong = nodelets.fault(machine, packages, node.words[1])
        if wrong:
            return [warning(_NODES, "nodelet %s (%s): %s; it is not loaded" % (node.name, node.place, wrong.what),
                            wrong.cure)]
    if node.package == "controller_manager" and node.kind in ("spawner", "controller_manager"):
        lost = [word for word in node.words if word in contents.types and not packages.find(
            contents.types[word].split("/")[0])]
        return [warning(_NODES, "controller %s (%s): its type %s is not here" % (
            word, node.place, contents.types[word]), how_to_get(machine, contents.types[word].split("/")[0]))
                for word in lost]
    return []


# ---- robots and worlds ---------------------------------------------------------------------------------------------

def check_robot_file(machine: Machine, packages: PackageList, robot: RobotFile) -> List[Finding]:
    """Return the findings on a description.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    packages : PackageList
        Its ROS packages.
    robot : RobotFile
        The file.
    """
    return _check_robot(machine, packages, robot)


def _check_robot(machine: Machine, packages: PackageList, robot: RobotFile) -> List[Finding]:
    report = read_apart("robot", robot.path, robot.arguments, machine.environ)
    if report.error:
        found = []
        names = scan_xacro(robot.path, packages.find)
        for package, place in sorted(names.missing.items()):
            found.append(problem(_ROBOT, "package %s is missing: %s always includes a file of it (%s)" % (
                package, os.path.basename(robot.path), place), how_to_get(machine, package)))
        for package, place in sorted(names.sometimes.items()):
            if package not in names.missing:
                found.append(warning(_ROBOT, "package %s is missing; %s includes a file of it in some cases" % (
                    package, place), how_to_get(machine, package)))
        if not names.missing:
            found.append(problem(_ROBOT, report.error, "correct the description; check it with: xacro %s" % robot.path))
        return found
    return _on_report(_ROBOT, robot.path, report.name, report.plugins, report.left_out, report.notes)


def _on_report(area: str, path: str, name: str, plugins: List[str], left_out: List[str],
               notes: List[str]) -> List[Finding]:
    found = [warning(area, sentence, "the rest of it works; docs/reference/plugins.md lists what there is")
             for sentence in left_out]
    found += [warning(area, note, "the simulator says the same at the spawn") for note in notes[:_MOST_NOTES]]
    if len(notes) > _MOST_NOTES:
        found.append(warning(area, "%d more warnings on %s" % (len(notes) - _MOST_NOTES, path),
                             "spawn it: the log has all of them"))
    return found + [ok(area, "%s (%s) can be used%s", name, path, "; plugins: " + some(plugins, 20) if plugins else "")]


def _check_worlds(machine: Machine, packages: PackageList, contents: LaunchContents) -> List[Finding]:
    found, seen = [], set()
    for node in contents.nodes:
        for word in node.words if (node.package, node.kind) in (
                ("gazebo_ros", "gzserver"), ("gazebo_ros", "debug"), ("gazebo_ros", "gazebo")) else ():
            if not word.endswith((".world", ".sdf")) or word in seen or not_found(word):
                continue
            seen.add(word)
            path = _world_path(machine.environ, packages, word)
            if path is None:
                found.append(problem(_WORLD, "world %s does not exist, named in %s" % (word, node.place),
                                     "give world_name:= an existing file; the empty world is loaded otherwise"))
                continue
            report = read_apart("world", path, {}, machine.environ)
            found += [problem(_WORLD, report.error, "correct the world")] if report.error else _on_report(
                _WORLD, path, report.name, report.plugins, report.left_out, report.notes)
    return found


def _world_path(environ: Dict[str, str], packages: PackageList, name: str) -> Optional[str]:
    folders = [""] + environ.get("GAZEBO_RESOURCE_PATH", "").split(":")
    for package in ("gazebo_ros", "m2wr_sim"):
        folders += [packages.find(package) or "", os.path.join(packages.find(package) or "", "worlds")]
    return next((path for path in (os.path.join(folder, name) for folder in folders) if os.path.isfile(path)), None)

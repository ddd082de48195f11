# SPDX-License-Identifier: BSD-3-Clause
"""Checks whether the right programs, Python modules and packages are installed."""
from __future__ import annotations

from typing import TYPE_CHECKING, Dict, List, Optional
import os

from m2wr_tools.doctor import clients
from m2wr_tools.doctor.finding import ok, problem, some, warning

if TYPE_CHECKING:
    from m2wr_tools.doctor.finding import Finding
    from m2wr_tools.doctor.machine import Machine

_AREA = "installation"
PACKAGES = ("gazebo_msgs", "m2wr_description", "m2wr_files", "m2wr_gmapping", "m2wr_lockstep", "m2wr_maps",
            "m2wr_navigation", "m2wr_node", "m2wr_sim", "m2wr_tools", "m2wr_view", "motion_plan")
NEEDED = {"rospy": "python3-rospy", "numpy": "python3-numpy", "ode": "python3-pyode", "lxml": "python3-lxml",
          "yaml": "python3-yaml", "rospkg": "python3-rospkg", "xacro": "", "tf2_ros": "python3-tf2-ros",
          "PIL": "python3-pil", "cairo": "python3-cairo", "rosbag": "python3-rosbag", "urdf_parser_py": ""}
WANTED = {"numba": ("python3-numba", "the simulation runs several times slower"),
          "matplotlib": ("python3-matplotlib", "no figures"),
          "scipy": ("python3-scipy", "no generated buildings and logs (make_logs)"),
          "trimesh": ("", "no meshes in worlds and robots"), "collada": ("", "no .dae meshes"),
          "dynamic_reconfigure": ("python3-dynamic-reconfigure", "no parameters to change while it runs")}
PROGRAMS = {"roscore": "ros-base", "roslaunch": "ros-base", "rosrun": "rosbash"}
_DEEPEST = 4        # folders of a workspace between its root and a package
_SOURCE = "source devel/setup.bash of the workspace in this shell (and in ~/.bashrc)"


def check(machine: Machine, packages: Optional[PackageList] = None) -> List[Finding]:
    """Return the findings on the installation.

    Parameters
    ----------
    machine : Machine
        The machine to look at.
    packages : PackageList, optional
        Default: that of this machine.
    """
    packages = packages or PackageList(machine)
    found = [_python(machine)]
    found += _foreign_python(machine)
    found += _modules(machine) + _programs(machine)
    found += _workspace(machine, packages)
    if packages.find("m2wr_sim"):
        found += _executables(machine, packages)
        found.append(_kernels(machine, packages))
        found += clients.check(machine, packages)
    return found


class PackageList:
    """Folders of packages, as rospack finds them."""

    def __init__(self, machine: Machine) -> None:
        self._machine, self.fault = machine, ""
        self._places: Dict[str, str] = {}
        self._copies: Optional[Dict[str, List[str]]] = None
        self._roots: List[str] = []
        try:
            import rospkg
            self._roots = rospkg.get_ros_paths(env=machine.environ)      # with the system's
            found = rospkg.RosPack(self._roots)
            self._places = {name: found.get_path(name) for name in found.list()}
        except Exception as error:      # a missing module, an unreadable folder: the checks report it
            self.fault = "%s: %s" % (type(error).__name__, error)

    def roots(self) -> List[str]:
        """Return the folders in which packages are looked for."""
        return list(self._roots)

    def find(self, name: str) -> Optional[str]:
        """Return the folder of a package, or None."""
        return self._places.get(name)

    def copies(self, name: str) -> List[str]:
        """Return the folders of all packages of a name that lie below ROS_PACKAGE_PATH."""
        if self._copies is None:
            self._copies = {}
            for root in self.roots():
                self._walk(root, 1 if root.startswith(("/usr", "/opt")) else _DEEPEST, self._copies)
        return self._copies.get(name, [])

    def sourced(self, name: str) -> Optional[str]:
        """Return the folder of a package in the first sourced workspace that has it; None if none has it."""
        for prefix in self._machine.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
            try:
                with open(os.path.join(prefix, ".catkin")) as stream:
                    sources = [entry for entry in stream.read().split(";") if entry]
            except OSError:
                continue                # not a catkin workspace
            for folder in self.copies(name):
                if any(folder == top or folder.startswith(top + os.sep)
                       for top in map(os.path.realpath, sources or [os.path.join(prefix, "share")])):
                    return folder
        return None

    def _walk(self, folder: str, depth: int, copies: Dict[str, List[str]]) -> None:
        try:
            entries = sorted(os.listdir(folder))
        except OSError:
            return
        if "package.xml" in entries:
            known = copies.setdefault(os.path.basename(folder), [])
            if os.path.realpath(folder) not in known:
                known.append(os.path.realpath(folder))
        elif depth and not {"CATKIN_IGNORE", "AMENT_IGNORE"} & set(entries):
            for entry in entries:
                if not entry.startswith(".") and os.path.isdir(os.path.join(folder, entry)):
                    self._walk(os.path.join(folder, entry), depth - 1, copies)

    def executables(self, name: str) -> List[str]:
        """Return the paths of a package's executables, as rosrun would find them."""
        found = []
        for prefix in self._machine.environ.get("CMAKE_PREFIX_PATH", "").split(":"):
            folder = os.path.join(prefix, "lib", name)
            if prefix and os.path.isdir(folder):
                found += [os.path.join(folder, entry) for entry in sorted(os.listdir(folder))]
        return found


def _python(machine: Machine) -> Finding:
    text = "Python %s (%s)" % (".".join(map(str, machine.version)), machine.python)
    if machine.version < (3, 8):
        return problem(_AREA, text + " is too old", "use Python 3.8 or later: that of Debian 12 or Ubuntu 20.04")
    return ok(_AREA, text)


def _foreign_python(machine: Machine) -> List[Finding]:
    """Check the Python that other scripts would use: ``env python3`` and PYTHONPATH."""
    found = []
    for name in ("python3", "python"):
        first = machine.which(name)
        if first and os.path.realpath(first) != os.path.realpath(machine.python):
            code, _ = machine.run([first, "-c", "import rospy, numpy, yaml"])
            if code != 0:
                found.append(warning(
                    _AREA, "the first %s on PATH is %s, which cannot import rospy" % (name, first),
                    "scripts that begin with \"#!/usr/bin/env %s\" will fail: set /usr/bin first "
                    "(export PATH=/usr/bin:$PATH), or leave the conda or pyenv environment" % name))
    own = "python%d.%d" % machine.version[:2]
    strange = [entry for entry in machine.environ.get("PYTHONPATH", "").split(":")
               if any(part.startswith("python") and part[6:7].isdigit() and part not in (own, "python3")
                      for part in entry.split("/")) or "conda" in entry.lower()]
    if strange:
        found.append(warning(_AREA, "PYTHONPATH holds modules of another Python: %s" % some(strange),
                             "remove them: unset PYTHONPATH, then source the workspace again"))
    return found


def _modules(machine: Machine) -> List[Finding]:
    found = []
    for name, package in NEEDED.items():
        if not machine.has_module(name):
            found.append(problem(_AREA, "Python module %s is missing for %s" % (name, machine.python), _get(package)))
    for name, (package, loss) in WANTED.items():
        if not machine.has_module(name):
            found.append(warning(_AREA, "Python module %s is missing: %s" % (name, loss), _get(package)))
    return found or [ok(_AREA, "%d Python modules are installed", len(NEEDED) + len(WANTED))]


def _get(package: str) -> str:
    return "sudo apt install %s" % package if package else _SOURCE + "; if it is missing then: make setup"


def _programs(machine: Machine) -> List[Finding]:
    found = [problem(_AREA, "%s is not on PATH" % name, "sudo apt install %s" % package)
             for name, package in PROGRAMS.items() if not machine.which(name)]
    return found or [ok(_AREA, "%s are on PATH", some(PROGRAMS))]


def _workspace(machine: Machine, packages: PackageList) -> List[Finding]:
    if packages.fault:
        return [problem(_AREA, "packages cannot be listed: %s" % packages.fault, "sudo apt install python3-rospkg")]
    missing = [name for name in PACKAGES if not packages.find(name)]
    if "m2wr_sim" in missing:
        return [problem(_AREA, "the workspace is not sourced: rospack does not find %s" % some(missing), _SOURCE)]
    found = []
    if missing:
        found.append(problem(_AREA, "rospack does not find %s" % some(missing), "make build, then " + _SOURCE))
    for root in packages.roots():
        if not machine.exists(root):
            found.append(warning(_AREA, "ROS_PACKAGE_PATH names %s, which does not exist" % root,
                                 "a workspace was moved or deleted: in a new shell, source only what is there"))
    for name in PACKAGES:
        copies = packages.copies(name)
        sourced = packages.sourced(name)
        used = packages.find(name)
        if sourced and used and sourced != os.path.realpath(used):
            found.append(problem(
                _AREA, "there are two packages %s: ROS_PACKAGE_PATH finds %s first, the sourced workspaces have %s; "
                "roslaunch ends with \"multiple files named\" where both have a file of one name" % (
                    name, used, sourced),
                "give yours another name (in package.xml, and where it is used); or build it with catkin in a "
                "workspace of its own with this one sourced, and source that one's devel/setup.bash, instead of "
                "setting ROS_PACKAGE_PATH"))
        elif len(copies) > 1:
            found.append(warning(
                _AREA, "package %s exists %d times; %s is used, %s is shadowed" % (
                    name, len(copies), used, some(path for path in copies if path != os.path.realpath(used or ""))),
                "source one workspace only, in a new shell, or delete the other copy"))
    for name, level in (("robot_state_publisher", problem), ("xacro", problem), ("rviz", warning)):
        if not packages.find(name):
            found.append(level(_AREA, "package %s is not found" % name, "make setup, or sudo apt install %s" % (
                {"robot_state_publisher": "ros-robot-state-publisher", "rviz": "rviz"}.get(name, name))))
    return found or [ok(_AREA, "the workspace is sourced: %s", packages.find("m2wr_sim"))]


def _executables(machine: Machine, packages: PackageList) -> List[Finding]:
    """Check what rosrun needs: the executable bit, and line ends that the kernel understands."""
    found, count = [], 0
    for name in PACKAGES:
        for path in packages.executables(name):
            first = machine.first_line(path)
            if not first.startswith((b"#!", b"\x7fELF")):
                continue                # a file that tools leave there
            count += 1
            if not machine.executable(path):
                found.append(problem(_AREA, "%s is not executable, so rosrun does not find it" % path,
                                     "chmod +x %s" % path))
            elif first.startswith(b"#!") and first.endswith(b"\r\n"):
                found.append(problem(_AREA, "%s has Windows line endings: the system looks for \"python3\\r\"" % path,
                                     "sed -i 's/\\r$//' %s" % path))
    if not count:
        return [problem(_AREA, "there are no executables: the workspace is not built", "make build, then " + _SOURCE)]
    return found or [ok(_AREA, "%d executables found", count)]


def _kernels(machine: Machine, packages: PackageList) -> Finding:
    """Check that compiled kernels are kept, so that not every start compiles."""
    if not machine.has_module("numba"):
        return ok(_AREA, "numba is not installed: no kernels to compile")
    import m2wr_sim
    folder = packages.find("m2wr_sim") or ""
    kept = [path for place in m2wr_sim.__path__ for path in machine.below(place) if path.endswith(".nbi")]
    if not kept and machine.writable(folder):
        return warning(_AREA, "no compiled kernels yet: the first start takes up to a minute",
                       "nothing to do, or now: %s -m m2wr_sim.warm_up" % machine.python)
    if not kept and not machine.environ.get("NUMBA_CACHE_DIR") and not machine.writable(
            os.path.join(machine.environ.get("HOME", "/"), ".cache", "numba")):
        return warning(_AREA, "compiled kernels cannot be stored: neither %s nor ~/.cache is writable" % folder,
                       "set NUMBA_CACHE_DIR to a writable folder")
    return ok(_AREA, "%d compiled kernels are cached", len(kept)) if kept else ok(
        _AREA, "compiled kernels are stored in a folder of the user")

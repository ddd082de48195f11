# SPDX-License-Identifier: BSD-3-Clause
"""A program under test with limits: processor time, memory, processes, files, and a folder of its own.

What is contained and what is not is told in SECURITY.md. Three means work together: limits of the kernel for each
process, a namespace in which all its processes end together, and a look at the sums every LOOK_EVERY seconds. If this
process is root, the program runs as a user without rights.
"""
from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
import xml.etree.ElementTree as ElementTree
from dataclasses import dataclass
from functools import lru_cache
from typing import Dict, List, Optional, Sequence, Tuple

from m2wr_campaign.programs.warden import descendants, end_all
from m2wr_campaign.study.programs import Program, files_of

LOOK_EVERY = 0.25           # s between two looks at sums
FIRST_USER, USERS = 61184, 4000         # numbers for users without an account, as systemd takes them
SPARE = 10                  # processes by which the kernel's limit is above ours, so that it is noticed
LOG_TAIL = 8000             # bytes
ENDING = 10.0               # s
_PASSED_ON = ("PATH", "LANG", "LC_ALL", "LD_LIBRARY_PATH", "PYTHONPATH", "ROS_DISTRO", "ROS_ETC_DIR", "ROS_ROOT",
              "ROS_VERSION", "ROS_PYTHON_VERSION", "ROS_PACKAGE_PATH", "CMAKE_PREFIX_PATH")
_ONE_THREAD = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


@dataclass(frozen=True)
class Limits:
    """What a program may use.

    Attributes
    ----------
    cpu : float
        Processor time of all its processes together [s].
    memory : int
        Of all its processes together, resident [bytes].
    address_space : int
        Of each process [bytes].
    file_size, disk : int
        Of each file, and of all files of its folder [bytes].
    processes : int
        Processes and threads.
    """

    cpu: float = 300.0
    memory: int = 2_000_000_000
    address_space: int = 8_000_000_000
    file_size: int = 20_000_000
    disk: int = 100_000_000
    processes: int = 300


class ContainedProgram:
    """A program that runs in a copy of its package, until :meth:`end`.

    Parameters
    ----------
    program : Program
    arguments : sequence of (str, str)
        Of the launch file, or private parameters.
    master : str
        Address of the ROS master.
    limits : Limits, optional
    """

    def __init__(self, program: Program, arguments: Sequence[Tuple[str, str]], master: str,
                 limits: Optional[Limits] = None) -> None:
        self.limits = limits or Limits()
        self.problem = ""           # a limit that it has passed
        self.cpu = 0.0              # s, at the last look
        self.place = os.path.realpath(tempfile.mkdtemp(prefix="m2wr_program_"))
        self._user = FIRST_USER + os.getpid() % USERS if os.getuid() == 0 else 0
        self._ended = threading.Event()
        self._process: Optional[subprocess.Popen[bytes]] = None
        try:
            self._start(program, arguments, master)
        except BaseException:
            self.end()
            raise
        self._watch = threading.Thread(target=self._look, daemon=True)
        self._watch.start()

    def _start(self, program: Program, arguments: Sequence[Tuple[str, str]], master: str) -> None:
        package = os.path.join(self.place, "package", os.path.basename(program.folder))
        _copy(program.folder, package)
        path = os.path.join(package, os.path.relpath(program.path, program.folder))
        for name in ("home", "tmp", "bin"):
            os.makedirs(os.path.join(self.place, name))
        for name in ("python", "python3"):
            os.symlink(sys.executable, os.path.join(self.place, "bin", name))
        _make_prefix(package, os.path.join(self.place, "prefix"))
        if path.endswith(".launch"):
            command = ["roslaunch", path] + ["{}:={}".format(*pair) for pair in arguments]
        else:
            command = [sys.executable, path] + ["_{}:={}".format(*pair) for pair in arguments]
        spec = {"command": command, "environment": self._environment(package, master), "folder": package,
                "user": self._user, "nice": 5, "limits": self._kernel_limits(), "private": bool(namespace()),
                "place": self.place, "size": self.limits.disk}
        if self._user:
            for here, _, names in os.walk(self.place):
                for name in [here] + [os.path.join(here, name) for name in names]:
                    os.lchown(name, self._user, self._user)
        told = os.path.join(self.place, "specification.json")
        with open(told, "w", encoding="utf-8") as file:
            json.dump(spec, file)
        os.chmod(told, 0o600)
        self.log = open(os.path.join(self.place, "output"), "w+b")
        os.chmod(self.log.name, 0o600)
        words = ["setpriv", "--pdeathsig", "KILL"] if shutil.which("setpriv") else []
        self._process = subprocess.Popen(
            words + namespace() + [sys.executable, "-m", "m2wr_campaign.programs.warden", told],
            stdin=subprocess.DEVNULL, stdout=self.log, stderr=self.log, start_new_session=True)

    def _environment(self, package: str, master: str) -> Dict[str, str]:
        """Return the variables that the program sees: those of ROS, and no others of this user."""
        found = {name: os.environ[name] for name in _PASSED_ON if name in os.environ}
        found.update((name, "1") for name in _ONE_THREAD)
        found.update(
            ROS_MASTER_URI=master, ROS_IP="127.0.0.1", HOME=os.path.join(self.place, "home"),
            ROS_HOME=os.path.join(self.place, "home", ".ros"), TMPDIR=os.path.join(self.place, "tmp"),
            PYTHONUNBUFFERED="1", PYTHONDONTWRITEBYTECODE="1",
            PATH=os.path.join(self.place, "bin") + ":" + found.get("PATH", "/usr/bin:/bin"),
            ROS_PACKAGE_PATH=package + ":" + found.get("ROS_PACKAGE_PATH", ""),
            CMAKE_PREFIX_PATH=os.path.join(self.place, "prefix") + ":" + found.get("CMAKE_PREFIX_PATH", ""),
            PYTHONPATH=os.path.join(package, "src") + ":" + found.get("PYTHONPATH", ""))
        return found

    def _kernel_limits(self) -> Dict[str, int]:
        limits = self.limits
        others = 0 if self._user else _tasks_of(os.getuid())     # the kernel counts those of the user
        return {"RLIMIT_CPU": int(limits.cpu) + 1, "RLIMIT_AS": limits.address_space, "RLIMIT_CORE": 0,
                "RLIMIT_FSIZE": limits.file_size, "RLIMIT_NPROC": limits.processes + others + SPARE,
                "RLIMIT_NOFILE": 1024}

    def running(self) -> bool:
        """Return whether the program has not ended yet."""
        return self._process is not None and self._process.poll() is None

    def exit_code(self) -> Optional[int]:
        """Return how the program ended, None while it runs."""
        return self._process.poll() if self._process is not None else None

    def tail(self) -> str:
        """Return the end of what it wrote."""
        self.log.flush()
        size = os.fstat(self.log.fileno()).st_size
        return os.pread(self.log.fileno(), LOG_TAIL, max(0, size - LOG_TAIL)).decode("utf-8", "replace")

    def _look(self) -> None:
        """Watch the sums until the end."""
        while not self._ended.wait(LOOK_EVERY) and self.running():
            self.problem = self._passed()
            if self.problem:
                self._kill()

    def _passed(self) -> str:
        """Return the limit that is passed, in a sentence; empty if none is."""
        assert self._process is not None
        limits = self.limits
        cpu, memory, tasks = _sums(descendants(self._process.pid))
        self.cpu = max(self.cpu, cpu)
        for value, most, what, unit in ((self.cpu, limits.cpu, "processor time", "s"),
                                        (memory, limits.memory, "memory", "bytes"),
                                        (tasks, limits.processes, "processes and threads", ""),
                                        (_size(self.place, limits.disk), limits.disk, "files", "bytes")):
            if value > most:
                return "the program used more than {:g} {} of {}".format(most, unit, what).replace("  ", " ")
        return ""

    def _kill(self) -> None:
        """Kill all its processes."""
        if self._process is None:
            return
        if not namespace() and self._process.poll() is None:
            self._process.send_signal(signal.SIGTERM)           # it kills all that it has adopted
            try:
                self._process.wait(ENDING)
            except subprocess.TimeoutExpired:
                pass
        below = descendants(self._process.pid)
        self._process.kill()
        for process in below:
            try:
                os.kill(process, signal.SIGKILL)
            except OSError:
                pass
        self._process.wait()
        if self._user:
            _end_user(self._user)

    def end(self) -> None:
        """Kill it, and remove its folder."""
        self._ended.set()
        self._kill()
        if self._process is not None:
            self.log.close()
        shutil.rmtree(self.place, ignore_errors=True)


@lru_cache(maxsize=1)
def namespace() -> List[str]:
    """Return the words before a command by which all its processes end with it; none if the kernel refuses."""
    for words in (["unshare", "--mount", "--pid", "--fork", "--kill-child"],
                  ["unshare", "--user", "--map-root-user", "--mount", "--pid", "--fork", "--kill-child"]):
        if os.getuid() != 0 and "--user" not in words:
            continue
        try:
            if subprocess.run(words + ["true"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              timeout=ENDING, check=False).returncode == 0:
                return words
        except (OSError, subprocess.TimeoutExpired):
            pass
    return []


def _copy(folder: str, to: str) -> None:
    """Copy the regular files of a package; scripts may be executed in the copy."""
    for path in files_of(folder):
        target = os.path.join(to, os.path.relpath(path, folder))
        os.makedirs(os.path.dirname(target), exist_ok=True)
        shutil.copyfile(path, target)
        with open(path, "rb") as file:
            executable = file.read(2) == b"#!" or os.access(path, os.X_OK)
        os.chmod(target, 0o755 if executable else 0o644)


def _make_prefix(package: str, prefix: str) -> None:
    """Make a prefix of catkin in which the programs of a package are found before others of the same name."""
    try:
        name = (ElementTree.parse(os.path.join(package, "package.xml")).getroot().findtext("name") or "").strip()
    except (OSError, ElementTree.ParseError):
        return
    if not name.replace("_", "").replace("-", "").isalnum():
        return
    library = os.path.join(prefix, "lib", name)
    os.makedirs(library)
    os.makedirs(os.path.join(prefix, "share"))
    os.symlink(package, os.path.join(prefix, "share", name))
    with open(os.path.join(prefix, ".catkin"), "w", encoding="utf-8"):
        pass
    for path in files_of(package):
        link = os.path.join(library, os.path.basename(path))
        if os.access(path, os.X_OK) and not os.path.lexists(link):
            os.symlink(path, link)


def _sums(processes: Sequence[int]) -> Tuple[float, int, int]:
    """Return processor time [s], resident memory [bytes] and threads of some processes."""
    ticks, page = os.sysconf("SC_CLK_TCK"), os.sysconf("SC_PAGE_SIZE")
    cpu = pages = tasks = 0
    for process in processes:
        try:
            with open("/proc/{}/stat".format(process), encoding="utf-8", errors="replace") as file:
                words = file.read().rsplit(")", 1)[1].split()
        except (OSError, IndexError):
            continue
        cpu += sum(map(int, words[11:15]))
        pages, tasks = pages + int(words[21]), tasks + int(words[17])
    return cpu / ticks, pages * page, tasks


def _size(folder: str, enough: int) -> int:
    """Return the size of all files of a folder [bytes], at least when it is more than enough."""
    total = 0
    for here, _, names in os.walk(folder):
        total += 4096
        for name in names:
            try:
                total += os.lstat(os.path.join(here, name)).st_blocks * 512
            except OSError:
                pass
        if total > enough:
            break
    return total


def _tasks_of(user: int) -> int:
    """Return how many threads a user has."""
    total = 0
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                if os.stat("/proc/" + name).st_uid == user:
                    total += len(os.listdir("/proc/{}/task".format(name)))
            except OSError:
                pass
    return total


def _end_user(user: int) -> None:
    """Kill what a user without an account has left."""
    until = time.monotonic() + ENDING
    while time.monotonic() < until:
        left = []
        for name in os.listdir("/proc"):
            try:
                if name.isdigit() and os.stat("/proc/" + name).st_uid == user:
                    left.append(int(name))
            except OSError:
                pass
        if not left:
            return
        for process in left:
            try:
                os.kill(process, signal.SIGKILL)
            except OSError:
                pass
        time.sleep(0.01)


__all__ = ["ContainedProgram", "Limits", "end_all", "namespace"]

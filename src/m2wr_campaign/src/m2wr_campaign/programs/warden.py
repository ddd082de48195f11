# SPDX-License-Identifier: BSD-3-Clause
"""The process above a program under test: it gives it limits, and when either ends, nothing of the program is left.

It runs as ``python3 -m m2wr_campaign.programs.warden SPECIFICATION``. In a process namespace it is the first process:
the kernel kills all others with it. Otherwise it adopts whatever the program leaves behind, and kills it.
"""
from __future__ import annotations

import ctypes
import json
import os
import resource
import signal
import sys
from typing import Any, Dict, List

_SET_DEATH_SIGNAL, _SET_SUBREAPER = 1, 36       # of prctl(2)
_READ_ONLY, _REMOUNT, _BIND, _RECURSIVE, _PRIVATE = 1, 32, 4096, 16384, 1 << 18      # of mount(2)
_FLAGS = {"nosuid": 2, "nodev": 4, "noexec": 8, "noatime": 1024, "nodiratime": 2048, "relatime": 1 << 21}
_ROUNDS = 200               # in which processes are killed that may start others


def descendants(parent: int) -> List[int]:
    """Return the processes below one, as far as they can be seen."""
    children: Dict[int, List[int]] = {}
    for name in os.listdir("/proc"):
        if name.isdigit():
            try:
                with open("/proc/{}/stat".format(name), encoding="utf-8", errors="replace") as file:
                    above = int(file.read().rsplit(")", 1)[1].split()[1])
            except (OSError, IndexError, ValueError):
                continue
            children.setdefault(above, []).append(int(name))
    found, waiting = [], [parent]
    while waiting:
        below = children.get(waiting.pop(), [])
        found += below
        waiting += below
    return found


def end_all(parent: int) -> None:
    """Kill all processes below one, also those that they start meanwhile."""
    for _ in range(_ROUNDS):
        found = descendants(parent)
        for number in (signal.SIGSTOP, signal.SIGKILL):         # what is stopped starts no other
            for process in found:
                try:
                    os.kill(process, number)
                except OSError:
                    pass
        try:
            while os.waitpid(-1, os.WNOHANG) != (0, 0):
                pass
        except ChildProcessError:
            pass
        if not found:
            return


def hide(place: str, size: int) -> None:
    """Make all files read-only for this namespace, and give it temporary folders of its own.

    Parameters
    ----------
    place : str
        Folder that stays writable.
    size : int
        Of each temporary folder [bytes].
    """
    mount = ctypes.CDLL(None, use_errno=True).mount

    def mounted(source: str, target: str, kind: str, flags: int, options: str = "") -> bool:
        return mount(source.encode(), target.encode(), kind.encode(), ctypes.c_ulong(flags), options.encode()) == 0

    mounted("none", "/", "", _RECURSIVE | _PRIVATE)
    mounted(place, place, "", _BIND)
    kept = os.open(place, os.O_PATH)
    with open("/proc/self/mountinfo", encoding="utf-8", errors="replace") as file:
        mounts = [line.split() for line in file]
    for words in mounts:
        target = words[4].encode().decode("unicode_escape")
        if target != place and not target.startswith(("/proc", "/dev")):
            flags = sum(_FLAGS.get(word, 0) for word in words[5].split(","))
            mounted("none", target, "", _BIND | _REMOUNT | _READ_ONLY | flags)
    for folder in ("/tmp", "/var/tmp", "/dev/shm"):
        mounted("tmpfs", folder, "tmpfs", _FLAGS["nosuid"] | _FLAGS["nodev"], "size={},mode=1777".format(size))
    os.makedirs(place, exist_ok=True)
    mounted("/proc/self/fd/{}".format(kept), place, "", _BIND)
    os.close(kept)


def _become(spec: Dict[str, Any]) -> None:
    """Take on the limits and the user of a specification; in the process of the program."""
    os.setsid()
    for name, value in spec["limits"].items():
        number = getattr(resource, name)
        hard = resource.getrlimit(number)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        resource.setrlimit(number, (value, value))
    os.nice(int(spec["nice"]))
    if spec["user"]:
        os.setgroups([])
        os.setgid(spec["user"])
        os.setuid(spec["user"])
    ctypes.CDLL(None).prctl(_SET_DEATH_SIGNAL, signal.SIGKILL)
    os.chdir(spec["folder"])


def _end(*_: Any) -> None:
    """Kill all processes below, and end; on a signal."""
    end_all(os.getpid())
    os._exit(1)


def main() -> int:
    """Run the program of a specification; return its exit code, negative for a signal."""
    with open(sys.argv[1], encoding="utf-8") as file:
        spec = json.load(file)
    ctypes.CDLL(None).prctl(_SET_SUBREAPER, 1)
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
        signal.signal(number, _end)
    child = os.fork()
    if child == 0:
        try:
            if spec["private"]:
                hide(spec["place"], spec["size"])
            _become(spec)
            os.execvpe(spec["command"][0], spec["command"], spec["environment"])
        except BaseException as error:
            print("the program cannot be started: {}".format(error), file=sys.stderr, flush=True)
        os._exit(127)
    while True:
        ended, status = os.wait()
        if ended == child:
            break
    end_all(os.getpid())
    return os.WEXITSTATUS(status) if os.WIFEXITED(status) else 128 + os.WTERMSIG(status)


if __name__ == "__main__":
    sys.exit(main())

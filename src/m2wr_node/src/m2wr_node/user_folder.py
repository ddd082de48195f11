# SPDX-License-Identifier: BSD-3-Clause
"""The user's working folder, for file names that are relative to it.

roslaunch starts nodes in another folder. ``PWD`` in the environment does not help: a shell has written it, and
``make -C``, ``sudo``, ``env -C`` and programs that start another one in another folder do not change it.
"""
from __future__ import annotations

import os
import sys
from typing import Optional, Sequence


def user_folder(words: Optional[Sequence[str]] = None) -> str:
    """Return the absolute path of the folder in which the user started this program or the roslaunch that did.

    Call it at the start, while roslaunch is running.

    Parameters
    ----------
    words : list of str, optional
        The command line, by default this program's.
    """
    if any(word.startswith("__log:=") for word in (sys.argv if words is None else words)):      # by roslaunch alone
        found = _folder_of(starter())
        if found:
            return found
        if os.path.isdir(os.environ.get("PWD", "")):        # no /proc, or not readable
            return os.path.abspath(os.environ["PWD"])
    return os.getcwd()


def from_user(path: str, words: Optional[Sequence[str]] = None) -> str:
    """Return the absolute path of a file named by the user.

    Parameters
    ----------
    path : str
        As the user gave it; ``~`` is the home. The empty path stays empty.
    words : list of str, optional
        The command line, by default this program's.
    """
    return os.path.normpath(os.path.join(user_folder(words), os.path.expanduser(path))) if path else path


def starter() -> int:
    """Return the number of the process that began the session.

    roslaunch gives each node a session, also below a ``launch-prefix``; started by it, this is roslaunch.
    """
    leader = os.getsid(0)
    return os.getppid() if leader == os.getpid() else _parent(leader)


def _parent(process: int) -> int:
    try:
        with open("/proc/%d/stat" % process, "rb") as stream:
            return int(stream.read().rpartition(b")")[2].split()[1])       # the name before may hold anything
    except (OSError, ValueError, IndexError):
        return 0


def _folder_of(process: int) -> Optional[str]:
    try:
        found = os.readlink("/proc/%d/cwd" % process)
    except OSError:
        return None
    return found if os.path.isdir(found) else None

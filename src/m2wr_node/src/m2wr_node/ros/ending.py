# SPDX-License-Identifier: BSD-3-Clause
"""Ending a run without an error message of roslaunch.

roslaunch reports a required node that exits in a red banner, "REQUIRED process has died!", whatever the exit code.  A
node that has done its work asks its roslaunch to stop instead, by the signal that Ctrl-C sends.
"""
from __future__ import annotations

import os
import signal
import xmlrpc.client
from typing import Any, Callable, Iterator, List, Optional

import rosgraph
import rosgraph.network

from m2wr_node.ros.is_there import PatientTransport

_ME = "/end_run"


def ancestry(pid: Optional[int] = None, parent_of: Optional[Callable[[int], int]] = None) -> List[int]:
    """Return the process ids of a process and its ancestors, nearest first.

    Parameters
    ----------
    pid : int, optional
        Where to begin; this process by default.
    parent_of : callable, optional
        Process id -> that of its parent, 0 where there is none; by default as /proc tells.
    """
    pid, parent_of = os.getpid() if pid is None else pid, parent_of or _parent_of
    found = []
    while pid > 0 and pid not in found:
        found.append(pid)
        pid = parent_of(pid)
    return found


def _parent_of(pid: int) -> int:
    try:
        with open("/proc/%d/stat" % pid) as file:
            return int(file.read().rpartition(")")[2].split()[1])       # the name in brackets may hold anything
    except (OSError, ValueError, IndexError):
        return 0


def _addresses(master: Any) -> Iterator[str]:
    """Yield the XML-RPC addresses that roslaunch processes of this machine have left on the parameter server."""
    try:
        uris = master.getParam("/roslaunch/uris")
    except (rosgraph.MasterException, OSError, xmlrpc.client.Error):
        return
    for uri in uris.values() if isinstance(uris, dict) else ():
        try:
            if rosgraph.network.is_local_address(rosgraph.network.parse_http_host_and_port(uri)[0]):
                yield uri
        except (ValueError, TypeError, AttributeError, OSError):
            continue


def _required(server: Any, name: str, ids: List[int]) -> bool:
    try:
        info = server.process_info(name)[2]
    except xmlrpc.client.Fault:         # XML-RPC cannot encode what roslaunch returns for its master
        return False
    return bool(info.get("required")) and info.get("pid") in ids


def roslaunch_that_requires(ids: List[int], master: Any = None) -> Optional[int]:
    """Return the process id of the roslaunch that started one of these processes as a required node, or None.

    Parameters
    ----------
    ids : list of int
        A process and its ancestors, as :func:`ancestry` returns them; roslaunch must be one of them.
    master : rosgraph.Master, optional
    """
    for uri in _addresses(master or rosgraph.Master(_ME)):
        server: Any = xmlrpc.client.ServerProxy(uri, transport=PatientTransport())
        try:
            parent = server.get_pid()[2]
            if parent not in ids:
                continue
            below = ids[:ids.index(parent)]
            if any(_required(server, name, below) for name in server.get_node_names()[2]):
                return parent
        except (OSError, xmlrpc.client.Error, LookupError, TypeError, AttributeError):
            continue                    # roslaunch has ended, or another program has its port
    return None


def end_run(master: Any = None, kill: Callable[[int, int], object] = os.kill) -> bool:
    """Ask the roslaunch that requires this process to stop, and return whether one was asked.

    It then ends all of its nodes, this one too, so the caller waits for its own signal.

    Parameters
    ----------
    master : rosgraph.Master, optional
    kill : callable
        Sends a signal to a process, as ``os.kill``.

    Returns
    -------
    bool
    """
    parent = roslaunch_that_requires(ancestry(), master)
    if parent is None:
        return False
    try:
        kill(parent, signal.SIGINT)
    except OSError:
        return False
    return True

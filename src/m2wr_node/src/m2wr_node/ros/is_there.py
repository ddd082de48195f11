# SPDX-License-Identifier: BSD-3-Clause
"""Whether a node or the publisher of a topic is alive: for launch files that run with or without a simulation.

is_there NAME                   print true or false
is_there NAME --print YES NO    print one of two words, with no end of line: a parameter of a launch file keeps it
is_there NAME --else COMMAND    run a command unless it is there
"""
from __future__ import annotations

import os
import socket
import sys
import xmlrpc.client
from typing import Any, Callable, List, Optional, Sequence

import rosgraph

_PATIENCE = 2.0         # s for a node to answer; one that was killed leaves its name behind
_ME = "/is_there"


class PatientTransport(xmlrpc.client.Transport):
    """Waits for an answer only so long.

    Parameters
    ----------
    patience : float
        Time limit of each step of a call [s].
    """

    def __init__(self, patience: float = _PATIENCE) -> None:
        super().__init__()
        self._patience = patience

    def make_connection(self, host: Any) -> Any:
        connection = super().make_connection(host)
        connection.timeout = self._patience
        return connection


def alive(address: str, name: Optional[str] = None) -> bool:
    """Return whether a node answers at the address of its XML-RPC server.

    With ``name``: a node of that name, as far as it can be asked.  A master remembers the addresses of nodes of rospy
    after they have ended, and another node may have got the port since.

    Parameters
    ----------
    address : str
        URI of the XML-RPC server.
    name : str, optional
        Name of the node, with its leading slash.
    """
    node: Any = xmlrpc.client.ServerProxy(address, transport=PatientTransport())
    try:
        try:
            if name is not None:
                return node.getName(_ME)[::2] == [1, name]
        except xmlrpc.client.Fault:
            pass                        # a node of roscpp, which has no such call
        return node.getPid(_ME)[0] == 1
    except (OSError, xmlrpc.client.Error, ValueError):
        return False


def who_is_there(name: str, master: Any = None, answers: Callable[[str, str], bool] = alive) -> Optional[str]:
    """Return the node of this name, or one that publishes the topic of this name, if it answers; otherwise None.

    Parameters
    ----------
    name : str
        With its leading slash.
    master : rosgraph.Master, optional
    answers : callable
        As :func:`alive`.
    """
    master = master or rosgraph.Master(_ME)
    try:
        publishers = dict(master.getSystemState()[0])
        for node in [name] + publishers.get(name, []):
            try:
                if answers(master.lookupNode(node), node):
                    return node
            except rosgraph.MasterError:
                continue            # no node of that name
    except (rosgraph.MasterException, socket.error):
        pass                        # no master, so nothing is there
    return None


def main(words: Optional[Sequence[str]] = None, execute: Callable[[str, List[str]], object] = os.execvp) -> int:
    """Entry point.

    Parameters
    ----------
    words : list of str, optional
        The arguments, by default this program's.
    execute : callable
        Replaces the process by a command, as ``os.execvp``.

    Returns
    -------
    int
        Exit code, 2 for wrong usage.
    """
    words = sys.argv[1:] if words is None else list(words)
    name, action, rest = "".join(words[:1]), "".join(words[1:2]), words[2:]
    if not name.startswith("/") or not (action == "" or action == "--print" and len(rest) == 2
                                        or action == "--else" and rest):
        sys.stderr.write("is_there: %s\n\n%s" % (" ".join(words) or "no words", __doc__))
        return 2
    found = who_is_there(name)
    if action == "--else":
        if found is None:
            execute(rest[0], rest)
        # the program that is spared: not its interpreter, nor what it is told
        spared = [word for word in map(os.path.basename, rest)
                  if not word.startswith(("-", "python")) and ":=" not in word] or rest
        sys.stderr.write("%s is there already, by %s: %s is not started\n" % (name, found, spared[0]))
        return 0
    sys.stdout.write(rest[0 if found else 1] if rest else "true\n" if found else "false\n")
    return 0

# SPDX-License-Identifier: BSD-3-Clause
"""Starting a node so that signals always end it."""
from __future__ import annotations

import errno
import http.client
import os
import signal
import socket
import sys
import threading
import time
from typing import Any, Callable, List, Optional, Tuple

import rosgraph
import rosgraph.network
import rosgraph.rosenv
import rospy
from rospy.impl import registration

from m2wr_node.ros.acceptor import accept_side_by_side

LOOK = 0.2              # between two looks for a master [s], wall
PATIENCE = 2.0          # a master that is there takes a connection within that time [s], wall
STUCK = 2.0             # after so long [s], wall, a second signal ends a node whose shutdown does not get on
_GONE = (ConnectionError, http.client.HTTPException, rospy.exceptions.ROSInitException)      # what its end ends in
_registered = threading.Event()


def shut_down_beside() -> None:
    """Let SIGINT, SIGTERM and, where nohup does not ignore it, SIGHUP shut ROS down on a thread of its own.

    rospy does it inside the signal, on the thread that may be publishing, or registering, at that very moment and then
    waits for ever for a lock that it holds itself.  Where even the thread hangs, as on a master that takes calls and
    does not answer, the next signal ends the process.
    """
    begun: List[float] = []

    def on_signal(number: int, _: Any) -> None:
        if not begun:
            begun.append(time.monotonic())
            threading.Thread(target=rospy.signal_shutdown, args=("signal-%d" % number,)).start()
        elif not rospy.core.is_shutdown() and time.monotonic() - begun[0] > STUCK:
            _end_by(number)

    _handle_signals(on_signal)


def note_signals() -> List[int]:
    """Let the same signals only be noted, in the list returned, for a node that has to end in its own good time.

    One that hangs while it is being registered has begun nothing yet: there, too, the next signal ends the process.
    """
    noted, begun = [], []

    def on_signal(number: int, _: Any) -> None:
        noted.append(number)
        begun.append(time.monotonic())
        if not _registered.is_set() and begun[-1] - begun[0] > STUCK:
            _end_by(number)

    _handle_signals(on_signal)
    return noted


def _end_by(number: int) -> None:
    signal.signal(number, signal.SIG_DFL)
    os.kill(os.getpid(), number)


def _handle_signals(handler: Callable[[int, Any], object]) -> None:
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:
            signal.signal(number, handler)


def _master() -> Tuple[str, Tuple[str, int]]:
    """Return the master's URI as rospy takes it, and its (host, port); ValueError if it is no address."""
    uri = rosgraph.get_master_uri() or rosgraph.rosenv.DEFAULT_MASTER_URI
    try:
        address = rosgraph.network.parse_http_host_and_port(uri)
        address[0].encode("idna")
    except ValueError as error:
        raise ValueError("ROS_MASTER_URI is %r (%s); expected http://HOST:PORT" % (uri, error)) from error
    return uri, address


def _takes_connections(address: Tuple[str, int]) -> bool:
    try:
        socket.create_connection(address, PATIENCE).close()
        return True
    except (OSError, OverflowError):
        return False


def wait_for_master(name: str, asked: Callable[[], bool] = rospy.core.is_shutdown_requested) -> None:
    """Return once the master takes connections; exits with 1 if ``asked()``, whether the node is to end, comes before.

    rospy waits as well, but with a lock held that its own end needs: who had forgotten roscore could not stop it.
    Exits with 1, too, where ROS_MASTER_URI is no address: rospy would try it for ever.

    Parameters
    ----------
    name : str
        Name of the node, for messages.
    asked : callable
        Returns whether the node is to end.
    """
    try:
        uri, address = _master()
    except ValueError as error:
        sys.stderr.write("%s: %s\n" % (name, error))
        sys.exit(1)
    told = False
    while not asked():
        if _takes_connections(address):
            return
        if not told:
            sys.stderr.write("%s: no master answers at %s yet; waiting for roscore or roslaunch\n" % (name, uri))
            sys.stderr.flush()
        told = True
        time.sleep(LOOK)
    sys.exit(1)


def master_gone(error: BaseException) -> Optional[str]:
    """Return a sentence if an error came of a master that is there no more, else None."""
    uri, address = _master()
    if not isinstance(error, _GONE) or _takes_connections(address):
        return None
    return "the master at %s has gone (%s: %s)" % (uri, type(error).__name__, error)


def _tell_of_master(name: str) -> None:
    """Let an error that ends the program be told in one sentence, where it came of a master that has gone."""
    otherwise = sys.excepthook

    def tell(kind: Any, error: Any, trace: Any) -> None:
        sentence = master_gone(error)
        if sentence is None:
            otherwise(kind, error, trace)
        else:
            sys.stderr.write("%s: %s\n" % (name, sentence))

    sys.excepthook = tell


def _hush_closed_sockets() -> None:
    """Let a thread of rospy that looks at its socket just when the shutdown has closed it end without a traceback."""
    otherwise = threading.excepthook

    def tell(words: Any) -> None:
        closed = isinstance(words.exc_value, OSError) and words.exc_value.errno == errno.EBADF
        if not (closed and rospy.core.is_shutdown_requested()):
            otherwise(words)

    threading.excepthook = tell


def register(name: str, asked: Callable[[], bool] = rospy.core.is_shutdown_requested, **options: Any) -> None:
    """Register the node ``name``, with options of ``rospy.init_node``; whoever calls has seen to the signals.

    Exits with 1 if the node is told to end meanwhile.  A master that goes, then or later, is told in one sentence
    where the error of it ends the program.

    Parameters
    ----------
    name : str
    asked : callable
        Tells whether the node is to end.  From then on, for the whole life of the node, nothing is registered with the
        master any more: rospy tries a master that is gone again and again until it has shut down, with a lock held that
        its shutdown needs.
    **options
    """
    wait_for_master(name, asked)
    _tell_of_master(name)
    _hush_closed_sockets()
    registration.is_shutdown = asked
    try:
        rospy.init_node(name, disable_signals=True, **options)
    except Exception:                   # of whatever kind: what it was doing was closed under it
        if not asked():
            raise
        sys.exit(1)
    _registered.set()
    accept_side_by_side()


def start_node(name: str, **options: Any) -> None:
    """Register the node ``name``, with options of ``rospy.init_node``; exits with 1 if it is interrupted meanwhile."""
    shut_down_beside()
    register(name, **options)

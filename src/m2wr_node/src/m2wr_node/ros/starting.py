# SPDX-License-Identifier: BSD-3-Clause
"""Starting a node that signals can always end."""
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

from m2wr_node.internals.registration_shutdown import stop_registering_when
from m2wr_node.internals.server_acceptor import accept_concurrently

LOOK = 0.2              # s of wall time between two attempts to connect to the master
PATIENCE = 2.0          # s of wall time in which a running master accepts a connection
STUCK = 2.0             # s of wall time after which a second signal ends a node whose shutdown hangs
_GONE = (ConnectionError, http.client.HTTPException, rospy.exceptions.ROSInitException)      # errors of a lost master
_registered = threading.Event()


def shut_down_in_thread() -> None:
    """Make SIGINT, SIGTERM and, unless nohup ignores it, SIGHUP shut ROS down in a thread of its own.

    rospy shuts down in the signal handler.  The interrupted thread may be publishing or registering; rospy then waits
    for a lock that this thread holds, and hangs.  If the new thread hangs too, for instance because the master accepts
    calls and does not answer, the next signal ends the process.
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
    """Make the same signals only add their number to the list returned, for a node with a graceful shutdown.

    A node that hangs during its registration has nothing to release; there the next signal ends the process too.
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
    """Return the master's URI as rospy reads it, and its (host, port); ValueError if it is not an address."""
    uri = rosgraph.get_master_uri() or rosgraph.rosenv.DEFAULT_MASTER_URI
    try:
        address = rosgraph.network.parse_http_host_and_port(uri)
        address[0].encode("idna")
    except ValueError as error:
        raise ValueError("ROS_MASTER_URI is %r (%s); expected http://HOST:PORT" % (uri, error)) from error
    return uri, address


def _accepts_connections(address: Tuple[str, int]) -> bool:
    try:
        socket.create_connection(address, PATIENCE).close()
        return True
    except (OSError, OverflowError):
        return False


def wait_for_master(name: str, asked: Callable[[], bool] = rospy.core.is_shutdown_requested) -> None:
    """Return when the master accepts connections; exit with 1 if ``asked()`` becomes true before.

    rospy waits too, but holds a lock that its shutdown needs: without a roscore, the node could not be stopped.
    Also exits with 1 if ROS_MASTER_URI is not an address; rospy would try it without end.

    Parameters
    ----------
    name : str
        Name of the node, for messages.
    asked : callable
        Returns whether the node has to end.
    """
    try:
        uri, address = _master()
    except ValueError as error:
        sys.stderr.write("%s: %s\n" % (name, error))
        sys.exit(1)
    reported = False
    while not asked():
        if _accepts_connections(address):
            return
        if not reported:
            sys.stderr.write("%s: no master answers at %s yet; waiting for roscore or roslaunch\n" % (name, uri))
            sys.stderr.flush()
        reported = True
        time.sleep(LOOK)
    sys.exit(1)


def master_gone(error: BaseException) -> Optional[str]:
    """Return a sentence if the cause of an error is a master that has gone, else None."""
    uri, address = _master()
    if not isinstance(error, _GONE) or _accepts_connections(address):
        return None
    return "the master at %s has gone (%s: %s)" % (uri, type(error).__name__, error)


def _report_lost_master(name: str) -> None:
    """Print one sentence instead of a traceback if the program ends with an error because the master has gone."""
    default = sys.excepthook

    def report(kind: Any, error: Any, trace: Any) -> None:
        sentence = master_gone(error)
        if sentence is None:
            default(kind, error, trace)
        else:
            sys.stderr.write("%s: %s\n" % (name, sentence))

    sys.excepthook = report


def _suppress_closed_socket_errors() -> None:
    """End a thread of rospy without a traceback if it uses a socket that the shutdown has just closed."""
    default = threading.excepthook

    def report(details: Any) -> None:
        closed = isinstance(details.exc_value, OSError) and details.exc_value.errno == errno.EBADF
        if not (closed and rospy.core.is_shutdown_requested()):
            default(details)

    threading.excepthook = report


def register(name: str, asked: Callable[[], bool] = rospy.core.is_shutdown_requested, **options: Any) -> None:
    """Register the node ``name``, with options of ``rospy.init_node``; the caller has set the signal handlers.

    Exits with 1 if the node has to end before it is registered.  If the master is lost, then or later, and the error
    ends the program, one sentence reports it.

    Parameters
    ----------
    name : str
    asked : callable
        Returns whether the node has to end.  When it does, rospy stops registering with the master, see
        :mod:`m2wr_node.internals.registration_shutdown`.
    **options
    """
    wait_for_master(name, asked)
    _report_lost_master(name)
    _suppress_closed_socket_errors()
    stop_registering_when(asked)
    try:
        rospy.init_node(name, disable_signals=True, **options)
    except Exception:                   # of any kind: the shutdown closes what the registration uses
        if not asked():
            raise
        sys.exit(1)
    _registered.set()
    accept_concurrently()


def start_node(name: str, **options: Any) -> None:
    """Register the node ``name``, with options of ``rospy.init_node``; exits with 1 if it is interrupted meanwhile."""
    shut_down_in_thread()
    register(name, **options)

# SPDX-License-Identifier: BSD-3-Clause
"""The connection of one subscriber, written to without waiting and without a thread of its own.

Need: see :mod:`m2wr_node.internals.subscriber_connections`.

Uses: of ``rospy.impl.tcpros_base.TCPROSTransport`` the attributes ``socket``, ``endpoint_id``, ``done``,
``cleanup_cb``, ``stat_bytes``, ``stat_num_msg`` and the methods ``set_cleanup_callback`` and ``close``, which calls
``cleanup_cb``; this removes the connection from its topic.  ``tcpros_base._tcpros_server.topic_connection_handler``,
which gets the socket, the address and the header of each new subscriber, and keeps nothing of the header.
Checked: rospy 1.15.15 (Debian 12), 1.16.0 (source of Noetic).
Without it: rospy writes to the connection itself, see ``subscriber_connections``.
"""
from __future__ import annotations

import logging
import select
import socket
import threading
import time
from collections import deque
from typing import Any, Deque, Dict, Optional

from rospy.exceptions import TransportTerminated
from rospy.impl import tcpros_base

log = logging.getLogger(__name__)

BACKLOG_MESSAGES = 10000    # of one connection; the first limit that is reached counts
BACKLOG_BYTES = 8 << 20
USED = ("socket", "endpoint_id", "done", "cleanup_cb", "stat_bytes", "stat_num_msg", "set_cleanup_callback", "close")
PERIOD_FIELD = "m2wr_wall_period"       # of a connection header: least wall time between two messages [s]
LONGEST_PERIOD = 10.0                   # s that a subscriber may ask for
_AT_ONCE = socket.MSG_DONTWAIT
_BATCH_MESSAGES = 64        # passed to the kernel in one call when a backlog is sent
_QUIET = 10.0               # s of wall time between two log lines about one connection


class _Drain:
    """The thread that waits until a peer that did not read accepts data again; started when first needed."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._links: Dict[int, Link] = {}       # by file descriptor
        self._poll: Optional[select.epoll] = None

    def watch(self, link: Link) -> None:
        """Call ``link.drain()`` once, as soon as its socket accepts data or fails."""
        with self._lock:
            number = link.fileno_now()
            if number < 0:
                return
            poll = self._poll
            if poll is None:
                poll = self._poll = select.epoll()
                threading.Thread(target=self._run, args=(poll,), name="drain", daemon=True).start()
            self._links[number] = link
            for arm in (poll.modify, poll.register):
                try:
                    arm(number, select.EPOLLOUT | select.EPOLLONESHOT)
                    break
                except OSError:         # not watched yet; or already closed, then forget() follows
                    continue

    def forget(self, link: Link) -> None:
        """Stop watching a connection."""
        with self._lock:
            for number in [number for number, watched in self._links.items() if watched is link]:
                del self._links[number]

    def _run(self, poll: select.epoll) -> None:
        while True:
            for number, _ in poll.poll():
                with self._lock:
                    link = self._links.pop(number, None)
                if link is not None:
                    link.drain()
                    link = None         # this thread must not keep it alive while it waits


_drain = _Drain()


_MOST_ASKED = 1000                      # subscribers that asked for a period and are not adopted yet
_asked: Dict[Any, float] = {}           # their periods [s], by address


def read_periods() -> None:
    """Note from now on the periods that new subscribers of this process ask for; call it after rospy has started."""
    server: Any = getattr(tcpros_base, "_tcpros_server", None)
    handler = getattr(server, "topic_connection_handler", None)
    if handler is None or hasattr(handler, "reads_periods"):
        return

    def note_period(sock: Any, address: Any, header: Dict[str, str]) -> Any:
        period = period_of(header)
        if period and len(_asked) < _MOST_ASKED:
            _asked[address] = period
        return handler(sock, address, header)

    note_period.reads_periods = True        # type: ignore[attr-defined]
    server.topic_connection_handler = note_period


def period_of(header: Dict[str, str]) -> float:
    """Return the least wall time between two messages that a connection header asks for [s]; 0: none."""
    try:
        period = float(header.get(PERIOD_FIELD, 0.0))
    except (TypeError, ValueError):
        return 0.0
    return period if 0.0 < period <= LONGEST_PERIOD else 0.0


def _period_asked(sock: Any) -> float:
    try:
        return _asked.pop(sock.getpeername(), 0.0) if _asked else 0.0
    except OSError:                         # closed meanwhile
        return 0.0


class Link:
    """Stands for one of rospy's connections in the list of connections of a topic.

    Attributes that are not defined here are those of rospy's connection.  A message that is partly sent is always
    completed; beyond the limits the oldest complete messages are dropped.

    Parameters
    ----------
    connection : rospy.impl.tcpros_base.TCPROSTransport
        With an open socket.
    topic : str
        For log messages.

    Attributes
    ----------
    period : float
        Least wall time between two messages that the peer asks for [s]; 0: it wants all.
    due : float
        When the next one may be sent [s, of ``time.monotonic``].
    """

    def __init__(self, connection: Any, topic: str) -> None:
        self.period, self.due = _period_asked(connection.socket), 0.0
        self._connection, self._socket, self._topic = connection, connection.socket, topic
        self._lock = threading.Lock()
        # what the kernel gets next; only _drain's thread changes it; None: all is sent
        self._begun: Optional[Deque[memoryview]] = None
        self._backlog: Deque[bytes] = deque()
        self._bytes = 0                 # in the backlog
        self._fault: Optional[Exception] = None
        self._complaint = False         # whether a warning about lost messages is due
        self._complained: Optional[float] = -_QUIET     # wall time the backlog was sent; None while a warning holds
        self.dropped = 0
        previous = connection.cleanup_cb

        def cleanup(closed: Any) -> None:
            self._let_go()
            if previous:
                previous(closed)

        connection.set_cleanup_callback(cleanup)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):
            raise AttributeError(name)
        return getattr(self._connection, name)

    def __eq__(self, other: object) -> bool:
        return other is self or other is self._connection       # rospy removes the connection that it has added

    def __hash__(self) -> int:
        return hash(self._connection)

    @property
    def waiting(self) -> int:
        """Number of messages that are not sent yet."""
        begun = self._begun
        return 0 if begun is None else len(begun) + len(self._backlog)

    def fileno_now(self) -> int:
        """Return the file descriptor of the socket while it is open, else -1."""
        return -1 if self._socket is None else self._socket.fileno()

    def write_data(self, data: bytes) -> None:
        """Send one framed message, or keep it for later; returns at once.

        Raises
        ------
        rospy.exceptions.TransportTerminated
            If the connection is closed; it is then removed from its topic.
        """
        with self._lock:
            if self._begun is None:
                try:
                    sent = self._socket.send(data, _AT_ONCE)
                except BlockingIOError:
                    sent = 0
                except (OSError, AttributeError) as error:  # AttributeError: closed before this call
                    self._fault, sent = error, None
                if sent == len(data):
                    self._connection.stat_bytes += sent
                    self._connection.stat_num_msg += 1
                    return
                if sent is not None:
                    self._connection.stat_bytes += sent
                    self._begun = deque((memoryview(data)[sent:],))
                    _drain.watch(self)
            else:
                self._keep(data)
        if self._fault is not None:
            self._break()
        if self._complaint:
            self._complain()

    def _keep(self, data: bytes) -> None:
        self._backlog.append(data)
        self._bytes += len(data)
        while len(self._backlog) > BACKLOG_MESSAGES or (self._bytes > BACKLOG_BYTES and len(self._backlog) > 1):
            self._bytes -= len(self._backlog.popleft())
            self.dropped += 1
            if self._complained is not None:
                self._complaint = True

    def drain(self) -> None:
        """Send the backlog until it is empty or the kernel accepts no more; only for :class:`_Drain`'s thread."""
        try:
            begun = self._refill()
            while begun:
                self._account(begun, self._socket.sendmsg(begun, (), socket.MSG_DONTWAIT))
                begun = self._refill()
        except BlockingIOError:
            _drain.watch(self)
        except (OSError, AttributeError) as error:
            self._fault = error
            try:
                self._break()
            except TransportTerminated:
                pass                    # logged in _break

    def _refill(self) -> Optional[Deque[memoryview]]:
        """Move messages from the backlog to what the kernel gets next, and return it; None when nothing is left."""
        with self._lock:
            begun = self._begun
            while begun is not None and self._backlog and len(begun) < _BATCH_MESSAGES:
                data = self._backlog.popleft()
                self._bytes -= len(data)
                begun.append(memoryview(data))
            if not begun:
                self._begun = begun = None
                if self._complained is None:
                    self._complained = time.monotonic()
            return begun

    def _account(self, begun: Deque[memoryview], sent: int) -> None:
        """Remove the bytes that the kernel has accepted."""
        self._connection.stat_bytes += sent
        while begun and sent >= len(begun[0]):
            sent -= len(begun.popleft())
            self._connection.stat_num_msg += 1
        if sent:
            begun[0] = begun[0][sent:]

    def _complain(self) -> None:
        """Log once that messages are lost; again only after the backlog has been empty."""
        self._complaint = False
        if self._complained is not None and time.monotonic() - self._complained >= _QUIET:
            log.warning("%s does not read %s fast enough: %d messages wait for it, and from now on the oldest are "
                        "dropped; /diagnostics counts them", self._connection.endpoint_id, self._topic, self.waiting)
        self._complained = None

    def _break(self) -> None:
        """Close the connection, which removes it from its topic."""
        error, self._fault = self._fault, None
        log.debug("%s to %s: %s", self._topic, self._connection.endpoint_id, error)
        try:
            self._connection.close()
        except Exception as fault:      # rospy fails if the topic is closed at the same moment
            log.debug("%s to %s: while closing: %s", self._topic, self._connection.endpoint_id, fault)
        raise TransportTerminated(str(error))

    def _let_go(self) -> None:
        """Discard what can no longer be sent."""
        _drain.forget(self)
        with self._lock:
            self._backlog.clear()
            self._bytes = 0

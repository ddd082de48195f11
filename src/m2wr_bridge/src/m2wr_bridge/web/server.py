# SPDX-License-Identifier: BSD-3-Clause
"""Websocket server: checks who connects, reads with limits, sends each client what it can take."""
from __future__ import annotations

import asyncio
import contextlib
import http
import logging
import ssl
import threading
import time
from typing import Any, Callable, List, NamedTuple, Optional, Sequence, Set, Tuple

import websockets.asyncio.server
import websockets.datastructures
import websockets.exceptions
import websockets.http11

from m2wr_bridge.web.outbox import Frame, Outbox
from m2wr_bridge.web.workers import Workers
from m2wr_node.web_access import Access

log = logging.getLogger("m2wr_bridge")

MOST_CLIENTS = 256          # connected at the same time
_WORKERS = 16               # threads that do what clients ask
_UNSENT = 1 << 18           # bytes that wait in the system's and the library's buffers of a client
_UNREAD = 4                 # messages of a client that were read and are not done yet
_PATIENCE = 10.0            # s to connect, and to close
_TOO_MUCH = 1013            # code of a close: try again later (registry of RFC 6455, 7.4)


class Settings(NamedTuple):
    """How to serve.

    ``largest``: bytes of a message that is read; ``pause``: s after each message that is sent; ``ping`` and
    ``ping_patience``: s between two pings and s to answer one, None: no pings; ``deflate``: compress messages;
    ``subprotocols``: accepted ones, the best first, none: any client; ``tls``: for encrypted connections.
    """

    host: str
    port: int
    largest: int = 10_000_000
    pause: float = 0.0
    ping: Optional[float] = None
    ping_patience: Optional[float] = 30.0
    deflate: bool = False
    subprotocols: Sequence[str] = ()
    tls: Optional[ssl.SSLContext] = None


class Client(Outbox):
    """One connected client, as a session sees it: what is put in is sent; any thread may put in.

    Attributes
    ----------
    name : str
        Its address and port.
    host : str
        Its address.
    """

    def __init__(self, host: str, port: int, wake: Callable[[], None]) -> None:
        super().__init__(wake)
        self.host, self.name = host, "%s:%d" % (host, port)


class Session:
    """What a protocol does for one client; its methods are called in a worker, one after the other."""

    def handle(self, message: Frame) -> None:
        """Do what a message asks."""
        raise NotImplementedError

    def close(self) -> None:
        """Release all that the client had."""
        raise NotImplementedError


class WebSocketServer:
    """Serves in a thread of its own until :meth:`stop`.

    Parameters
    ----------
    settings : Settings
        The address must be free.
    access : Access
    open_session : callable
        Takes a Client, returns its Session; called in a worker.
    changed : callable, optional
        Called with a Client after it has come (true) or left (false), in the server's thread.

    Raises
    ------
    OSError
        If the address cannot be listened at.
    """

    def __init__(self, settings: Settings, access: Access, open_session: Callable[[Client], Session],
                 changed: Optional[Callable[[Client, bool], None]] = None) -> None:
        self._settings, self._access, self._open_session = settings, access, open_session
        self._changed = changed
        self._workers = Workers(_WORKERS)
        self._connections: Set[Any] = set()
        self._refused: Set[str] = set()
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)   # it says each lost connection otherwise
        self._loop = asyncio.new_event_loop()
        started: List[Optional[BaseException]] = []
        ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, args=(started, ready), name="websockets", daemon=True)
        self._thread.start()
        ready.wait()
        if started and started[0] is not None:
            raise started[0]

    @property
    def port(self) -> int:
        """Port at which it listens."""
        return self._settings.port

    @property
    def clients(self) -> int:
        """Number of connected clients."""
        return len(self._connections)

    def stop(self) -> None:
        """Close all connections and the address."""
        with contextlib.suppress(RuntimeError):         # the loop has ended already
            self._loop.call_soon_threadsafe(self._stopping.set)
        self._thread.join(2.0 * _PATIENCE)

    # ---- the server's thread -----------------------------------------------------------------------------------

    def _serve(self, started: List[Optional[BaseException]], ready: threading.Event) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._run(started, ready))
        except OSError as error:
            started.append(error)
        finally:
            ready.set()
            self._loop.close()

    async def _run(self, started: List[Optional[BaseException]], ready: threading.Event) -> None:
        self._stopping = asyncio.Event()
        wanted = self._settings
        async with websockets.asyncio.server.serve(
                self._connect, wanted.host, wanted.port, process_request=self._check, max_size=wanted.largest,
                max_queue=_UNREAD, write_limit=_UNSENT, compression="deflate" if wanted.deflate else None,
                ping_interval=wanted.ping, ping_timeout=wanted.ping_patience, ssl=wanted.tls, open_timeout=_PATIENCE,
                close_timeout=_PATIENCE, server_header=None,
                subprotocols=list(wanted.subprotocols) or None):        # type: ignore[arg-type]
            ready.set()
            await self._stopping.wait()
            for connection in list(self._connections):
                connection.transport.abort() if connection.transport.get_write_buffer_size() else None

    def _check(self, connection: Any, request: Any) -> Any:
        """Answer a request that may not connect; None lets it connect."""
        refusal = self._access.refusal(request.path, request.headers)
        status = http.HTTPStatus.FORBIDDEN
        if refusal is None and len(self._connections) >= MOST_CLIENTS:
            refusal, status = "%d clients are connected, no more are let in" % MOST_CLIENTS, \
                http.HTTPStatus.SERVICE_UNAVAILABLE
        if refusal is None:
            return None
        if refusal not in self._refused and len(self._refused) < 100:
            self._refused.add(refusal)
            log.warning("a connection is refused: %s (said once)", refusal)
        return connection.respond(status, refusal + "\n")

    async def _connect(self, connection: Any) -> None:
        """Serve one client until it leaves."""
        event = asyncio.Event()

        def wake() -> None:
            with contextlib.suppress(RuntimeError):     # the loop has ended
                self._loop.call_soon_threadsafe(event.set)

        host, port = (connection.remote_address or ("?", 0))[:2]
        client = Client(host, port, wake)
        self._add(connection, client, True)
        sender = asyncio.ensure_future(self._send(connection, client, event))
        try:
            session = await self._loop.run_in_executor(self._workers, self._open_session, client)
            try:
                with contextlib.suppress(websockets.exceptions.ConnectionClosed):
                    async for message in connection:
                        await self._loop.run_in_executor(self._workers, session.handle, message)
            finally:
                await self._loop.run_in_executor(self._workers, session.close)
        except Exception as error:                      # of one client; the server and the others continue
            log.error("client %s: %s: %s", client.name, type(error).__name__, error, exc_info=error)
        finally:
            sender.cancel()
            self._add(connection, client, False)
            self._say_end(client, connection)

    def _add(self, connection: Any, client: Client, here: bool) -> None:
        (self._connections.add if here else self._connections.discard)(connection)
        if self._changed is not None:
            self._changed(client, here)

    def _say_end(self, client: Client, connection: Any) -> None:
        """Log the end of a connection that did not end as it should."""
        sent = connection.protocol.close_sent
        if sent is not None and sent.code not in (1000, 1001, 1005):
            log.warning("client %s: connection closed: %s %s", client.name, sent.code, sent.reason)
        if client.dropped:
            log.info("client %s: %d messages were left out because it read slowly or asked for fewer", client.name,
                     client.dropped)

    async def _send(self, connection: Any, client: Client, event: asyncio.Event) -> None:
        """Send what waits for a client, as fast as it reads."""
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            while True:
                event.clear()
                if client.overflowed:
                    await connection.close(_TOO_MUCH, "answers are not read")
                    return
                frames, wait = self._next(client)
                for frame in frames:
                    await connection.send(frame)
                    if self._settings.pause:
                        await asyncio.sleep(self._settings.pause)
                if not frames and wait != 0.0:
                    with contextlib.suppress(asyncio.TimeoutError):
                        await asyncio.wait_for(event.wait(), wait)
                else:
                    await asyncio.sleep(0)      # a send that need not wait lets no other client run

    @staticmethod
    def _next(client: Client) -> Tuple[List[Frame], Optional[float]]:
        try:
            return client.take(time.monotonic())
        except Exception as error:                      # of one message; the client and the others continue
            log.error("client %s: %s: %s", client.name, type(error).__name__, error, exc_info=error)
            return [], 0.0

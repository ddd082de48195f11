# SPDX-License-Identifier: BSD-3-Clause
"""The server: viser's, behind a check of each request, with this package's own script in the page.

It uses private parts of viser; its version is pinned.
"""
from __future__ import annotations

import asyncio
import contextlib
import functools
import gzip
import http
import io
import json
import logging
import os
from typing import Any, Callable, Dict, Iterator, List, Optional, Set, Tuple

import viser
import viser._messages
import viser._viser
import viser.infra
import viser.infra._infra
import websockets.asyncio.server
import websockets.datastructures
import websockets.exceptions
import websockets.http11

from m2wr_live.web.client_page import ClientFile, ClientPage, split_page
from m2wr_live.web.intake import take_messages
from m2wr_live.web.requests import Drive, read_drive
from m2wr_live.web.windows import send_windows
from m2wr_node.web_access import Access
from m2wr_view.errors import ViewError

log = logging.getLogger("m2wr_live")

PAGES = 64                  # open at the same time; each costs memory and the time of the server
_OWN_PATH = "/m2wr"         # websocket of the page's own script
_LARGEST = 1 << 20          # bytes of a message from a page
_UNSENT = 1 << 18           # bytes that wait for a slow page before it is sent less
_PAUSE = 0.005              # s after each message of a page: at most 200 a second are read
_WINDOW = 0.004             # s in which viser collects messages for a page; its own 1/60 s is half of a picture's time
_STATUS_PERIOD = 0.2        # s between two status messages to the pages
_TYPES = {".js": "application/javascript", ".css": "text/css; charset=utf-8"}


class SafeEvent(asyncio.Event):
    """An event that only the thread of its loop sets.

    viser sets the event of a buffer in the thread that draws, and then again in the loop. The first is not allowed for
    asyncio's events: the loop may change the list of waiting pages meanwhile, and drawing fails. The second is enough.
    """

    def set(self) -> None:
        """Set the event; without effect outside of a loop's thread."""
        try:
            asyncio.get_running_loop()
        except RuntimeError:
            return
        super().set()


class SafeBuffer(viser.infra._infra.AsyncMessageBuffer):     # type: ignore[misc]
    """A buffer of messages into which any thread may put."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.message_event, self.window_duration_sec = SafeEvent(), _WINDOW


viser.infra._infra.AsyncMessageBuffer = SafeBuffer      # of the server and of each page
viser.infra._infra._message_producer = send_windows
viser.infra._infra._message_consumer = take_messages


class _Guarded(viser.infra.WebsockServer):
    """viser's server with the checks; :class:`PageServer` sets the attributes before it starts."""

    checks: "PageServer"

    def start(self) -> None:
        serve = websockets.asyncio.server.serve
        checks = self.checks

        def guarded(handler: Any, host: str, port: int, **options: Any) -> Any:
            options.update(max_size=_LARGEST, write_limit=_UNSENT,
                           process_request=functools.partial(checks.answer, options["process_request"]))
            return serve(functools.partial(checks.connect, handler), host, port, **options)

        websockets.asyncio.server.serve = guarded       # viser offers no other way to hand these options in
        try:
            super().start()
        finally:
            websockets.asyncio.server.serve = serve


@contextlib.contextmanager
def _guarded_viser(checks: "PageServer") -> Iterator[None]:
    """Let viser make its server with the checks, without its banner."""
    original = viser.infra.WebsockServer
    viser.infra.WebsockServer = type("Guarded", (_Guarded,), {"checks": checks})
    try:
        with contextlib.redirect_stdout(io.StringIO()):
            yield
    finally:
        viser.infra.WebsockServer = original


class PageServer:
    """Serves pages until :meth:`stop`.

    Parameters
    ----------
    host, port
        Address to listen at; it must be free.
    access : Access
    folder : str
        Of this package's own script and style.
    drive : callable, optional
        Takes what a page asks to drive; None: pages may only watch.

    Attributes
    ----------
    viser : viser.ViserServer
    status : dict
        Sent to the pages five times a second; set a new one instead of changing it.
    """

    def __init__(self, host: str, port: int, access: Access, folder: str,
                 drive: Optional[Callable[[Drive], None]] = None) -> None:
        self._access, self._folder, self._drive = access, folder, drive
        self.status: Dict[str, Any] = {}
        self._pages: Set[Any] = set()
        self._refused: Set[str] = set()
        self._document = ""                         # read when the first page is asked for
        self._client: Optional[ClientPage] = None
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)       # says each lost connection otherwise
        with _guarded_viser(self):
            self.viser = viser.ViserServer(host=host, port=port, verbose=False)
        for kind in (viser._messages.ShareUrlRequest, viser._messages.ShareUrlDisconnect):
            self.viser._websock_server.unregister_handler(kind)     # pages must not open a way in from the internet

    @property
    def pages(self) -> int:
        """Number of open pages."""
        return len(self._pages)

    def stop(self) -> None:
        """Close all pages and the address."""
        with contextlib.redirect_stdout(io.StringIO()):
            self.viser.stop()

    # ---- requests ----------------------------------------------------------------------------------------------

    def answer(self, inner: Callable[[Any, Any], Any], connection: Any, request: Any) -> Any:
        """Answer an HTTP request; None lets a websocket connect.

        Parameters
        ----------
        inner : callable
            viser's own answer.
        connection, request
            Of websockets.

        Returns
        -------
        websockets.http11.Response or None
        """
        refusal = self._access.refusal(request.path, request.headers)
        if refusal is not None:
            self._log_refusal(refusal)
            return _response(http.HTTPStatus.FORBIDDEN, "Live view: %s.\n" % refusal)
        path = request.path.partition("?")[0]
        if request.headers.get("Upgrade", "").lower() == "websocket":
            if len(self._pages) >= 2 * PAGES:
                self._log_refusal("%d pages are open, no more are let in" % PAGES)
                return _response(http.HTTPStatus.SERVICE_UNAVAILABLE, "Live view: %d pages are open.\n" % PAGES)
            return None
        name = path.strip("/")
        if name in ("live.js", "live.css"):
            with open(os.path.join(self._folder, name), encoding="utf-8") as stream:
                return _response(http.HTTPStatus.OK, stream.read(), _TYPES[os.path.splitext(name)[1]])
        if name in ("", "index.html"):
            return self._page(request.path)
        if self._client is not None and name in self._client.files:
            return _kept(self._client.files[name], request.headers.get("Accept-Encoding", ""))
        return inner(connection, request)

    def _log_refusal(self, reason: str) -> None:
        if reason not in self._refused and len(self._refused) < 100:
            self._refused.add(reason)
            log.warning("a request is refused: %s (said once)", reason)

    def _page(self, path: str) -> Any:
        """Return viser's page with this package's script in it."""
        if not self._document:
            self._read_page()
        answer = _response(http.HTTPStatus.OK, self._document, "text/html; charset=utf-8")
        cookie = self._access.cookie_line(path)
        if cookie:
            answer.headers["Set-Cookie"] = cookie
        return answer

    def _read_page(self) -> None:
        """Read the page, in parts if that is possible."""
        own = "<link rel=\"stylesheet\" href=\"live.css\"><script src=\"live.js\"></script>"
        source = os.path.join(os.path.dirname(viser.__file__), "client", "build", "index.html")
        with open(source, encoding="utf-8") as stream:
            text = stream.read()
        self._client = split_page(text, own)
        if self._client is not None:
            self._document = self._client.document
        else:
            before, mark, after = text.rpartition("</body>")
            self._document = before + own + mark + after

    async def connect(self, inner: Callable[[Any], Any], connection: Any) -> None:
        """Serve a websocket: the own one of a page, or viser's.

        Parameters
        ----------
        inner : callable
            viser's handler.
        connection
            Of websockets.
        """
        self._pages.add(connection)
        try:
            if connection.request.path.partition("?")[0] == _OWN_PATH:
                await self._serve_script(connection)
            else:
                await inner(connection)
        except websockets.exceptions.ConnectionClosed:
            pass
        finally:
            self._pages.discard(connection)

    async def _serve_script(self, connection: Any) -> None:
        """Send the status and take requests to drive, until the page is closed; then the robot stops."""
        sender = asyncio.ensure_future(self._send_status(connection))
        driven: Dict[str, Drive] = {}
        complained: List[str] = []
        try:
            async for text in connection:
                try:
                    asked = read_drive(text)
                    if self._drive is None:
                        raise ViewError("pages may only watch (live_control:=false)")
                    self._drive(asked)
                    driven[asked.topic] = asked
                except ViewError as error:
                    if str(error) not in complained and len(complained) < 10:
                        complained.append(str(error))
                        log.warning("%s", error)
                    await connection.send(json.dumps({"error": str(error)}))
                await asyncio.sleep(_PAUSE)
        finally:
            sender.cancel()
            for last in driven.values():
                if self._drive is not None and (last.forward or last.left):
                    self._drive(last._replace(forward=0.0, left=0.0))

    async def _send_status(self, connection: Any) -> None:
        with contextlib.suppress(websockets.exceptions.ConnectionClosed):
            while True:
                await connection.send(json.dumps(self.status))
                await asyncio.sleep(_STATUS_PERIOD)


def _response(status: http.HTTPStatus, text: str, kind: str = "text/plain; charset=utf-8") -> Any:
    return _answer(status, text.encode("utf-8"), ("Content-Type", kind), ("Cache-Control", "no-cache"))


def _kept(file: ClientFile, accepted: str) -> Any:
    """Return a file that browsers keep: its name changes with its content."""
    packed = "gzip" in accepted
    headers = [("Content-Type", file.kind), ("Cache-Control", "private, max-age=31536000, immutable"),
               ("Vary", "Accept-Encoding")] + [("Content-Encoding", "gzip")] * packed
    return _answer(http.HTTPStatus.OK, file.content if packed else gzip.decompress(file.content), *headers)


def _answer(status: http.HTTPStatus, body: bytes, *headers: Tuple[str, str]) -> Any:
    every = websockets.datastructures.Headers(headers + (
        ("Content-Length", str(len(body))), ("X-Frame-Options", "SAMEORIGIN"), ("Referrer-Policy", "no-referrer"),
        ("Connection", "close")))
    return websockets.http11.Response(status.value, status.phrase, every, body)

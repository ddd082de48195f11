# SPDX-License-Identifier: BSD-3-Clause
"""A service that a client answers."""
from __future__ import annotations

import itertools
import threading
from typing import Any, Callable, Dict, Optional

from m2wr_bridge.errors import BridgeError

MOST_WAITING = 100          # calls of a service that wait for its client
_numbers = itertools.count()


class _Call:
    """A call that waits for its answer."""

    def __init__(self) -> None:
        self.done = threading.Event()
        self.values: Any = None
        self.error: Optional[str] = None


class ServedByClient:
    """Passes the calls of a service to a client and waits for its answers.

    Parameters
    ----------
    service : str
    send : callable
        Takes the fields of the message ``call_service``.
    """

    def __init__(self, service: str, send: Callable[[Dict[str, Any]], None]) -> None:
        self.service, self._send = service, send
        self._calls: Dict[str, _Call] = {}
        self._lock = threading.Lock()
        self._closed = False

    def handle(self, arguments: Any) -> Any:
        """Return the client's answer to a call; waits until it comes or the client leaves.

        Parameters
        ----------
        arguments : dict
            Request as plain values.

        Raises
        ------
        BridgeError
            If the client reports an error or leaves.
        """
        call, name = _Call(), "service_request:%s:%d" % (self.service, next(_numbers))
        with self._lock:
            if self._closed:
                raise BridgeError("the client that serves %s has left" % self.service)
            if len(self._calls) >= MOST_WAITING:
                raise BridgeError("%d calls of %s wait for its client" % (MOST_WAITING, self.service))
            self._calls[name] = call
        self._send({"op": "call_service", "id": name, "service": self.service, "args": arguments})
        call.done.wait()
        if call.error is not None:
            raise BridgeError(call.error)
        return call.values

    def answer(self, name: object, values: Any, good: bool) -> bool:
        """Take an answer of the client; return whether a call waited for it.

        Parameters
        ----------
        name : str
            Id of the call.
        values : object
            Plain values, or the text of an error.
        good : bool
            Whether the call succeeded.

        Returns
        -------
        bool
        """
        with self._lock:
            call = self._calls.pop(name, None) if isinstance(name, str) else None
        if call is None:
            return False
        call.values = values
        call.error = None if good else str(values)[:1000]
        call.done.set()
        return True

    def close(self) -> None:
        """End all calls that wait with an error."""
        with self._lock:
            self._closed, calls, self._calls = True, self._calls, {}
        for call in calls.values():
            call.error = "the client that serves %s has left" % self.service
            call.done.set()

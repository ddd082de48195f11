# SPDX-License-Identifier: BSD-3-Clause
"""A client of a websocket for checks: sends, and waits for the messages that fit."""
import json
import time

from websockets.sync.client import connect

PATIENCE = 60.0         # s of wall time
CLOSING = 0.5           # s for the end; the library waits for an answer that it cannot read behind unread messages


class WebClient:
    """One connection; use it as a context manager."""

    def __init__(self, address, **options):
        self.socket = connect(address, max_size=None, open_timeout=PATIENCE, close_timeout=CLOSING, **options)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()

    def send(self, **fields):
        """Send a message of JSON."""
        self.socket.send(json.dumps(fields))

    def receive(self, patience=PATIENCE):
        """Return the next message; bytes as they are, text read as JSON."""
        message = self.socket.recv(patience)
        return message if isinstance(message, bytes) else json.loads(message)

    def wait(self, fits, what):
        """Return the first message for which ``fits`` is true."""
        deadline, others = time.monotonic() + PATIENCE, []
        while True:
            try:
                message = self.receive(max(0.001, deadline - time.monotonic()))
            except TimeoutError:
                raise AssertionError("waited for %s; other messages: %s" % (what, str(others)[:1000])) from None
            if fits(message):
                return message
            others.append(message)

    def wait_for(self, operation, **fields):
        """Return the first message of JSON with an operation and fields."""
        return self.wait(lambda message: isinstance(message, dict) and message.get("op") == operation and all(
            message.get(name) == value for name, value in fields.items()), "%s %s" % (operation, fields))

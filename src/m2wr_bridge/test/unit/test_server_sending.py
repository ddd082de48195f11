# SPDX-License-Identifier: BSD-3-Clause
"""The loop that sends to one client lets the other clients run."""
import asyncio
import types

from m2wr_bridge.web.server import Client, Settings, WebSocketServer


class Connection:
    """A client that reads so fast that no send has to wait."""

    def __init__(self):
        self.sent = 0

    async def send(self, frame):
        self.sent += 1


async def sent_in_one_turn(frames):
    event, connection = asyncio.Event(), Connection()
    client = Client("test", 1, event.set)
    for _ in range(frames):
        client.answer("x")
    server = types.SimpleNamespace(_settings=Settings("localhost", 0), _next=WebSocketServer._next)
    sender = asyncio.ensure_future(WebSocketServer._send(server, connection, client, event))
    await asyncio.sleep(0)
    sent = connection.sent
    sender.cancel()
    return sent


def test_a_client_that_reads_fast_lets_the_others_run():
    assert asyncio.run(sent_in_one_turn(100)) == 1

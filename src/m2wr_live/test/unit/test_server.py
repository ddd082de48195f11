# SPDX-License-Identifier: BSD-3-Clause
"""The server under many pages: drawing from another thread than the one that sends."""
import asyncio
import sys
import threading
import time

import pytest
import websockets

from m2wr_live.web.server import PageServer, SafeEvent
from m2wr_node.listening import free_port
from m2wr_node.web_access import Access

PAGES, PICTURES = 30, 3000


@pytest.fixture
def server(tmp_path):
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)                         # threads take turns often, so that races show
    made = PageServer("127.0.0.1", free_port("127.0.0.1", 0), Access("", "c"), str(tmp_path))
    yield made
    made.stop()
    sys.setswitchinterval(interval)


class Readers:
    """Programs that read all that a page gets, in a thread of their own; a context manager."""

    def __init__(self, port, count):
        self._address, self._count = "ws://localhost:%d/" % port, count
        self.received = [0] * count
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        asyncio.set_event_loop(self._loop)
        self._tasks = [self._loop.create_task(self._read(number)) for number in range(self._count)]
        self._loop.run_until_complete(asyncio.gather(*self._tasks, return_exceptions=True))

    async def _read(self, number):
        async with websockets.connect(self._address, subprotocols=["viser-v1.1.1"], max_size=None) as page:
            async for data in page:
                self.received[number] += len(data)

    def __enter__(self):
        self._thread.start()
        deadline = time.monotonic() + 60.0
        while not all(self.received):
            assert time.monotonic() < deadline, "pages that got nothing: %d" % self.received.count(0)
            time.sleep(0.01)
        return self

    def __exit__(self, *_):
        for task in self._tasks:
            self._loop.call_soon_threadsafe(task.cancel)
        self._thread.join(30.0)


def test_buffers_of_server_and_pages_have_safe_events(server):
    with Readers(server.viser.get_port(), 2):
        buffers = [server.viser._websock_server.get_message_buffer()]
        buffers += [state.message_buffer for state in server.viser._websock_server._client_state_from_id.values()]
        assert len(buffers) == 3 and all(isinstance(buffer.message_event, SafeEvent) for buffer in buffers)


def test_all_pages_get_what_another_thread_draws(server):
    frame = server.viser.scene.add_frame("/a", show_axes=False)
    with Readers(server.viser.get_port(), PAGES) as pages:
        for number in range(PICTURES):
            frame.position = (number, 0.0, 0.0)
        before = list(pages.received)
        frame.position = (-1.0, 0.0, 0.0)
        deadline = time.monotonic() + 60.0
        while any(now <= then for now, then in zip(pages.received, before)):
            assert time.monotonic() < deadline, "a page got nothing new"
            time.sleep(0.01)


def test_an_event_is_set_only_in_the_thread_of_its_loop():
    async def main():
        event = SafeEvent()
        await asyncio.get_running_loop().run_in_executor(None, event.set)
        assert not event.is_set()
        event.set()
        assert event.is_set()

    asyncio.run(main())

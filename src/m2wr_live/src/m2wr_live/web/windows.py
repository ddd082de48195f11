# SPDX-License-Identifier: BSD-3-Clause
"""Sends viser's messages to pages, each encoded once for all pages that get the same ones.

viser encodes all messages again for each page, which with ten pages costs more than drawing. All that uses private
parts of viser is here, in :mod:`m2wr_live.web.client_page`, ``intake``, ``layers`` and ``server`` of the same package;
its version is pinned. The format is that of viser 1.1.1: sizes of the text before and after compression (2 x uint64),
the text (msgpack, zstd), then arrays, each at a multiple of 8 bytes.
"""
from __future__ import annotations

from collections import OrderedDict
from typing import Any, List, Sequence, Tuple

import msgspec.msgpack
import zstandard
from viser.infra._infra import _append_aligned_buffers

_KEPT = 16                  # encoded windows for pages that are a little behind
_LARGEST = 1 << 20          # bytes of a window that is kept


class Encoder:
    """Turns windows of messages into bytes, and keeps the newest ones."""

    def __init__(self) -> None:
        self._known: OrderedDict[Tuple[int, ...], Tuple[Sequence[Any], bytes]] = OrderedDict()
        self._compressor = zstandard.ZstdCompressor(level=1)
        self.encoded = 0                # windows

    def encode(self, window: Sequence[Any], now: float) -> bytes:
        """Return the bytes of a window.

        Parameters
        ----------
        window : sequence of viser.infra.Message
            Not changed after this call.
        now : float
            Time of any clock [s]; pages use differences.

        Returns
        -------
        bytes
        """
        key = tuple(map(id, window))
        found = self._known.get(key)
        if found is None:
            found = (window, self._encode(window, now))      # it holds the messages, so that no others get their ids
            if len(found[1]) <= _LARGEST:
                self._known[key] = found
                while len(self._known) > _KEPT:
                    self._known.popitem(last=False)
        return found[1]

    def _encode(self, window: Sequence[Any], now: float) -> bytes:
        self.encoded += 1
        arrays: List[memoryview] = []
        messages = tuple(message.as_serializable_dict(arrays) for message in window)
        text = msgspec.msgpack.encode({"messages": messages, "timestampSec": now,
                                       "binaryBufferLengths": tuple(array.nbytes for array in arrays)})
        compressed = self._compressor.compress(text)
        parts: List[Any] = [len(text).to_bytes(8, "little"), len(compressed).to_bytes(8, "little"), compressed]
        _append_aligned_buffers(parts, arrays, 16 + len(compressed))
        return b"".join(parts)


_shared = Encoder()


async def send_windows(page: Any, buffer: Any, client_id: int, backlog_done_message: Any = None) -> None:
    """Send what comes into a buffer until it is closed, in place of viser's function of these arguments.

    Parameters
    ----------
    page
        Connection of websockets.
    buffer : viser.infra.AsyncMessageBuffer
    client_id : int
        Of the page.
    backlog_done_message : viser.infra.Message, optional
        Sent after what was in the buffer before.
    """
    windows = buffer.window_generator(client_id, backlog_done_message=backlog_done_message)
    encoder = _shared if buffer.persistent_messages else Encoder()      # other buffers are of one page only
    try:
        async for window in windows:
            await page.send(encoder.encode(window, buffer.event_loop.time()))
            if buffer.done:
                break
    finally:
        await windows.aclose()          # at once: it holds the place of this page in the buffer

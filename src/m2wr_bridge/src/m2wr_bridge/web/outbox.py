# SPDX-License-Identifier: BSD-3-Clause
"""What waits to be sent to one client, bounded: a client that reads slowly gets fewer messages, never older ones."""
from __future__ import annotations

import threading
from collections import deque
from typing import Any, Callable, Deque, Dict, List, Optional, Tuple, Union

#: One websocket message.
Frame = Union[str, bytes]
MOST_ANSWERS = 1000         # answers that wait for a client; one that asks and does not read is closed
MOST_BYTES = 64 << 20       # bytes of answers, and bytes of all streams, that wait for a client


class Stream:
    """The messages of one subscription that wait.

    Parameters
    ----------
    encode : callable
        Takes a message; returns its frames, none if it cannot be sent. Called when the client is ready for it.
    depth : int
        Messages that wait; the oldest is dropped for a new one.
    period : float
        Least time between two messages [s].
    """

    def __init__(self, encode: Callable[[Any], List[Frame]], depth: int, period: float = 0.0) -> None:
        self.encode, self.depth, self.period = encode, depth, period
        self.waiting: Deque[Tuple[Any, int]] = deque()
        self.due = 0.0
        self.closed = False


class Outbox:
    """Answers in their order, and streams that take turns. Any thread may put in, one takes out.

    Parameters
    ----------
    wake : callable
        Called after something was put in.
    """

    def __init__(self, wake: Callable[[], None]) -> None:
        self._wake, self._lock = wake, threading.Lock()
        self._answers: Deque[Frame] = deque()
        self._answer_bytes = self._stream_bytes = 0
        self._streams: Dict[Stream, None] = {}      # in the order of their turns
        self.overflowed = False
        self.dropped = 0                            # messages of streams

    def answer(self, frame: Frame) -> None:
        """Put an answer in; sets :attr:`overflowed` if too much waits."""
        with self._lock:
            self._answers.append(frame)
            self._answer_bytes += len(frame)
            self.overflowed |= len(self._answers) > MOST_ANSWERS or (
                self._answer_bytes > MOST_BYTES and len(self._answers) > 1)
            if self.overflowed:
                self._answers.clear()
        self._wake()

    def offer(self, stream: Stream, message: Any, size: int) -> None:
        """Put a message of a stream in.

        Parameters
        ----------
        stream : Stream
        message : object
        size : int
            Bytes it holds.
        """
        with self._lock:
            if stream.closed:           # a message that was on its way when the stream was removed
                return
            self._streams.setdefault(stream)
            stream.waiting.append((message, size))
            self._stream_bytes += size
            while len(stream.waiting) > stream.depth or (
                    self._stream_bytes > MOST_BYTES and len(stream.waiting) > 1):
                self._stream_bytes -= stream.waiting.popleft()[1]
                self.dropped += 1
        self._wake()

    def remove(self, stream: Stream) -> None:
        """Forget a stream and what waits in it; it takes no more messages."""
        with self._lock:
            stream.closed = True
            self._stream_bytes -= sum(size for _, size in stream.waiting)
            stream.waiting.clear()
            self._streams.pop(stream, None)

    def take(self, now: float) -> Tuple[List[Frame], Optional[float]]:
        """Return the frames of what is next, or none and the time until a stream is due.

        Parameters
        ----------
        now : float
            Time of a clock that never goes back [s].

        Returns
        -------
        frames : list of str or bytes
        wait : float or None
            Time until a stream is due [s]; None: nothing waits.
        """
        with self._lock:
            if self._answers:
                frame = self._answers.popleft()
                self._answer_bytes -= len(frame)
                return [frame], 0.0
            chosen, wait = None, None
            for stream in self._streams:
                left = stream.due - now
                if stream.waiting and (wait is None or left < wait):
                    wait = left
                    if left <= 0.0:
                        chosen = stream
                        break
            if chosen is None:
                return [], wait
            message, size = chosen.waiting.popleft()
            self._stream_bytes -= size
            chosen.due = now + chosen.period
            del self._streams[chosen]                   # its next turn is after all others
            self._streams[chosen] = None
        return chosen.encode(message), 0.0

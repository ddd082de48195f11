# SPDX-License-Identifier: BSD-3-Clause
"""Messages that a controller has published, counted for its next answer; ROS-free."""
from __future__ import annotations

import threading
from collections import namedtuple
from typing import Dict

Published = namedtuple("Published", "early counts")
"""Messages published on one topic since the previous answer: before the turn began, and in it."""


class Outputs:
    """Number of messages published since the previous answer, by topic."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._counts: Dict[str, int] = {}
        self._early: Dict[str, int] = {}

    def count(self, topic: str) -> None:
        """Count a message; to be called before it is sent, so that the simulator waits for it."""
        with self._lock:
            self._counts[topic] = self._counts.get(topic, 0) + 1

    def begin(self) -> None:
        """Begin a turn: messages counted so far were early."""
        with self._lock:
            self._early, self._counts = self._counts, {}

    def end(self) -> Dict[str, Published]:
        """Return ``{topic: Published}`` since the previous answer, and start again."""
        with self._lock:
            found = {topic: Published(self._early.get(topic, 0), self._counts.get(topic, 0))
                     for topic in sorted(set(self._early) | set(self._counts))}
            self._early, self._counts = {}, {}
        return found

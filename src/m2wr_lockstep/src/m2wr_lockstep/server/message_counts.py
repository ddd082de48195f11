# SPDX-License-Identifier: BSD-3-Clause
"""How many messages the simulation has published."""
from __future__ import annotations

from typing import Dict, Mapping


class MessageCounts:
    """Number of messages the simulation has published, by topic."""

    def __init__(self) -> None:
        self.counts: Dict[str, int] = {}

    def count(self, topic: str) -> None:
        """Count a message."""
        self.counts[topic] = self.counts.get(topic, 0) + 1

    def since(self, seen: Mapping[str, int]) -> Dict[str, int]:
        """Return ``{topic: messages}`` published after the counts were ``seen``; topics without any are left out."""
        return {topic: count - seen.get(topic, 0) for topic, count in self.counts.items() if count > seen.get(topic, 0)}

# SPDX-License-Identifier: BSD-3-Clause
"""Long messages in parts."""
from __future__ import annotations

import json
from typing import Dict, List, Optional

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.rosbridge.requests import Fragment, Id

MOST_OPEN = 16              # incomplete messages of a client
MOST_PARTS = 100_000        # of a message
_SMALLEST = 16              # characters of a part that is sent: one of each character would flood the client


def split(text: str, size: Optional[int], name: Id) -> List[str]:
    """Return a message as it is, or in parts.

    Parameters
    ----------
    text : str
    size : int or None
        Characters of a part; None: no parts.
    name : str, int or None
        Id of the message.
    """
    if size is None or size <= 0 or len(text) <= size:
        return [text]
    size = max(size, _SMALLEST)
    parts = [text[start:start + size] for start in range(0, len(text), size)]
    return [json.dumps({"op": "fragment", "id": name, "data": part, "num": number, "total": len(parts)})
            for number, part in enumerate(parts)]


class _Open:
    """Parts that have come of one message."""

    def __init__(self, total: int, began: float) -> None:
        self.total, self.began, self.parts = total, began, {}   # type: int, float, Dict[int, str]
        self.size = 0


class Assembly:
    """Joins the parts that a client sends.

    Parameters
    ----------
    patience : float
        Time for all parts of a message [s].
    largest : int
        Characters of all parts that wait.
    """

    def __init__(self, patience: float, largest: int) -> None:
        self._patience, self._largest = patience, largest
        self._open: Dict[Id, _Open] = {}

    def add(self, part: Fragment, now: float) -> Optional[str]:
        """Return the whole message if this was its last part.

        Parameters
        ----------
        part : Fragment
        now : float
            Time of a clock that never goes back [s].

        Raises
        ------
        BridgeError
            If the part does not fit, or too much waits; the message is forgotten then.
        """
        for name in [name for name, message in self._open.items() if now - message.began > self._patience]:
            del self._open[name]
        message = self._open.get(part.id)
        if message is None:
            if len(self._open) >= MOST_OPEN:
                raise BridgeError("fragment: %d messages are incomplete already" % MOST_OPEN)
            message = self._open[part.id] = _Open(part.total, now)
        if not 1 <= part.total <= MOST_PARTS or part.total != message.total or not 0 <= part.num < part.total:
            del self._open[part.id]
            raise BridgeError("fragment %d of %d; expected a number below a total of 1 to %d that stays the same" % (
                part.num, part.total, MOST_PARTS))
        message.size += len(part.data) - len(message.parts.get(part.num, ""))
        message.parts[part.num] = part.data
        waiting = sum(one.size for one in self._open.values())
        if waiting > self._largest:
            del self._open[part.id]
            raise BridgeError("fragment: %d characters wait; expected at most %d" % (waiting, self._largest))
        if len(message.parts) < message.total:
            return None
        del self._open[part.id]
        return "".join(message.parts[number] for number in range(message.total))

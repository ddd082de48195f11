# SPDX-License-Identifier: BSD-3-Clause
"""A message as it came, decoded and encoded only if a client needs it, and once for all clients."""
from __future__ import annotations

from typing import Any, Callable, Dict


class Received:
    """A serialised message of a topic.

    Parameters
    ----------
    raw : bytes
    type_name, md5, definition : str
        As its publisher states them.
    secs, nsecs : int
        ROS time at which it came.
    decode : callable
        Takes this; returns the message; raises BridgeError.
    """

    __slots__ = ("raw", "type_name", "md5", "definition", "secs", "nsecs", "_decode", "_encoded")

    def __init__(self, raw: bytes, type_name: str, md5: str, definition: str, secs: int, nsecs: int,
                 decode: Callable[["Received"], Any]) -> None:
        self.raw, self.type_name, self.md5, self.definition = raw, type_name, md5, definition
        self.secs, self.nsecs = secs, nsecs
        self._decode = decode
        self._encoded: Dict[str, Any] = {}

    def encoded(self, kind: str, encode: Callable[[Any], Any]) -> Any:
        """Return what ``encode`` makes of the message; the result is kept for the next client.

        Parameters
        ----------
        kind : str
            Name of the encoding.
        encode : callable
            Takes the message.

        Raises
        ------
        BridgeError
            If the message cannot be decoded or encoded.
        """
        if kind not in self._encoded:
            if "message" not in self._encoded:
                self._encoded["message"] = self._decode(self)
            self._encoded[kind] = encode(self._encoded["message"])
        return self._encoded[kind]

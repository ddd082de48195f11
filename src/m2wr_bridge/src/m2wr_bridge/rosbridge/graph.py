# SPDX-License-Identifier: BSD-3-Clause
"""What a session needs of ROS."""
from __future__ import annotations

from typing import Any, Callable, Optional, Protocol

from m2wr_bridge.messages.received import Received

Listener = Callable[[Received], None]
#: Takes the request as plain values; returns the answer as plain values; raises BridgeError.
Handler = Callable[[Any], Any]


class Graph(Protocol):
    """Topics and services; each method may wait for the master and raises BridgeError."""

    # Call ``listener`` with each message, and with the latched one.
    def subscribe(self, topic: str, type_name: Optional[str], listener: Listener) -> None: ...

    # Call ``listener`` with the latched messages again.
    def repeat_latched(self, topic: str, listener: Listener) -> None: ...

    # Stop calling ``listener``.
    def unsubscribe(self, topic: str, listener: Listener) -> None: ...

    # Publish ``topic`` for ``holder``; without a type, with the one it has.
    def advertise(self, topic: str, type_name: Optional[str], holder: object, latch: bool, depth: int) -> None: ...

    # Stop publishing for ``holder``.
    def unadvertise(self, topic: str, holder: object) -> None: ...

    # Publish a message.
    def publish(self, topic: str, values: Any) -> None: ...

    # Return the answer of a service, a message.
    def call(self, service: str, type_name: Optional[str], arguments: Any) -> Any: ...

    # Serve ``service``.
    def offer_service(self, service: str, type_name: str, handler: Handler) -> None: ...

    # Stop serving.
    def withdraw_service(self, service: str) -> None: ...

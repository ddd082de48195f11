# SPDX-License-Identifier: BSD-3-Clause
"""Interface of an element of a document, as far as shapes need it; :class:`m2wr_sim.model.sdf.node.Node` has it."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn, Optional, Protocol, Sequence, Tuple

if TYPE_CHECKING:
    from typing import Literal

    from m2wr_sim.geometry import Vector


class ShapeElement(Protocol):
    """An element with access to the values of its children; errors are XmlErrors."""

    element: Any                # lxml element

    @property
    def place(self) -> str: ...

    def fail(self, found: str, expected: str) -> NoReturn: ...

    def own_text(self) -> str: ...

    def child(self, tag: str) -> ShapeElement: ...

    def children(self, tag: str) -> Sequence[ShapeElement]: ...

    def text(self, tag: str) -> Optional[str]: ...

    def flag(self, tag: str, default: bool) -> bool: ...

    def whole(self, tag: str, default: int, least: Optional[int] = None) -> int: ...

    def positive(self, tag: str) -> float: ...

    def vector(self, tag: str, count: Literal[3], default: Vector) -> Vector: ...

    def strict_vector(self, tag: str, count: int, default: Tuple[float, ...]) -> Tuple[float, ...]: ...

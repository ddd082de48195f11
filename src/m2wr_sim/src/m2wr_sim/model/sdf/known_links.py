# SPDX-License-Identifier: BSD-3-Clause
"""Links that are written alike in one document are read once: the trees of a wood, the boxes of a store."""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Callable, Dict, Optional, Tuple

from lxml import etree

from m2wr_sim.model.xml.safe import file_of

if TYPE_CHECKING:
    from m2wr_sim.model.sdf.node import Node
    from m2wr_sim.model.types import Link

LONGEST = 4096          # bytes of a text that is kept
_FRAMES = b"relative_to", b"frame="     # attributes that name a frame outside the link

Key = Tuple[Any, ...]


class KnownLinks:
    """The links of a document by their texts.

    A link is kept if its record depends on nothing but its text and the given key: it names no frame; it has no sensor,
    whose plugins know their line; and reading it added no note, which would name a line, too.
    """

    def __init__(self) -> None:
        self._links: Dict[Key, Link] = {}

    def read(self, node: Node, key: Key, reader: Callable[[], Link]) -> Link:
        """Return the link of a node, by ``reader()`` unless one of the same text is known.

        Parameters
        ----------
        node : Node
            ``<link>``; marked as read.
        key : tuple
            Of all that the record depends on beside the text and the file.
        reader : callable
            Reads it.

        Returns
        -------
        Link

        Raises
        ------
        XmlError
            Of the reader.
        """
        text = _text(node.element)
        if text is None:
            return reader()
        key = (text, file_of(node.element)) + key
        found = self._links.get(key)
        if found is not None:
            node.ignore()
            return found
        before = node.notes.size()
        link = reader()
        if node.notes.size() == before and not link.sensors:
            self._links[key] = link
        return link


def _text(element: Any) -> Optional[bytes]:
    """Return an element as text; None if it is too long or names a frame."""
    text: bytes = etree.tostring(element, with_tail=False)
    return None if len(text) > LONGEST or any(word in text for word in _FRAMES) else text

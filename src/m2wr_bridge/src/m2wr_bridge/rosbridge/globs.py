# SPDX-License-Identifier: BSD-3-Clause
"""Lists of name patterns in parameters, such as ``[/map, '/robot/*']``."""
from __future__ import annotations

import fnmatch
from typing import List

from m2wr_bridge.errors import BridgeError


class Globs:
    """Names that are allowed.

    Parameters
    ----------
    text : str
        Patterns in brackets; an empty list allows all.
    name : str
        Of the parameter, for errors.

    Raises
    ------
    BridgeError
        If the text is no such list.
    """

    def __init__(self, text: str, name: str) -> None:
        stripped = text.strip()
        if stripped and not (stripped.startswith("[") and stripped.endswith("]")):
            raise BridgeError("parameter ~%s is %r; expected patterns in brackets, such as [/map, '/robot/*']" % (
                name, text[:100]))
        parts = [part.strip().strip("'\"") for part in stripped[1:-1].split(",")]
        self.patterns: List[str] = [part for part in parts if part]

    def allow(self, name: str) -> bool:
        """Return whether a name fits one of the patterns."""
        return not self.patterns or any(fnmatch.fnmatchcase(name, pattern) for pattern in self.patterns)

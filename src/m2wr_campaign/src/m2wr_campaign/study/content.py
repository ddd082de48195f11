# SPDX-License-Identifier: BSD-3-Clause
"""What a world or a robot consists of, for its key: on every machine the same, wherever its files are."""
from __future__ import annotations

import hashlib
from dataclasses import fields, is_dataclass
from functools import lru_cache
from typing import Any, List, Optional, Tuple, Type

import numpy as np

#: Fields of the records of a model that tell where it was read, and what was said of it.
TOLD = frozenset(("source", "path", "where", "notes", "remarks"))
_PLAIN = frozenset((float, int, bool, str, type(None)))


def content_of(value: object) -> str:
    """Return the digest of a record with all that it consists of: numbers are exact, arrays count with all their bytes.

    Parameters
    ----------
    value : object
        A record of :mod:`m2wr_sim.model.types`, or what its fields may hold.

    Raises
    ------
    TypeError
        If a field holds something else.
    """
    parts: List[str] = []
    _tell(value, parts)
    return hashlib.sha256("".join(parts).encode()).hexdigest()


def _tell(value: object, parts: List[str]) -> None:
    """Append what a value consists of; no two values give the same text."""
    kind = type(value)
    names = _names_of(kind)     # type: ignore[arg-type]    # a type has a hash
    if names is not None:
        parts.append(kind.__name__)
        for name in names:
            parts.append(" " + name + " ")
            _tell(getattr(value, name), parts)
        parts.append(";")
    elif kind in _PLAIN:
        parts.append(repr(value))
    elif isinstance(value, (tuple, list)):
        if all(type(part) in _PLAIN for part in value):
            parts.append(repr(tuple(value)))
            return
        parts.append("[")
        for part in value:
            _tell(part, parts)
            parts.append(",")
        parts.append("]")
    elif isinstance(value, np.ndarray):
        told = np.ascontiguousarray(value)
        parts.append("{} {} {}".format(told.dtype, told.shape, hashlib.sha256(told.tobytes()).hexdigest()))
    elif isinstance(value, np.generic):
        parts.append(repr(value.item()))
    else:
        raise TypeError("a {} in a model: expected records, numbers, texts and arrays".format(kind.__name__))


@lru_cache(maxsize=None)
def _names_of(kind: Type[Any]) -> Optional[Tuple[str, ...]]:
    """Return the names of the fields of a kind of record that count, or None: it is not a record."""
    return tuple(field.name for field in fields(kind) if field.name not in TOLD) if is_dataclass(kind) else None

# SPDX-License-Identifier: BSD-3-Clause
"""What fields a type of message has, and the types of these fields."""
from __future__ import annotations

from typing import Any, Callable, Dict, List, NamedTuple

from m2wr_bridge.messages.field_types import TIMES, parse


class TypeDefinition(NamedTuple):
    """The fields of rosapi/TypeDef; ``fieldarraylen`` is -1 where there is no array, 0 for any length."""

    type: str
    fieldnames: List[str]
    fieldtypes: List[str]
    fieldarraylen: List[int]
    examples: List[str]
    constnames: List[str]
    constvalues: List[str]


def _of_time(name: str) -> TypeDefinition:
    return TypeDefinition(name, ["secs", "nsecs"], ["int32", "int32"], [-1, -1], ["0", "0"], [], [])


def _constants(kind: Any) -> Dict[str, str]:
    return {name: str(value) for name, value in sorted(vars(kind).items())
            if not name.startswith("_") and name not in kind.__slots__ and isinstance(value, (bool, int, float, str))}


def _of_class(kind: Any) -> TypeDefinition:
    types = [parse(text) for text in kind._slot_types]
    message = kind()
    examples = [str([]) if found.length is not None else str(getattr(message, name)) if found.primitive else str({})
                for name, found in zip(kind.__slots__, types)]
    constants = _constants(kind)
    return TypeDefinition(kind._type, list(kind.__slots__), [found.base for found in types],
                          [-1 if found.length is None else found.length for found in types], examples,
                          list(constants), list(constants.values()))


def definitions(kind: Any, find_class: Callable[[str], Any]) -> List[TypeDefinition]:
    """Return the definition of a class and of all types in it, each once.

    Parameters
    ----------
    kind : type
        Class of a message, request or response.
    find_class : callable
        Returns the class of a message type.
    """
    found = {kind._type: _of_class(kind)}
    waiting = list(found[kind._type].fieldtypes)
    while waiting:
        name = waiting.pop(0)
        if name in found or parse(name).primitive:
            continue
        found[name] = _of_time(name) if name in TIMES else _of_class(find_class(name))
        waiting = found[name].fieldtypes + waiting
    return list(found.values())

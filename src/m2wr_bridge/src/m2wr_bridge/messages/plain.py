# SPDX-License-Identifier: BSD-3-Clause
"""ROS messages as plain values: dictionaries, lists, numbers, texts and bytes, for JSON and CBOR."""
from __future__ import annotations

import struct
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple

import cbor2

from m2wr_bridge.messages.field_types import OCTETS, TIMES, parse

#: Returns the class of a message type, such as ``std_msgs/Header``; raises BridgeError.
FindClass = Callable[[str], Any]
_Convert = Optional[Callable[[Any], Any]]        # None: the value is plain already
#: Tags of typed arrays, little-endian (RFC 8746, 2.1), and their letter in struct.
_TAGS = {"uint16": (69, "H"), "uint32": (70, "I"), "uint64": (71, "Q"), "int8": (72, "b"), "byte": (72, "b"),
         "int16": (77, "h"), "int32": (78, "i"), "int64": (79, "q"), "float32": (85, "f"), "float64": (86, "d")}


def typed_array(base: str, values: Sequence[Any]) -> Any:
    """Return an array as CBOR has it: bytes, a tagged typed array, or a list.

    Parameters
    ----------
    base : str
        Type of the elements.
    values : sequence
    """
    if base in OCTETS:
        return bytes(values)
    if base not in _TAGS:
        return list(values)
    tag, letter = _TAGS[base]
    return cbor2.CBORTag(tag, struct.pack("<%d%s" % (len(values), letter), *values))


def plain_array(base: str, values: Sequence[Any]) -> Any:
    """Return an array as JSON has it: octets are bytes, which become base64; else the sequence as it is.

    Parameters
    ----------
    base : str
        Type of the elements.
    values : sequence
    """
    return bytes(values) if base in OCTETS else values


def _time(value: Any) -> Dict[str, int]:
    return {"secs": value.secs, "nsecs": value.nsecs}


class Reader:
    """Converts messages; what a type needs is found once.

    Parameters
    ----------
    find_class : callable
    array : callable
        Takes the type of the elements and a sequence of numbers; returns what stands for it.
    """

    def __init__(self, find_class: FindClass, array: Callable[[str, Sequence[Any]], Any] = plain_array) -> None:
        self._find_class, self._array = find_class, array
        self._fields: Dict[str, List[Tuple[str, _Convert]]] = {}

    def plain(self, message: Any) -> Dict[str, Any]:
        """Return a message as a dictionary.

        Raises
        ------
        BridgeError
            If the class of a field's type is not there.
        """
        fields = self._fields.get(message._type)
        if fields is None:
            fields = self._read_class(type(message))
        return self._object(fields, message)

    @staticmethod
    def _object(fields: List[Tuple[str, _Convert]], message: Any) -> Dict[str, Any]:
        return {name: getattr(message, name) if convert is None else convert(getattr(message, name))
                for name, convert in fields}

    def _read_class(self, kind: Any) -> List[Tuple[str, _Convert]]:
        fields = self._fields[kind._type] = [
            (name, self._convert(text)) for name, text in zip(kind.__slots__, kind._slot_types)]
        return fields

    def _convert(self, text: str) -> _Convert:
        base, length = parse(text)
        if parse(text).primitive:
            if length is None:
                return None
            return lambda values: self._array(base, values)
        if base in TIMES:
            one: Callable[[Any], Any] = _time
        else:
            fields = self._fields.get(base)
            inner = self._read_class(self._find_class(base)) if fields is None else fields
            one = lambda value: self._object(inner, value)      # noqa: E731
        return one if length is None else lambda values: [one(value) for value in values]

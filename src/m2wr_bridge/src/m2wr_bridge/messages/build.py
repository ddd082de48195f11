# SPDX-License-Identifier: BSD-3-Clause
"""ROS messages from plain values, each value checked against the type of its field."""
from __future__ import annotations

import base64
import binascii
import math
from typing import Any, Callable, Dict, List, NamedTuple, Tuple

import genpy

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.messages.field_types import INTEGERS, OCTETS, REALS, TIMES, FieldType, parse
from m2wr_bridge.messages.plain import FindClass

_EXACT = 2.0 ** 53          # up to here every whole float is an exact integer
_SHOWN = 60                 # characters of a value in an error


class _Field(NamedTuple):
    name: str
    type: FieldType
    text: str


def _wrong(where: str, expected: str, value: Any) -> str:
    """Return what is wrong with a value."""
    return "%s: expected %s, got %s" % (where, expected, repr(value)[:_SHOWN])


def _integer(base: str, value: Any, where: str) -> int:
    least, most = INTEGERS[base]
    if isinstance(value, float) and value.is_integer() and abs(value) <= _EXACT:
        value = int(value)
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
        raise BridgeError(_wrong(where, "%s, a whole number from %d to %d" % (base, least, most), value))
    return value


def _real(base: str, value: Any, where: str) -> float:
    if value is None:               # JSON has no other way to write a number that is not finite
        return math.nan
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise BridgeError(_wrong(where, base, value))
    if abs(value) > REALS[base] and value not in (math.inf, -math.inf):
        raise BridgeError(_wrong(where, "%s, at most %g" % (base, REALS[base]), value))
    return float(value)


def _scalar(base: str, value: Any, where: str) -> Any:
    if base in INTEGERS:
        return _integer(base, value, where)
    if base in REALS:
        return _real(base, value, where)
    expected = bool if base == "bool" else str
    if not isinstance(value, expected):
        raise BridgeError(_wrong(where, base, value))
    return value


def _octets(value: Any, where: str) -> bytes:
    if isinstance(value, bytes):
        return value
    if isinstance(value, str):
        try:
            return base64.b64decode(value, validate=True)
        except (binascii.Error, ValueError):
            raise BridgeError(_wrong(where, "base64, or an array of numbers", value)) from None
    if not isinstance(value, list):
        raise BridgeError(_wrong(where, "base64, or an array of numbers", value))
    try:
        return bytes(value)
    except (TypeError, ValueError):
        raise BridgeError(_wrong(where, "numbers from 0 to 255", value)) from None


class Builder:
    """Makes messages; what a type needs is found once.

    Parameters
    ----------
    find_class : callable
        Returns the class of a message type; raises BridgeError.
    now : callable
        Returns (seconds, nanoseconds) of ROS time, for the stamp of a header that has none and for the time "now".
    """

    def __init__(self, find_class: FindClass, now: Callable[[], Tuple[int, int]]) -> None:
        self._find_class, self._now = find_class, now
        self._fields: Dict[str, Dict[str, _Field]] = {}

    def build(self, kind: Any, values: Any, where: str = "msg") -> Any:
        """Return a message; fields that are not given keep the default value.

        Parameters
        ----------
        kind : type
            Class of the message.
        values : dict
        where : str
            Name of the values in errors.

        Raises
        ------
        BridgeError
            If a value does not fit its field, or the type has no such field.
        """
        if not isinstance(values, dict):
            raise BridgeError(_wrong(where, "an object with fields of %s" % kind._type, values))
        fields = self._fields.get(kind._type)
        if fields is None:
            fields = self._fields[kind._type] = {
                name: _Field(name, parse(text), text) for name, text in zip(kind.__slots__, kind._slot_types)}
        message = kind()
        if kind._type == "std_msgs/Header" and "stamp" not in values:
            message.stamp.secs, message.stamp.nsecs = self._now()
        for name, value in values.items():
            field = fields.get(name)
            if field is None:
                raise BridgeError("%s: %s has no field %r; expected %s" % (
                    where, kind._type, str(name)[:_SHOWN], ", ".join(fields) or "no fields"))
            setattr(message, name, self._value(field, value, getattr(message, name), "%s.%s" % (where, name)))
        return message

    def from_arguments(self, kind: Any, values: Any) -> Any:
        """Return the request of a service from its arguments.

        Parameters
        ----------
        kind : type
            Class of the request.
        values : dict, list or None
            A list has the fields in their order.

        Raises
        ------
        BridgeError
            If a value does not fit.
        """
        if values is None:
            values = {}
        if isinstance(values, list):
            if len(values) > len(kind.__slots__):
                raise BridgeError(_wrong("args", "at most %d values" % len(kind.__slots__), values))
            values = dict(zip(kind.__slots__, values))
        return self.build(kind, values, "args")

    def _value(self, field: _Field, value: Any, default: Any, where: str) -> Any:
        base, length = field.type
        if length is None:
            if field.type.primitive:
                return _scalar(base, value, where)
            return self._time(base, value, default, where) if base in TIMES else \
                self.build(self._find_class(base), value, where)
        if base in OCTETS:
            made: Any = _octets(value, where)
        elif not isinstance(value, list):
            raise BridgeError(_wrong(where, field.text, value))
        else:
            made = self._elements(base, value, where)
        if length and len(made) != length:
            raise BridgeError("%s: expected %s, got %d elements" % (where, field.text, len(made)))
        return made

    def _elements(self, base: str, values: List[Any], where: str) -> List[Any]:
        if base in REALS and base == "float64" and set(map(type, values)) == {float}:
            return values                   # the usual case, without a call for each element
        if parse(base).primitive:
            return [_scalar(base, value, where) for value in values]
        kind = None if base in TIMES else self._find_class(base)
        inner = _Field("", FieldType(base, None), base)
        return [self._value(inner, value, None, "%s[%d]" % (where, index)) if kind is None else
                self.build(kind, value, "%s[%d]" % (where, index)) for index, value in enumerate(values)]

    def _time(self, base: str, value: Any, default: Any, where: str) -> Any:
        made = genpy.Time() if base == "time" else genpy.Duration()
        if value == "now" and base == "time":
            made.secs, made.nsecs = self._now()
            return made
        if not isinstance(value, dict) or not set(value) <= {"secs", "nsecs", "sec", "nsec", "nanosec"}:
            raise BridgeError(_wrong(where, 'a %s, {"secs": whole number, "nsecs": whole number}' % base, value))
        parts = ("uint32", "uint32") if base == "time" else ("int32", "int32")
        made.secs = _integer(parts[0], value.get("secs", value.get("sec", 0)), where + ".secs")
        made.nsecs = _integer(parts[1], value.get("nsecs", value.get("nsec", value.get("nanosec", 0))),
                              where + ".nsecs")
        made.canon()
        return made

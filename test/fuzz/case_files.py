# SPDX-License-Identifier: BSD-3-Clause
"""Cases in files: JSON, where types that JSON lacks are objects with one key.

``{"bytes": BASE64}``, ``{"tuple": [...]}``, ``{"dict": [[KEY, VALUE], ...]}`` and ``{"float": "nan"}``.  Reading
creates only plain values, so a file from another person is as safe as a text.
"""
import base64
import binascii
import json
import math
import os

MOST_BYTES = 64 * 2 ** 20       # of a file; cases are at most some 100 kB
_FLOATS = {"nan": math.nan, "inf": math.inf, "-inf": -math.inf}


class CaseError(Exception):
    """A file does not contain a case."""


def write_case(path, case):
    """Write a case: numbers, texts, bytes, None, and lists, tuples and dicts of such."""
    with open(path, "w", encoding="ascii") as stream:
        json.dump(_plain(case), stream)
        stream.write("\n")


def read_case(path):
    """Return the case in a file.

    Raises
    ------
    CaseError
        If it cannot be read, is too large, or does not have the format of :func:`write_case`.
    """
    try:
        size = os.path.getsize(path)
        if size > MOST_BYTES:
            raise CaseError("%s: %d bytes; expected at most %d" % (path, size, MOST_BYTES))
        with open(path, encoding="ascii") as stream:
            return _value(json.loads(stream.read(MOST_BYTES)))
    except (OSError, ValueError, RecursionError) as error:
        raise CaseError("%s: %s; expected a case written by the fuzzer" % (path, error)) from error


def _plain(value):
    if isinstance(value, bytes):
        return {"bytes": base64.b64encode(value).decode()}
    if isinstance(value, tuple):
        return {"tuple": [_plain(entry) for entry in value]}
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    if isinstance(value, dict):
        return {"dict": [[_plain(key), _plain(entry)] for key, entry in value.items()]}
    if isinstance(value, float) and not math.isfinite(value):
        return {"float": "%g" % value}
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    raise TypeError("a case cannot hold a %s" % type(value).__name__)


def _value(plain):
    if isinstance(plain, list):
        return [_value(entry) for entry in plain]
    if not isinstance(plain, dict):
        return plain
    (kind, content), = plain.items() if len(plain) == 1 else [(None, None)]
    try:
        if kind == "bytes":
            return base64.b64decode(content, validate=True)
        if kind == "tuple":
            return tuple(_value(entry) for entry in content)
        if kind == "dict":
            return {_value(key): _value(entry) for key, entry in content}
        if kind == "float":
            return _FLOATS[content]
    except (TypeError, KeyError, binascii.Error) as error:
        raise ValueError("%s in a \"%s\"" % (error, kind)) from error
    raise ValueError("an object with the keys %s" % ", ".join(sorted(plain)))

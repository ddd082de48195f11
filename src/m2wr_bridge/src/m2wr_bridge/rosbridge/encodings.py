# SPDX-License-Identifier: BSD-3-Clause
"""How a message is sent to a client: JSON, JSON in a PNG picture, or CBOR."""
from __future__ import annotations

import base64
import io
import json
import math
from typing import Any, Dict

import cbor2
import msgspec
from PIL import Image

from m2wr_bridge.errors import BridgeError

COMPRESSIONS = ("none", "png", "cbor", "cbor-raw")
_CHANNELS = 3               # bytes of a pixel, RGB
_FILLER = b"\n"             # JSON ignores it


def json_text(value: Any) -> str:
    """Return a value as JSON; numbers that are not finite are null, bytes are base64.

    Raises
    ------
    BridgeError
        If a text in it cannot be written as UTF-8.
    """
    try:
        return msgspec.json.encode(value).decode("utf-8")
    except (UnicodeError, TypeError, RecursionError, msgspec.MsgspecError) as error:
        raise BridgeError("a message cannot be written as JSON: %s" % error) from None


def cbor_bytes(value: Any) -> bytes:
    """Return a value as CBOR."""
    return cbor2.dumps(value)


def png_text(text: str, name: Any = None) -> str:
    """Return a message of the operation ``png``: the bytes of a text are the pixels of a picture.

    Parameters
    ----------
    text : str
    name : str, int or None
        Id of the message.
    """
    data = text.encode("utf-8")
    pixels = math.ceil(len(data) / _CHANNELS)
    width = max(1, math.isqrt(pixels))
    height = math.ceil(pixels / width)
    picture = Image.frombytes("RGB", (width, height), data.ljust(width * height * _CHANNELS, _FILLER))
    stream = io.BytesIO()
    picture.save(stream, format="png")
    fields: Dict[str, Any] = {"op": "png", "data": base64.b64encode(stream.getvalue()).decode("ascii")}
    if name is not None:
        fields["id"] = name
    return json.dumps(fields)

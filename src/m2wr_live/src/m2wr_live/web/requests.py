# SPDX-License-Identifier: BSD-3-Clause
"""What a page's own script sends: how to drive, as JSON."""
from __future__ import annotations

import json
import math
from typing import NamedTuple

from m2wr_view.errors import ViewError

LONGEST = 1000              # characters of a message


class Drive(NamedTuple):
    """How far the keys or the joystick are pressed: ``forward`` and ``left`` from -1 to 1, for a topic."""

    topic: str
    forward: float
    left: float


def read_drive(text: object) -> Drive:
    """Return what a message asks for.

    Raises
    ------
    ViewError
        If it is not ``{"topic": text, "forward": number, "left": number}`` with numbers from -1 to 1.
    """
    expected = "expected {\"topic\": text, \"forward\": -1 to 1, \"left\": -1 to 1}"
    if not isinstance(text, str) or len(text) > LONGEST:
        size = "%d characters" % len(text) if isinstance(text, str) else "bytes"
        raise ViewError("a page sent %s; %s" % (size, expected))
    try:
        fields = json.loads(text)
    except (ValueError, RecursionError):
        raise ViewError("a page sent %r; %s" % (text[:60], expected)) from None
    if not isinstance(fields, dict):
        raise ViewError("a page sent %r; %s" % (text[:60], expected))
    topic, numbers = fields.get("topic"), [fields.get("forward"), fields.get("left")]
    values = [float(number) for number in numbers
              if isinstance(number, (int, float)) and not isinstance(number, bool) and abs(number) <= 1.0
              and math.isfinite(number)]
    if not isinstance(topic, str) or len(values) != 2:
        raise ViewError("a page sent %r; %s" % (text[:60], expected))
    return Drive(topic, values[0], values[1])

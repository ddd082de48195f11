# SPDX-License-Identifier: BSD-3-Clause
"""Who can hear whom: a radio of limited range, by which robots pass on what they hear."""
from __future__ import annotations

import json
import math
from typing import Any, Dict, FrozenSet, List, Mapping, Tuple

MOST_BYTES = 20000          # of one message
BASE = "base"               # name of the station at the charger


def groups(places: Mapping[str, Tuple[float, float]], reach: float) -> List[FrozenSet[str]]:
    """Return who is connected, directly or by others in between, as disjoint sets of names.

    Parameters
    ----------
    places : mapping of str to (float, float)
        Of all radios [m].
    reach : float
        Greatest distance of two radios that hear each other [m].
    """
    left, found = set(places), []
    while left:
        group, new = set(), {min(left)}
        while new:
            group |= new
            near = {other for other in left - group for name in new
                    if math.hypot(places[other][0] - places[name][0], places[other][1] - places[name][1]) <= reach}
            new = near
        left -= group
        found.append(frozenset(group))
    return found


def encode(message: Mapping[str, Any]) -> str:
    """Return a message as JSON."""
    return json.dumps(message, separators=(",", ":"), sort_keys=True)


def decode(text: str) -> Dict[str, Any]:
    """Return a message from JSON.

    Raises
    ------
    ValueError
        If it is too long, no JSON object, or has a number that is not finite.
    """
    if len(text) > MOST_BYTES:
        raise ValueError("a radio message of {} bytes; expected at most {}".format(len(text), MOST_BYTES))

    def refuse(name: str) -> None:
        raise ValueError("a radio message has the number {}; expected finite ones".format(name))

    try:
        message = json.loads(text, parse_constant=refuse)
    except RecursionError:
        raise ValueError("a radio message is nested too deeply") from None
    if not isinstance(message, dict):
        raise ValueError("a radio message is {}; expected a JSON object".format(type(message).__name__))
    return message

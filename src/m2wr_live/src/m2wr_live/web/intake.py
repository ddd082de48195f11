# SPDX-License-Identifier: BSD-3-Clause
"""Reads what pages send to viser, with limits.

viser trusts its pages: an update of a control may set any attribute of it and is passed on to all other pages, an
upload is kept in memory without a limit, and each message starts a task at once. So only the messages that this
package's pages need are read, an update may only set a value, and a page that floods is read slowly. All that uses
private parts of viser is here, in :mod:`m2wr_live.web.layers`, :mod:`m2wr_live.web.windows` and
:mod:`m2wr_live.web.server`; its version is pinned.
"""
from __future__ import annotations

import asyncio
import logging
import math
from typing import Any, Callable, Dict, Set

import msgspec

log = logging.getLogger("m2wr_live")

LONGEST = 1000              # characters of a text that a control takes
_PERIOD = 1.0 / 200.0       # s; a page is read at most this often on average
_BURST = 50                 # messages that are read without waiting after a pause; a drag sends two a picture
_MOST_COMPLAINTS = 20       # different refusals of a page that are logged
_GIZMO = {"name": "text", "wxyz": 4, "position": 3}
#: Messages that are read: type -> fields that are checked: how many numbers, or "text".
_READ: Dict[str, Dict[str, object]] = {
    "ViewerCameraMessage": {"wxyz": 4, "position": 3, "look_at": 3, "up_direction": 3},
    "GuiUpdateMessage": {"uuid": "text"}, "ScenePointerMessage": {}, "TransformControlsUpdateMessage": _GIZMO,
    "TransformControlsDragStartMessage": {"name": "text"}, "TransformControlsDragEndMessage": {"name": "text"}}
#: Messages that viser's page sends and nothing here needs.
_IGNORED = ("FileTransferPartAck", "GetRenderResponseMessage", "LocalStorageGetItemResponseMessage",
            "GuiButtonHoldMessage")


class Refused(Exception):
    """A message of a page is not read; the text says why."""


def check(fields: object) -> bool:
    """Return whether a message is to be read; false: nothing needs messages of its type.

    Parameters
    ----------
    fields : object
        The decoded message.

    Raises
    ------
    Refused
        If it is none that a page needs.
    """
    kind = fields.get("type") if isinstance(fields, dict) else None
    if kind in _IGNORED:
        return False
    if not isinstance(fields, dict) or not isinstance(kind, str) or kind not in _READ:
        raise Refused("a message of type %s; expected one of %s" % (repr(kind)[:60], ", ".join(sorted(_READ))))
    for name, wanted in _READ[kind].items():
        if not (_is_text(fields.get(name)) if wanted == "text" else _are_numbers(fields.get(name), wanted)):
            raise Refused("%s: field %s is %s; expected %s" % (
                kind, name, repr(fields.get(name))[:60],
                "a text" if wanted == "text" else "%s finite numbers" % wanted))
    if kind == "GuiUpdateMessage":
        _check_update(fields.get("updates"))
    return True


def _check_update(updates: object) -> None:
    """Raise Refused if an update of a control sets anything but its value."""
    if not isinstance(updates, dict) or set(updates) != {"value"}:
        raise Refused("an update of %s; expected {\"value\": ...}" % repr(updates)[:60])
    value = updates["value"]
    number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not (isinstance(value, bool) or _is_text(value) or number and math.isfinite(value)):
        raise Refused("a value %s; expected a truth value, a finite number, or a text of at most %d characters" % (
            repr(value)[:60], LONGEST))


def _is_text(value: object) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST


def _are_numbers(values: object, count: object) -> bool:
    return isinstance(values, (list, tuple)) and len(values) == count and all(
        isinstance(value, (int, float)) and not isinstance(value, bool) and math.isfinite(value) for value in values)


class Pace:
    """Says how long to wait before the next message is read.

    Parameters
    ----------
    now : float
        Time of a clock that never goes back [s].
    """

    def __init__(self, now: float) -> None:
        self._due = now

    def wait(self, now: float) -> float:
        """Return for how long to wait after a message [s]."""
        self._due = max(self._due, now - _BURST * _PERIOD) + _PERIOD
        return max(0.0, self._due - now)


async def take_messages(page: Any, handle: Callable[[Any], None], message_class: Any) -> None:
    """Read what a page sends until it is closed, in place of viser's function of these arguments.

    Parameters
    ----------
    page
        Connection of websockets.
    handle : callable
        Takes a message.
    message_class : type
        Of viser, with ``deserialize``.
    """
    complaints: Set[str] = set()
    clock = asyncio.get_running_loop().time
    pace = Pace(clock())
    while True:
        data = await page.recv()
        try:
            if not isinstance(data, bytes):
                raise Refused("text; expected bytes")
            if check(msgspec.msgpack.decode(data)):
                handle(message_class.deserialize(data))
        except Exception as error:      # the bytes may be anything; the page and the others continue
            _complain(str(error) if isinstance(error, Refused) else "%s: %s" % (type(error).__name__, error),
                      complaints)
        await asyncio.sleep(pace.wait(clock()))


def _complain(text: str, complaints: Set[str]) -> None:
    """Log a refusal, each text once for a page."""
    if text not in complaints and len(complaints) < _MOST_COMPLAINTS:
        complaints.add(text)
        log.warning("a page sent %s", text[:300])

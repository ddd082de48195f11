# SPDX-License-Identifier: BSD-3-Clause
"""Parameters as JSON."""
from __future__ import annotations

from typing import Any, List

import msgspec

from m2wr_bridge.errors import BridgeError
from m2wr_bridge.rosbridge.encodings import json_text
from m2wr_bridge.rosbridge.globs import Globs

_LONGEST = 10_000_000       # characters of a value


def _value_of(text: str) -> Any:
    """Return what a text is in JSON; a text that is no JSON stands for itself."""
    if len(text) > _LONGEST:
        raise BridgeError("a value of %d characters; expected at most %d" % (len(text), _LONGEST))
    try:
        return msgspec.json.decode(text)
    except RecursionError:
        raise BridgeError("a value is nested too deep") from None
    except (msgspec.MsgspecError, ValueError, UnicodeError):
        return text


class Parameters:
    """The parameters that pages may use.

    Parameters
    ----------
    server : object
        With the functions ``get_param``, ``set_param``, ``has_param``, ``delete_param``, ``search_param`` and
        ``get_param_names`` of rospy.
    allowed : Globs
    """

    def __init__(self, server: Any, allowed: Globs) -> None:
        self._server, self._allowed = server, allowed

    def _check(self, name: str) -> None:
        if not name:
            raise BridgeError("the name of the parameter is empty")
        if not self._allowed.allow(name):
            raise BridgeError("parameter %s is not among the names that ~params_glob allows" % name[:200])

    def get(self, name: str, default: str) -> str:
        """Return the value as JSON, or the default, or null.

        Parameters
        ----------
        name : str
        default : str
            JSON, or a text; empty: none.
        """
        self._check(name)
        return json_text(self._server.get_param(name, _value_of(default) if default else None))

    def set(self, name: str, value: str) -> None:
        """Set a parameter.

        Parameters
        ----------
        name : str
        value : str
            JSON, or a text.

        Raises
        ------
        BridgeError
            If the value is null or too long, or the name is not allowed.
        """
        self._check(name)
        made = _value_of(value)
        if made is None:
            raise BridgeError("parameter %s: null is no value of a parameter" % name[:200])
        self._server.set_param(name, made)

    def has(self, name: str) -> bool:
        """Return whether a parameter is there."""
        self._check(name)
        return bool(self._server.has_param(name))

    def delete(self, name: str) -> None:
        """Delete a parameter; none is no error."""
        self._check(name)
        if self._server.has_param(name):
            self._server.delete_param(name)

    def search(self, name: str) -> str:
        """Return the full name of the parameter that is nearest, or an empty text."""
        self._check(name)
        return self._server.search_param(name) or ""

    def names(self) -> List[str]:
        """Return the names of all parameters."""
        return [name for name in self._server.get_param_names() if self._allowed.allow(name)]

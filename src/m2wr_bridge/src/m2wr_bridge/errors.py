# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this package."""


class BridgeError(Exception):
    """A request cannot be done; the text says what was read, where, and what was expected."""


def unexpected(error: Exception) -> str:
    """Return the text for an error that no check has foreseen."""
    return "%s: %s" % (type(error).__name__, str(error)[:500])

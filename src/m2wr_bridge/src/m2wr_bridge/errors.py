# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this package."""


class BridgeError(Exception):
    """A request cannot be done; the text says what was read, where, and what was expected."""

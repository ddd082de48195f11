# SPDX-License-Identifier: BSD-3-Clause
"""Errors of this package."""


class ViewError(Exception):
    """Something cannot be read or drawn; the text says what was read, where, and what was expected."""

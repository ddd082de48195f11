# SPDX-License-Identifier: BSD-3-Clause
"""What can go wrong with pictures."""


class ViewError(Exception):
    """Something cannot be read or drawn; the text says what was read, where, and what was expected."""

# SPDX-License-Identifier: BSD-3-Clause
"""Numbers as parameter files write them."""
from __future__ import annotations

import re
from typing import Union

# What YAML 1.1 leaves a string because it expects a dot and a signed exponent: 1e-3, 5E2, 1.5e3.
_EXPONENTIAL = re.compile(r"[-+]?([0-9]+[eE][-+]?|([0-9]+\.[0-9]*|\.[0-9]+)[eE][-+]?)[0-9]+")


def number(value: object) -> Union[int, float, None]:
    """Return a parameter's value as a number.

    Parameters
    ----------
    value : object
        As the parameter server holds it.

    Returns
    -------
    int, float or None
        A number unchanged; a string that YAML does not read as a number although it is one, such as ``1e-3``, as a
        float; None for anything else, truth values included.
    """
    if isinstance(value, str) and _EXPONENTIAL.fullmatch(value):
        return float(value)
    return value if isinstance(value, (int, float)) and not isinstance(value, bool) else None

# SPDX-License-Identifier: BSD-3-Clause
"""Arguments of a command line."""
from __future__ import annotations

import re
from decimal import Decimal


def without_exponent(word: str) -> str:
    """Rewrite a negative number such as -1e-05 without exponent, because argparse would take it for an option."""
    if re.match(r"-(\d+\.?\d*|\.\d+)[eE][+-]?\d{1,3}$", word):
        return format(Decimal(word), "f")
    return word

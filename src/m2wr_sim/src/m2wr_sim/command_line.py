# SPDX-License-Identifier: BSD-3-Clause
"""Words of a command line."""
import re
from decimal import Decimal


def without_exponent(word):
    """Write a negative number such as -1e-05 as argparse knows it; it takes that for an option otherwise."""
    if re.match(r"-(\d+\.?\d*|\.\d+)[eE][+-]?\d{1,3}$", word):
        return format(Decimal(word), "f")
    return word

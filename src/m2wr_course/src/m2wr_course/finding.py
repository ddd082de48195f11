# SPDX-License-Identifier: BSD-3-Clause
"""What a check hands out: one line for each thing it has looked at."""
from dataclasses import dataclass


@dataclass(frozen=True)
class Finding:
    """One thing that was looked at.

    Attributes
    ----------
    right : bool
        Whether it is as asked.
    text : str
        What was measured or read.
    cure : str
        What to do where it is not right.
    """

    right: bool
    text: str
    cure: str = ""

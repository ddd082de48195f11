# SPDX-License-Identifier: BSD-3-Clause
"""All constants of the mapper's ``tuning``, and the values that follow from them, as a list."""
from __future__ import annotations

from dataclasses import fields
from typing import Any, Iterator, NamedTuple

from m2wr_gmapping import tuning


class Constant(NamedTuple):
    """One tuned constant, or a value that follows from some; its source is then empty.

    Attributes
    ----------
    group, name : str
        Such as MATCHING and narrow.
    value : float, int or tuple
    unit : str
        1 for numbers without one; of tuples all units, separated by commas.
    meaning, source : str
    """

    group: str
    name: str
    value: Any
    unit: str
    meaning: str
    source: str


def constants() -> Iterator[Constant]:
    """Yield all tuned constants with their present values."""
    for group in tuning.GROUPS:
        present = getattr(tuning, group)
        for one in fields(present):
            yield Constant(group, one.name, getattr(present, one.name), **one.metadata)


def derived() -> Iterator[Constant]:
    """Yield the values that follow from the constants; the meaning is the docstring of the property."""
    for group in tuning.GROUPS:
        present = getattr(tuning, group)
        for name, found in vars(type(present)).items():
            if isinstance(found, property):
                first, _, more = " ".join(str(found.__doc__).split()).partition("].")
                meaning, _, unit = first.rpartition(" [")
                yield Constant(group, name, getattr(present, name), unit, meaning + "." + more, "")

# SPDX-License-Identifier: BSD-3-Clause
"""The result of one check."""
from __future__ import annotations

from typing import Iterable, NamedTuple

OK, WARNING, PROBLEM = "ok", "warning", "problem"
LEVELS = (OK, WARNING, PROBLEM)     # their places are the exit codes


class Finding(NamedTuple):
    """``area``: installation, environment, master, display, frames or topics; ``cure``: what to do, empty for ok."""

    area: str
    level: str
    what: str
    cure: str


def ok(area: str, what: str, *words: object) -> Finding:
    """Return a Finding without a fault.

    Parameters
    ----------
    area : str
        Area of the check.
    what : str
        What was found, one sentence.
    *words : object
        For the ``%`` in ``what``.
    """
    return Finding(area, OK, what % words if words else what, "")


def warning(area: str, what: str, cure: str) -> Finding:
    """Return a Finding of something that may cause trouble.

    Parameters
    ----------
    area : str
        Area of the check.
    what : str
        What was found, one sentence.
    cure : str
        What to do about it.
    """
    return Finding(area, WARNING, what, cure)


def problem(area: str, what: str, cure: str) -> Finding:
    """Return a Finding of something that will cause trouble.

    Parameters
    ----------
    area : str
        Area of the check.
    what : str
        What was found, one sentence.
    cure : str
        What to do about it.
    """
    return Finding(area, PROBLEM, what, cure)


def worst(findings: Iterable[Finding]) -> str:
    """Return the worst level of some findings."""
    return max((finding.level for finding in findings), key=LEVELS.index, default=OK)


def some(names: Iterable[str], most: int = 6) -> str:
    """Return names as a list in text, the first few if there are many.

    Parameters
    ----------
    names : iterable of str
        In any order; they are sorted.
    most : int
        Largest number of names.
    """
    ordered = sorted(names)
    rest = len(ordered) - most
    return ", ".join(ordered[:most]) + (" and %d more" % rest if rest > 0 else "")

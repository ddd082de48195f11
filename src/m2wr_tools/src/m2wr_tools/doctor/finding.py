# SPDX-License-Identifier: BSD-3-Clause
"""One thing that was looked at."""
from collections import namedtuple

OK, WARNING, PROBLEM = "ok", "warning", "problem"
LEVELS = (OK, WARNING, PROBLEM)     # their places are the exit codes

Finding = namedtuple("Finding", "area level what cure")
"""``area``: installation, environment, master, display, frames or topics; ``cure``: what to do, empty for ok."""


def ok(area, what, *words):
    """Return a Finding that all is well."""
    return Finding(area, OK, what % words if words else what, "")


def warning(area, what, cure):
    """Return a Finding of something that may hinder."""
    return Finding(area, WARNING, what, cure)


def problem(area, what, cure):
    """Return a Finding of something that will hinder."""
    return Finding(area, PROBLEM, what, cure)


def worst(findings):
    """Return the worst level of some findings."""
    return max((finding.level for finding in findings), key=LEVELS.index, default=OK)


def some(names, most=6):
    """Return names in a row, the first few of many."""
    names = sorted(names)
    rest = len(names) - most
    return ", ".join(names[:most]) + (" and %d more" % rest if rest > 0 else "")

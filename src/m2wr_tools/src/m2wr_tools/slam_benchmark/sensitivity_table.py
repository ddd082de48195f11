# SPDX-License-Identifier: BSD-3-Clause
"""Table of the sensitivity: what half and twice each tuned constant does to the errors."""
from __future__ import annotations

from typing import Any, Dict, List, Optional

import numpy as np

from m2wr_tools.slam_benchmark.benchmark_table import CLOSED
from m2wr_tools.slam_benchmark.tuning_table import text_of

#: Errors (metres at loop closures) of a variation by log; None for one that has failed.
Errors = Dict[str, Optional[float]]

SAME = 0.01, 0.0005         # smaller changes of an error are none: share, and [m]
WORSE = 1.5                 # a median error that grows by this factor breaks a constant


def summary(errors: Errors) -> Dict[str, float]:
    """Return median and worst error [m] of a variation, and how many logs are lost; a failed run is lost."""
    found = [float("inf") if error is None else error for error in errors.values()]
    if not found:
        return {}
    return dict(median=float(np.median(found)), worst=max(found), lost=sum(not error <= CLOSED for error in found))


def moves(base: Errors, other: Errors) -> bool:
    """Return whether any log has another error.

    Parameters
    ----------
    base, other : dict
        Errors of two variations.
    """
    for log, error in other.items():
        before = base.get(log)
        if before is None or error is None:
            if before is not error:
                return True
        elif abs(error - before) > max(SAME[0] * before, SAME[1]):
            return True
    return False


def breaks(base: Errors, other: Errors) -> bool:
    """Return whether a log is lost that was not, or the median grows by half.

    Parameters
    ----------
    base, other : dict
        Errors before and after a change.
    """
    before, after = summary(base), summary(other)
    if not before or not after:
        return False
    closed = {log for log, error in base.items() if error is not None and error <= CLOSED}
    still = {log for log, error in other.items() if error is not None and error <= CLOSED}
    return bool(closed - still or after["median"] > WORSE * before["median"])


def _cell(errors: Optional[Errors]) -> str:
    found = summary(errors or {})
    return "{median:.3f}, {worst:.2f}, {lost}".format(**found) if found else ""


def mark(base: Errors, others: List[Errors]) -> str:
    """Return what the table says about a constant.

    Parameters
    ----------
    base : dict
        Errors with all values as they are.
    others : list of dict
        Errors with other values of this constant.
    """
    if any(breaks(base, other) for other in others):
        return "breaks"
    return "" if not others or any(moves(base, other) for other in others) else "moves nothing"


def markdown(base: Errors, rows: List[Dict[str, Any]], factors: List[float]) -> str:
    """Return the table.

    Parameters
    ----------
    base : dict
        Errors with all values as they are.
    rows : list of dict
        ``constant``, ``value``, ``unit``, ``errors`` {factor: dict of errors}.
    factors : list of float
    """
    head = ["constant", "value", "unit"] + ["x {:g}".format(factor) for factor in factors] + ["mark"]
    lines = ["Errors at loop closures: median [m], worst [m], logs lost (above {:g} m).".format(CLOSED),
             "All values as they are, {} logs: {}".format(len(base), _cell(base)), "",
             "| {} |".format(" | ".join(head)), "|" + "---|" * len(head)]
    for row in rows:
        others = [row["errors"][factor] for factor in factors if factor in row["errors"]]
        lines.append("| {} |".format(" | ".join(
            [row["constant"], text_of(row["value"]), row["unit"]]
            + [_cell(row["errors"].get(factor)) for factor in factors] + [mark(base, others)])))
    return "\n".join(lines) + "\n"

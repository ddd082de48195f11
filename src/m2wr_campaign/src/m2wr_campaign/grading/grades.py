# SPDX-License-Identifier: BSD-3-Clause
"""The table of grades: what each submission did in all worlds together."""
from __future__ import annotations

import csv
import io
from collections import Counter
from dataclasses import astuple, dataclass, fields
from typing import TYPE_CHECKING, Any, Dict, List, Optional, Sequence

if TYPE_CHECKING:
    Row = Dict[str, Any]

WIDEST = 60         # characters of a reason in the text


@dataclass(frozen=True)
class Grade:
    """One row.

    Attributes
    ----------
    submission : str
    success, runs : int
        Runs that reached the goal without a contact, of all.
    share : float
        Of success.
    contacts : int
        In all runs.
    time : float, optional
        Mean simulated time of the successes [s].
    ratio : float, optional
        Their mean length over the optimum.
    clearance : float, optional
        The least of all runs [m].
    reason : str
        The most frequent one of runs without success.
    """

    submission: str
    success: int
    runs: int
    share: float
    contacts: int
    time: Optional[float]
    ratio: Optional[float]
    clearance: Optional[float]
    reason: str


def grades(rows: Sequence[Row]) -> List[Grade]:
    """Return the grades, the best first.

    Parameters
    ----------
    rows : sequence of dict
        Runs.
    """
    groups: Dict[str, List[Row]] = {}
    for row in rows:
        groups.setdefault(row["method"], []).append(row)
    found = [_grade(name, some) for name, some in groups.items()]
    return sorted(found, key=lambda one: (-one.share, one.ratio or 0.0, one.submission))


def _grade(name: str, rows: Sequence[Row]) -> Grade:
    good = [row for row in rows if row["success"]]
    reasons = Counter(_reason(row) for row in rows if not row["success"])
    near = [row["clearance"] for row in rows if row["clearance"] is not None]
    return Grade(name, len(good), len(rows), len(good) / len(rows), sum(row["contacts"] or 0 for row in rows),
                 _mean([row["time"] for row in good]), _mean([row["ratio"] for row in good]),
                 min(near) if near else None, reasons.most_common(1)[0][0] if reasons else "")


def _reason(row: Row) -> str:
    if row["outcome"] == "reached":
        return "contacts on the way"
    return row["reason"] if row["outcome"] == "failed" else "{}: {}".format(row["outcome"], row["reason"])


def _mean(values: Sequence[Optional[float]]) -> Optional[float]:
    known = [value for value in values if value is not None]
    return sum(known) / len(known) if known else None


def as_text(found: Sequence[Grade]) -> str:
    """Return a table to read in a terminal."""
    lines = [("submission", "success", "contacts", "time s", "ratio", "clearance m", "most frequent problem")]
    for one in found:
        lines.append((one.submission, "{} of {}".format(one.success, one.runs), str(one.contacts),
                      _number(one.time, 1), _number(one.ratio, 2), _number(one.clearance, 3),
                      " ".join(one.reason.split())[:WIDEST]))
    widths = [max(len(line[k]) for line in lines) for k in range(len(lines[0]))]
    return "\n".join("  ".join(part.ljust(width) for part, width in zip(line, widths)).rstrip() for line in lines)


def _number(value: Optional[float], digits: int) -> str:
    return "-" if value is None else "{:.{}f}".format(value, digits)


def as_csv(found: Sequence[Grade]) -> str:
    """Return the table as CSV; a name that a spreadsheet would take for a formula is quoted with an apostrophe."""
    text = io.StringIO()
    writer = csv.writer(text)
    writer.writerow([field.name for field in fields(Grade)])
    for one in found:
        writer.writerow(["'" + part if isinstance(part, str) and part[:1] in "=+-@" and part else part
                         for part in astuple(one)])
    return text.getvalue()

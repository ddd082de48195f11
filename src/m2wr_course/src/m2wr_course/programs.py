# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 4: a function that reads a scan, tried on scans with all that real ones contain."""
from __future__ import annotations

import math
import runpy
from typing import Any, Callable, Iterator, List, Optional, Tuple

from m2wr_course.finding import Finding
from m2wr_sim.errors import NotFoundError

INF, NAN = math.inf, math.nan
#: What is tried: words for it, ranges, angle_min, angle_increment, and the answer (distance, angle) or None.
CASES: Tuple[Tuple[str, List[float], float, float, Optional[Tuple[float, float]]], ...] = (
    ("one thing ahead", [5.0, 2.0, 4.0], -0.5, 0.5, (2.0, 0.0)),
    ("something on the left", [5.0, 3.0, 1.5], -0.5, 0.5, (1.5, 0.5)),
    ("another number of beams", [4.0] * 100 + [0.7] + [4.0] * 259, -math.pi / 2, math.pi / 359,
     (0.7, -math.pi / 2 + 100 * math.pi / 359)),
    ("beams without an echo are inf", [INF, 3.0, INF], -0.5, 0.5, (3.0, 0.0)),
    ("readings that are no number", [NAN, 3.0, 2.5], -0.5, 0.5, (2.5, 0.5)),
    ("nothing in sight", [INF, INF, NAN], -0.5, 0.5, None),
    ("no beams at all", [], -0.5, 0.5, None),
)


def function_of(path: str, name: str, arguments: str) -> Callable[..., Any]:
    """Return a function that a student's file defines.

    Parameters
    ----------
    path : str
        Python file.  It is executed.
    name : str
        Of the function.
    arguments : str
        Of the function, for the message.

    Raises
    ------
    NotFoundError
        If the file defines no such function.
    """
    function = runpy.run_path(path).get(name)
    if not callable(function):
        raise NotFoundError("%s defines no function \"%s\"; expected def %s(%s)" % (path, name, name, arguments))
    return function


def nearest(path: str) -> Iterator[Finding]:
    """Exercise 4: ``nearest(ranges, angle_min, angle_increment)`` returns (distance, angle), or None.

    Parameters
    ----------
    path : str
        Python file that defines the function.  It is executed.

    Yields
    ------
    Finding

    Raises
    ------
    NotFoundError
        If the file defines no such function.
    """
    function = function_of(path, "nearest", "ranges, angle_min, angle_increment")
    for words, ranges, angle_min, increment, expected in CASES:
        try:
            answer = function(list(ranges), angle_min, increment)
        except Exception as error:      # the student's own code
            yield Finding(False, "%s: it raises %s: %s" % (words, type(error).__name__, error),
                          "think of what the list may hold")
            continue
        if expected is None:
            right = answer is None
        else:
            right = (isinstance(answer, (tuple, list)) and len(answer) == 2
                     and all(isinstance(value, (int, float)) for value in answer)
                     and math.isclose(answer[0], expected[0], abs_tol=1e-6)
                     and math.isclose(answer[1], expected[1], abs_tol=1e-6))
        yield Finding(right, "%s: it answers %s" % (words, _told(answer)), "expected %s" % _told(expected))


def _told(answer: Any) -> str:
    try:
        return "%.2f m at %.2f rad" % tuple(answer)
    except TypeError:
        return repr(answer)

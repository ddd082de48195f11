# SPDX-License-Identifier: BSD-3-Clause
"""Exercise 9: a rule that chooses the next frontier, tried on lists and by an exploration of a house."""
from __future__ import annotations

import math
import operator
from typing import TYPE_CHECKING, Any, Callable, Iterator, List, Tuple

from m2wr_course.finding import Finding
from m2wr_course.programs import function_of
from m2wr_exploration.explorer import PARAMETERS
from m2wr_exploration.strategies.strategy import Strategy
from m2wr_exploration.study.run import explore
from m2wr_exploration.study.scenes import named
from m2wr_exploration.study.settings import EXPLORER, navigation_parameters
from m2wr_navigation.parameters import read

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View

WORLD, SEED = "house", 9
SEEN = 0.99                 # least share of the reachable area
LONGEST = 75.0              # m: between the paths of nearest and explore_lite, see the page of the course
LIMIT = 900.0               # s of simulated time
#: What is tried: words for it, lengths of the paths [m] and sizes of the frontiers [m].
CASES: Tuple[Tuple[str, List[float], List[float]], ...] = (
    ("one frontier", [3.0], [0.5]),
    ("two equal frontiers", [2.0, 2.0], [1.0, 1.0]),
    ("the robot stands at a frontier", [0.0, 4.0], [0.3, 6.0]),
    ("many frontiers", [float(3 + number % 7) for number in range(40)], [0.5] * 40),
)
Rule = Callable[[List[float], List[float]], Any]


class _AnswerError(Exception):
    """The student's function raised, or its answer is no number of a frontier."""


def _answer(rule: Rule, paths: List[float], sizes: List[float]) -> int:
    """Return which frontier a rule chooses."""
    try:
        answer = rule(list(paths), list(sizes))
    except Exception as error:      # the student's own code
        raise _AnswerError("it raises %s: %s" % (type(error).__name__, error)) from error
    try:
        number = operator.index(answer)
    except TypeError:
        number = -1
    if not 0 <= number < len(paths):
        raise _AnswerError("it answers %r; expected a whole number from 0 to %d" % (answer, len(paths) - 1))
    return number


class _Own(Strategy):
    """The student's rule as a strategy of exploration."""

    def __init__(self, rule: Rule) -> None:
        super().__init__({})
        self.rule = rule

    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        paths, sizes = [frontier.path for frontier in frontiers], [frontier.size for frontier in frontiers]
        number = _answer(self.rule, paths, sizes)
        return [frontiers[number]] + frontiers[:number] + frontiers[number + 1:]


def short_exploration(path: str, seed: int = SEED) -> Iterator[Finding]:
    """Exercise 9: with ``choose(paths, sizes)`` a robot sees all of a house on a short path.

    Parameters
    ----------
    path : str
        Python file that defines the function.  It is executed.
    seed : int
        Of the noise of the laser.

    Yields
    ------
    Finding

    Raises
    ------
    NotFoundError
        If the file defines no such function.
    """
    rule = function_of(path, "choose", "paths, sizes")
    safe = True
    for words, paths, sizes in CASES:
        try:
            yield Finding(True, "%s: it answers %d" % (words, _answer(rule, paths, sizes)), "")
        except _AnswerError as error:
            safe = False
            yield Finding(False, "%s: %s" % (words, error), "return the number of the frontier in the lists")
    if safe:
        yield from _explored(rule, seed)


def _explored(rule: Rule, seed: int) -> Iterator[Finding]:
    place = named(WORLD, seed)
    try:
        run = explore(place, _Own(rule), read(PARAMETERS, EXPLORER, "")[0], navigation_parameters(), seed, limit=LIMIT)
    except _AnswerError as error:
        yield Finding(False, "while it explores, %s" % error, "try it with more lists of your own")
        return
    percent = math.floor(1000.0 * run.share) / 10.0
    yield Finding(run.share >= SEEN, "the robot has seen %.1f %% of the house" % percent,
                  "at least %g %% are asked for; exploration ended: %s" % (100.0 * SEEN, run.ended))
    yield Finding(run.length <= LONGEST, "its path is %.1f m long" % run.length,
                  "at most %g m are asked for: what does the robot do with a frontier beside it?" % LONGEST)
    yield Finding(not run.contacts, "contacts: %d" % run.contacts,
                  "this should not happen: tell us, with your file")

# SPDX-License-Identifier: BSD-3-Clause
"""The score of a drive: the weighted sum of all criteria, in metres of path that would be as bad."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, List, Mapping, Tuple

from m2wr_navigation import registry
from m2wr_navigation.parameters import read, unknown

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track
    from m2wr_navigation.criteria.criterion import Criterion


@dataclass(frozen=True)
class Score:
    """The score of a drive.

    Attributes
    ----------
    amounts : dict of str to float
        By criterion, in its unit.
    total : float
        The less the better [m].
    """

    amounts: Dict[str, float]
    total: float


class Scorer:
    """All criteria of the registry, with their weights.

    Parameters
    ----------
    criteria : dict of str to Criterion
        By name.
    """

    def __init__(self, criteria: Dict[str, Criterion]) -> None:
        self.criteria = criteria

    @property
    def units(self) -> Dict[str, str]:
        """Unit of each criterion's amount."""
        return {name: criterion.UNIT for name, criterion in self.criteria.items()}

    def score(self, track: Track, obstacles: ObstacleField) -> Score:
        """Return the score of a drive.

        Parameters
        ----------
        track : Track
        obstacles : ObstacleField
        """
        amounts = {name: criterion.amount(track, obstacles) for name, criterion in self.criteria.items()}
        return Score(amounts, sum(criterion.values["weight"] * criterion.costs(amounts[name])
                                  for name, criterion in self.criteria.items()))


def make_scorer(given: Mapping[str, object], place: str) -> Tuple[Scorer, List[str]]:
    """Return a scorer with the parameters of a user, and warnings about those that were not taken.

    Parameters
    ----------
    given : mapping of str to object
        By criterion, a mapping of its parameters.
    place : str
        Namespace, for messages.
    """
    criteria, warnings = {}, unknown(given, registry.CRITERIA, place)
    for name in registry.CRITERIA:
        kind, own = registry.find(registry.CRITERIA, name), given.get(name, {})
        where = place + "/" + name
        if not isinstance(own, Mapping):
            warnings.append("parameter {} is {!r}; expected weight and other parameters of the criterion".format(
                where, own))
            own = {}
        values, found = read(kind.PARAMETERS, own, where)
        warnings += found + unknown(own, kind.PARAMETERS, where)
        criteria[name] = kind(values)
    return Scorer(criteria), warnings

# SPDX-License-Identifier: BSD-3-Clause
"""Table of the generators of worlds. A new one is one file and one line here."""
from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any, Callable, Dict, Mapping, Optional, Tuple

import numpy as np

from m2wr_campaign.worlds import barn, maze, office
from m2wr_navigation.compare import scenes
from m2wr_navigation.parameters import Parameter

TRIES = 500         # with other random numbers, before a generator gives up


@dataclass(frozen=True)
class WorldGenerator:
    """A generator of worlds.

    Attributes
    ----------
    attempt : callable
        From a random generator, the values of all parameters and the radius [m] of the disc in which the robot turns,
        to a world in SDF and its ends; None: nothing connects the ends.
    parameters : dict of str to Parameter
    """

    attempt: Callable[[np.random.Generator, Mapping[str, Any], float], Optional[Tuple[str, scenes.Ends]]]
    parameters: Dict[str, Parameter]


def _scene(kind: str, random: np.random.Generator, values: Mapping[str, Any],
           radius: float) -> Optional[Tuple[str, scenes.Ends]]:
    return scenes.attempt(kind, random, radius)


GENERATORS: Dict[str, WorldGenerator] = {
    "rooms": WorldGenerator(partial(_scene, "rooms"), {}),
    "pillars": WorldGenerator(partial(_scene, "pillars"), {}),
    "maze": WorldGenerator(maze.attempt, maze.PARAMETERS),
    "office": WorldGenerator(office.attempt, office.PARAMETERS),
    "barn": WorldGenerator(barn.attempt, barn.PARAMETERS),
}


def generate(kind: str, values: Mapping[str, Any], seed: int, number: int, radius: float) -> Tuple[str, scenes.Ends]:
    """Return a world in SDF and its ends; the exact shortest path of the disc connects them.

    Parameters
    ----------
    kind : str
        Of GENERATORS.
    values : mapping of str to object
        Of all its parameters.
    seed, number : int
        The same world for the same pair.
    radius : float
        Of the disc in which the robot turns [m]; it fits through with half of ``scenes.MARGIN`` to spare.

    Raises
    ------
    ValueError
        If no world of TRIES has a way.
    """
    random = np.random.default_rng([seed, number])
    for _ in range(TRIES):
        found = GENERATORS[kind].attempt(random, values, radius)
        if found is not None:
            return found
    told = ", ".join("{} {}".format(name, value) for name, value in sorted(values.items()))
    raise ValueError("generator {}{}: no way for a disc of {:.2f} m in {} worlds".format(
        kind, " with " + told if told else "", radius, TRIES))

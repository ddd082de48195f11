# SPDX-License-Identifier: BSD-3-Clause
"""Fields of cylinders as in the BARN benchmark, in the size of the robot.

The benchmark has cells of 0.15 m, half the radius of its robot's disc; others get them in this ratio.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.barn.fields import automaton
from m2wr_navigation.barn.worlds import CELL, GOAL, START, cylinders_of
from m2wr_navigation.compare.scenes import MARGIN, world_text
from m2wr_navigation.optimum.shortest_path import NoShortestPathError, shortest_path
from m2wr_navigation.parameters import Parameter
from m2wr_view.outlines import Outline

if TYPE_CHECKING:
    from m2wr_navigation.compare.scenes import Ends

PARAMETERS = {
    "fill": Parameter(0.2, "", 0.0, 0.5, "probability that a cell is full at first"),
    "rounds": Parameter(3, "", 0, 10, "rounds of smoothing"),
    "cell": Parameter(0.0, "m", 0.0, 2.0, "side of a cell; 0: half the radius of the disc in which the robot turns"),
}


def attempt(random: np.random.Generator, values: Mapping[str, Any], radius: float) -> Optional[Tuple[str, Ends]]:
    """Return a world in SDF with its start and goal; None if nothing connects them.

    Parameters
    ----------
    random : numpy.random.Generator
    values : mapping of str to object
        Of PARAMETERS.
    radius : float
        Of the disc in which the robot turns [m].
    """
    scale = (values["cell"] or 0.5 * radius) / CELL
    placed = cylinders_of(automaton(random, values["fill"], values["rounds"]), scale)
    start, goal = (scale * START[0], scale * START[1]), (scale * GOAL[0], scale * GOAL[1])
    try:
        shortest_path([Outline(np.array([(x, y)]), size) for x, y, size in placed],
                      radius + 0.5 * MARGIN, start, goal)
    except NoShortestPathError:
        return None
    return world_text([], placed), ((start[0], start[1], START[2]), goal)

# SPDX-License-Identifier: BSD-3-Clause
"""Fields of cylinders by a cellular automaton, as in the BARN benchmark (Perille et al. 2020, arXiv 2008.13315).

30 x 30 cells, full with a probability, smoothed in rounds. The robot starts in a pen before the field and
goes through it. The benchmark has cells of 0.15 m, half the radius of its robot's disc; others get them in this ratio.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, Any, List, Mapping, Optional, Tuple

import numpy as np

from m2wr_navigation.compare.scenes import MARGIN, Ends, world_text
from m2wr_navigation.optimum.shortest_path import NoShortestPathError, shortest_path
from m2wr_navigation.parameters import Parameter
from m2wr_view.outlines import Outline

if TYPE_CHECKING:
    from numpy.typing import NDArray

CELLS = 30                          # along each side
PEN = 33                            # cells of the pen's depth: 5 m of 0.15 m
START, GOAL = (-2.0, 3.0), (-2.0, 13.0)         # m, with cells of CELL
CORNER = (-4.575, 5.075)            # m: centre of the first cell, with cells of CELL
CELL = 0.15                         # m
HEADING = 1.57                      # rad: towards the field
PARAMETERS = {
    "fill": Parameter(0.2, "", 0.0, 0.5, "probability that a cell is full at first"),
    "rounds": Parameter(3, "", 0, 10, "rounds of smoothing"),
    "cell": Parameter(0.0, "m", 0.0, 2.0, "side of a cell; 0: half the radius of the disc in which the robot turns"),
}


def automaton(fill: float, rounds: int, random: np.random.Generator) -> NDArray[np.bool_]:
    """Return the full cells (rows along x, columns along y) of a field.

    Parameters
    ----------
    fill : float
        Probability that a cell is full at first.
    rounds : int
        Of smoothing: a cell with 5 or more full neighbours of 8 becomes full, one with at most 1 empty.
    random : numpy.random.Generator
    """
    full = random.random((CELLS, CELLS)) < fill
    full[0], full[-1] = True, True
    for _ in range(rounds):
        wide = np.zeros((CELLS + 2, CELLS + 2), int)
        wide[0], wide[-1] = 1, 1            # outside of the rows counts as full, outside of the columns as empty
        wide[1:-1, 1:-1] = full
        around = sum(wide[1 + i:CELLS + 1 + i, 1 + j:CELLS + 1 + j]
                     for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0))
        full = np.where(around >= 5, True, np.where(around <= 1, False, full))
    return full


def pillars(full: NDArray[np.bool_], scale: float) -> List[Tuple[float, float, float]]:
    """Return the cylinders (centre x, y, radius [m]) of a field and its pen; enclosed cells have none.

    Parameters
    ----------
    full : (CELLS, CELLS) bool
    scale : float
        Of all lengths, over those of the benchmark.
    """
    wide = np.zeros((CELLS + 2, CELLS + 2), bool)           # the rim of the field is never enclosed
    wide[1:-1, 1:-1] = full
    enclosed = wide[:-2, 1:-1] & wide[2:, 1:-1] & wide[1:-1, :-2] & wide[1:-1, 2:]
    cells = [(row, column) for row, column in np.argwhere(full & ~enclosed).tolist()]
    cells += [(row, -1 - k) for k in range(PEN) for row in (0, CELLS - 1)]
    cells += [(row, -1 - PEN) for row in range(CELLS)]
    return [(scale * (CORNER[0] + CELL * row), scale * (CORNER[1] + CELL * column), scale * 0.5 * CELL)
            for row, column in cells]


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
    placed = pillars(automaton(values["fill"], values["rounds"], random), scale)
    start, goal = (scale * START[0], scale * START[1]), (scale * GOAL[0], scale * GOAL[1])
    try:
        shortest_path([Outline(np.array([(x, y)]), size) for x, y, size in placed],
                      radius + 0.5 * MARGIN, start, goal)
    except NoShortestPathError:
        return None
    return world_text([], placed), ((start[0], start[1], HEADING), goal)

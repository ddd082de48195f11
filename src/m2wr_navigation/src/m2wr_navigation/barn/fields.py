# SPDX-License-Identifier: BSD-3-Clause
"""Fields of BARN: cells of a cellular automaton through which a robot can get, their reference paths and difficulty.

Perille, Truong, Xiao, Stone: Benchmarking Metric Ground Navigation, 2020 (arXiv 2008.13315). Rows of a field lie across
the drive, columns along it.
"""
from __future__ import annotations

import heapq
import math
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any, Dict, Iterator, List, Optional, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray

    Cell = Tuple[int, int]

SIDE = 30                   # cells of a field
FILLS = (0.15, 0.20, 0.25, 0.30)        # shares of cells that are full at first
ROUNDS = (2, 3, 4)          # of the automaton
ROBOT = 2                   # cells: half side of the square that has to be free around the robot
NEAR, PENALTY = 2.0, 5.0    # cells: so near an obstacle a step of the reference path costs PENALTY / distance more
ENTRY = 17                  # row in front of which the robot starts, at x = -2 m
TRIES = 10000               # of a field that the robot can cross
DISPERSION_RADIUS = 3       # cells
_EIGHT = [(0, 1), (1, 1), (1, 0), (1, -1), (0, -1), (-1, -1), (-1, 0), (-1, 1)]
_SIXTEEN = [(0, 1), (1, 2), (1, 1), (2, 1), (1, 0), (2, -1), (1, -1), (1, -2), (0, -1), (-1, -2), (-1, -1), (-2, -1),
            (-1, 0), (-2, 1), (-1, 1), (-1, 2)]


@dataclass(frozen=True)
class Field:
    """A field that a robot can cross.

    Attributes
    ----------
    number : int
    fill : float
        Share of cells that were full before the automaton.
    rounds : int
        Of the automaton.
    full : (SIDE, SIDE) bool
        Whether a cell has a cylinder.
    path : tuple of (int, int)
        Reference path: row and column of each step, from the first column to the last.
    measures : dict of str to float
        Difficulty: means over the path, see :func:`difficulty`.
    """

    number: int
    fill: float
    rounds: int
    full: BoolArray
    path: Tuple[Tuple[int, int], ...]
    measures: Dict[str, float]


def fields(count: int, seed: int) -> Iterator[Field]:
    """Yield fields: by turns of each share and number of rounds.

    Parameters
    ----------
    count : int
    seed : int

    Raises
    ------
    ValueError
        If no field that can be crossed was found.
    """
    kinds = list(product(FILLS, ROUNDS))
    for number in range(count):
        random = np.random.default_rng([seed, number])
        # a step that shares no divisor with 12 shows all kinds early
        fill, rounds = kinds[5 * number % len(kinds)]
        for _ in range(TRIES):
            full = automaton(random, fill, rounds)
            path = crossing(full)
            if path:
                yield Field(number, fill, rounds, full, tuple(path), difficulty(configuration_space(full), path))
                break
        else:
            raise ValueError("no field with a share of {:g} and {} rounds can be crossed, of {}".format(
                fill, rounds, TRIES))


def automaton(random: np.random.Generator, fill: float, rounds: int) -> BoolArray:
    """Return the cells (SIDE, SIDE) of a field, which the robot may not be able to cross.

    Parameters
    ----------
    random : Generator
    fill : float
        Share of full cells at first, but in the first and last row, which are full.
    rounds : int
        In each a cell with five or more full neighbours of eight becomes full, with one or none empty. Cells beyond
        the first and last row count as full, those beyond the columns as empty.
    """
    full = random.random((SIDE, SIDE)) < fill
    full[[0, -1]] = True
    for _ in range(rounds):
        wide = np.pad(np.pad(full, ((1, 1), (0, 0)), constant_values=True), ((0, 0), (1, 1)), constant_values=False)
        wide[[0, -1]] = True
        around = sum(wide[1 + r:SIDE + 1 + r, 1 + c:SIDE + 1 + c].astype(int) for r, c in _EIGHT)
        full = np.where(around >= 5, True, np.where(around <= 1, False, full))
    return np.asarray(full, bool)


def configuration_space(full: BoolArray) -> BoolArray:
    """Return where the middle of the robot cannot be: cells (SIDE, SIDE) within ROBOT of a full one, also diagonally.

    Parameters
    ----------
    full : (SIDE, SIDE) bool
    """
    wide = np.pad(full, ROBOT)
    steps = range(2 * ROBOT + 1)
    return np.logical_or.reduce([wide[r:r + SIDE, c:c + SIDE] for r in steps for c in steps])


def _region(blocked: BoolArray, column: int) -> BoolArray:
    """Return the largest region of free cells, connected by their sides, that meets a column."""
    best: BoolArray = np.zeros_like(blocked)
    done = blocked.copy()
    for row in range(SIDE):
        if done[row, column]:
            continue
        region, todo = np.zeros_like(blocked), [(row, column)]
        region[row, column] = True
        while todo:
            r, c = todo.pop()
            for to_r, to_c in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
                if 0 <= to_r < SIDE and 0 <= to_c < SIDE and not blocked[to_r, to_c] and not region[to_r, to_c]:
                    region[to_r, to_c] = True
                    todo.append((to_r, to_c))
        done |= region
        if region.sum() > best.sum():
            best = region
    return best


def crossing(full: BoolArray) -> List[Cell]:
    """Return the reference path through a field, empty if the robot cannot cross it.

    It begins and ends in the free row that is nearest to ENTRY, turns by at most 45 degrees a step, and keeps away from
    obstacles.

    Parameters
    ----------
    full : (SIDE, SIDE) bool
    """
    blocked = configuration_space(full)
    left, right = _region(blocked, 0), _region(blocked, SIDE - 1)
    if not left.any() or not (left & right).any():
        return []
    start, goal = (min(np.flatnonzero(region[:, column]).tolist(), key=lambda row: abs(row - ENTRY))
                   for region, column in ((left, 0), (right, SIDE - 1)))
    return _search(blocked, (start, 0), (goal, SIDE - 1))


def _distances(blocked: BoolArray) -> FloatArray:
    """Return the distance of each cell's centre from that of the nearest blocked one [cells]; inf without any."""
    rows, columns = np.nonzero(blocked)
    if not len(rows):
        return np.full(blocked.shape, np.inf)
    at = np.arange(SIDE)
    square = (at[:, None, None] - rows) ** 2 + (at[None, :, None] - columns) ** 2
    return np.asarray(np.sqrt(square.min(axis=-1)), float)


def _search(blocked: BoolArray, start: Cell, goal: Cell) -> List[Cell]:
    """Return the cheapest path by A* over cells and directions."""
    away = _distances(blocked)
    begin: Tuple[int, int, int] = (start[0], start[1], -1)
    costs: Dict[Tuple[int, int, int], float] = {begin: 0.0}
    before: Dict[Tuple[int, int, int], Optional[Tuple[int, int, int]]] = {begin: None}
    queue: List[Tuple[float, Tuple[int, int, int]]] = [(0.0, begin)]
    done = set()
    while queue:
        state = heapq.heappop(queue)[1]
        if state in done:
            continue
        done.add(state)
        row, column, heading = state
        if (row, column) == goal:
            path: List[Cell] = []
            at: Optional[Tuple[int, int, int]] = state
            while at is not None:
                path.append(at[:2])
                at = before[at]
            return path[::-1]
        for turn in range(8) if heading < 0 else ((heading + k) % 8 for k in (-1, 0, 1)):
            r, c = row + _EIGHT[turn][0], column + _EIGHT[turn][1]
            if not (0 <= r < SIDE and 0 <= c < SIDE) or blocked[r, c] or (blocked[r, column] and blocked[row, c]):
                continue
            step = math.hypot(r - row, c - column) + (PENALTY / away[r, c] if away[r, c] <= NEAR else 0.0)
            cost, to = costs[state] + step, (r, c, turn)
            if cost < costs.get(to, math.inf):
                costs[to], before[to] = cost, state
                heapq.heappush(queue, (cost + math.hypot(r - goal[0], c - goal[1]), to))
    return []


def length_of(path: Any) -> float:
    """Return the length of a path of cells [cells]."""
    steps = np.diff(np.asarray(path, float), axis=0)
    return float(np.hypot(*steps.T).sum())


def _free_along(blocked: BoolArray, cell: Cell, step: Cell) -> Tuple[int, bool]:
    """Return the free cells beyond a cell in a direction, and whether a blocked one ends them."""
    count = 0
    while True:
        r, c = cell[0] + (count + 1) * step[0], cell[1] + (count + 1) * step[1]
        if not (0 <= r < SIDE and 0 <= c < SIDE):
            return count, False
        if blocked[r, c]:
            return count, True
        count += 1


def _visibility(blocked: BoolArray, cell: Cell) -> float:
    rays = [_free_along(blocked, cell, step) for step in _EIGHT]
    seen = [count + 1 for count, ended in rays if ended]        # a ray that leaves the field does not count
    return float(np.mean(seen)) if seen else float(SIDE)


def _dispersion(blocked: BoolArray, cell: Cell) -> int:
    ends = []
    for r, c in _SIXTEEN:
        long = max(abs(r), abs(c))
        free, ended = _free_along(blocked, cell, (r, c))
        ends.append(ended and free * long < DISPERSION_RADIUS)
    return sum(ends[k] != ends[k - 1] for k in range(len(ends)))


def _dimension(blocked: BoolArray, cell: Cell) -> float:
    return min(math.hypot(r, c) * (_free_along(blocked, cell, (r, c))[0] + _free_along(blocked, cell, (-r, -c))[0])
               for r, c in _EIGHT[:4])


def difficulty(blocked: BoolArray, path: List[Cell]) -> Dict[str, float]:
    """Return the measures of difficulty of a path [cells].

    Parameters
    ----------
    blocked : (SIDE, SIDE) bool
        Of :func:`configuration_space`.
    path : list of (int, int)

    Returns
    -------
    dict of str to float
        Means over the path: ``distance`` to the nearest blocked cell; ``visibility``, free way in eight directions;
        ``dispersion``, changes between blocked and free over 16 directions within 3 cells; ``dimension``, the least
        free width over four axes. And ``tortuosity``: length over the distance of the ends.
    """
    away = _distances(blocked)
    return {"distance": float(np.mean([away[cell] for cell in path])),
            "visibility": float(np.mean([_visibility(blocked, cell) for cell in path])),
            "dispersion": float(np.mean([_dispersion(blocked, cell) for cell in path])),
            "dimension": float(np.mean([_dimension(blocked, cell) for cell in path])),
            "tortuosity": length_of(path) / math.hypot(path[-1][0] - path[0][0], path[-1][1] - path[0][1])}

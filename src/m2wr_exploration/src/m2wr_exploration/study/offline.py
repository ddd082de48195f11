# SPDX-License-Identifier: BSD-3-Clause
"""The length of a tour for a robot that knows the world: the yardstick of all strategies.

Places are chosen one by one, each the one that sees most of what no other has seen (greedy set cover, at most ln n
times the least number of places). Then a short open tour through them is looked for, by insertion and by reversing and
moving parts. No exploration can know where to look so well, so a ratio of 1 is out of reach; the tour is not the
shortest possible one, either.
"""
from __future__ import annotations

from typing import TYPE_CHECKING, List, Tuple

import numpy as np

from m2wr_exploration.frontier_kernels import visible
from m2wr_exploration.frontiers import distances
from m2wr_navigation.costmap.cost_layout import INSCRIBED

if TYPE_CHECKING:
    from m2wr_exploration.study.scenes import Place
    from m2wr_node.array_types import BoolArray, FloatArray

EVERY = 16          # cells between two places from which the robot may look
RAYS = 720
ENOUGH = 0.99       # of the reachable area


def _visible_from(place: Place, cell: Tuple[int, int], reach: float) -> BoolArray:
    seen = np.zeros(place.truth.shape, np.uint8)
    visible(place.truth.costs, cell[0], cell[1], reach / place.truth.resolution, RAYS, seen, True)
    result: BoolArray = (seen == 1) & place.wanted
    return result


def view_points(place: Place, reach: float) -> List[Tuple[int, int]]:
    """Return cells from which ENOUGH of the reachable area is seen, the start first.

    Parameters
    ----------
    place : Place
    reach : float
        Range of the laser [m].
    """
    start = place.truth.cell(*place.start[:2])
    assert start is not None
    field = distances(place.truth, start)
    rows, columns = np.nonzero(np.isfinite(field) & (place.truth.costs < INSCRIBED))
    sparse = (rows % EVERY == 0) & (columns % EVERY == 0)
    cells = list(zip(rows[sparse].tolist(), columns[sparse].tolist()))
    views = [np.packbits(_visible_from(place, cell, reach)) for cell in cells]
    count = np.array([bin(byte).count("1") for byte in range(256)], np.uint16)
    open_ = np.packbits(place.wanted & ~_visible_from(place, start, reach))
    chosen, limit = [start], (1.0 - ENOUGH) * float(np.count_nonzero(place.wanted))
    while cells and count[open_].sum() > limit:
        new = [int(count[view & open_].sum()) for view in views]
        best = int(np.argmax(new))
        if not new[best]:
            break
        chosen.append(cells[best])
        open_ = open_ & ~views[best]
    return chosen


def short_tour(place: Place, cells: List[Tuple[int, int]]) -> Tuple[float, List[Tuple[int, int]]]:
    """Return the length of a short open tour over cells from the first one [m], and the cells in its order.

    Parameters
    ----------
    place : Place
    cells : list of (int, int)
        Row and column.
    """
    between = np.empty((len(cells), len(cells)))
    for number, cell in enumerate(cells):
        field = distances(place.truth, cell)
        between[number] = [field[other] for other in cells]
    order = _improved(between, _inserted(between))
    return _length(between, order), [cells[number] for number in order]


def _length(between: FloatArray, order: List[int]) -> float:
    return float(between[order[:-1], order[1:]].sum())


def _inserted(between: FloatArray) -> List[int]:
    """Return an order that begins with 0, by inserting each place where it costs least."""
    order = [0]
    for place in range(1, len(between)):
        costs = [_length(between, order[:at] + [place] + order[at:]) for at in range(1, len(order) + 1)]
        order.insert(1 + int(np.argmin(costs)), place)
    return order


def _improved(between: FloatArray, order: List[int]) -> List[int]:
    """Reverse and move parts of an open tour as long as it becomes shorter."""
    best, better = _length(between, order), True
    while better:
        better = False
        for first in range(1, len(order)):
            for last in range(first + 1, len(order) + 1):
                rest, part = order[:first] + order[last:], order[first:last]
                tries = [order[:first] + part[::-1] + order[last:]]
                if last - first <= 3:
                    tries += [rest[:at] + part + rest[at:] for at in range(1, len(rest) + 1)]
                for candidate in tries:
                    length = _length(between, candidate)
                    if length < best - 1e-9:
                        order, best, better = candidate, length, True
    return order


def offline_tour(place: Place, reach: float) -> Tuple[float, FloatArray]:
    """Return a tour that sees ENOUGH of the reachable area of a known world: its length [m], and its places (N, 2) [m].

    Parameters
    ----------
    place : Place
    reach : float
        Range of the laser [m].
    """
    length, cells = short_tour(place, view_points(place, reach))
    return length, np.array([place.truth.centre(row, column) for row, column in cells])

# SPDX-License-Identifier: BSD-3-Clause
"""Search of a path by the potential of the grid, in a corridor where the grid is large."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional

import numpy as np

from m2wr_navigation.planners import corridor_kernels, wave_kernels

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_navigation.planners.planner import Cell
    from m2wr_node.array_types import Float32Array, FloatArray, Uint8Array

SIDE = 1001
LARGE = SIDE * SIDE - 1     # cells: the potential of a smaller grid takes less than 50 ms, and needs no corridor
WIDTH = 3                   # blocks at each side: measured paths are at most 1.5 % more expensive than the best


def allowed_blocks(costmap: Costmap, table: Float32Array, start: Cell, target: Cell) -> Uint8Array:
    """Return the blocks in which a grid is searched: 1 in the corridor of a large one; (0, 0) uint8: all are.

    Parameters
    ----------
    costmap : Costmap
    table : (256,) float32
        Cost of each value, in which 0 has the least; inf: blocked.
    start, target : (row, column)
    """
    if costmap.costs.size > LARGE:
        allowed, connected = corridor_kernels.corridor(costmap.costs, table, start, target, WIDTH)
        if connected:
            return allowed
    return np.zeros((0, 0), np.uint8)


class PotentialSearch:
    """Finds paths, and keeps its memory for the next one.

    Attributes
    ----------
    potential : (H, W) float32
        Of the last search with ``keep``; inf where it was not computed.
    """

    def __init__(self) -> None:
        self.potential: Float32Array = np.zeros((0, 0), np.float32)
        self._kept = False

    def path(self, costmap: Costmap, table: Float32Array, start: Cell, target: Cell, quadratic: bool, gradient: bool,
             keep: bool = False) -> Optional[FloatArray]:
        """Return the cells (N, 2) of the best path, row and column, or None.

        Parameters
        ----------
        costmap : Costmap
        table : (256,) float32
            Cost of each value, in which 0 has the least; inf: blocked.
        start, target : (row, column)
        quadratic : bool
            See :func:`wave_kernels.wave`.
        gradient : bool
            See :func:`wave_kernels.descend`.
        keep : bool
            Whether :attr:`potential` stays, for display.
        """
        if self.potential.shape != costmap.shape:
            self.potential = np.full(costmap.shape, np.inf, np.float32)
        elif self._kept:
            self.potential.fill(np.inf)
        self._kept = keep
        visited, count, reached = wave_kernels.wave(
            costmap.costs, table, target, start, self.potential, allowed_blocks(costmap, table, start, target),
            quadratic)
        cells = wave_kernels.descend(self.potential, start, target, gradient) if reached else None
        if not keep:
            wave_kernels.restore(self.potential, visited, count)
        return cells

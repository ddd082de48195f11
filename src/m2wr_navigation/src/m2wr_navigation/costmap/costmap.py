# SPDX-License-Identifier: BSD-3-Clause
"""A grid of costs with its place in a frame."""
from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Optional, Tuple

import numpy as np

from m2wr_navigation.costmap.cost_layout import NO_INFORMATION

if TYPE_CHECKING:
    from m2wr_node.array_types import BoolArray, FloatArray, IndexArray, Uint8Array, Vector


@dataclass
class Costmap:
    """Costs of square cells. Row 0 is at the least y, column 0 at the least x.

    Attributes
    ----------
    costs : (H, W) uint8
        See :mod:`m2wr_navigation.costmap.cost_layout`.
    resolution : float
        Side of a cell [m].
    origin : (2,) float64
        Corner of cell (0, 0) with the least x and y, in the frame of the costmap [m].
    frame : str
        Name of that frame.
    beside : float
        Distance from lethal cells that plans keep on each side, where the inscribed radius in the costs is less than
        the robot needs [m]; 0: the costs are all.
    least_clearance : float
        Distance from lethal cells that plans keep where there is no other way, if it is less than the inscribed radius
        in the costs [m]; 0: the costs are all.
    """

    costs: Uint8Array
    resolution: float
    origin: FloatArray
    frame: str = "map"
    beside: float = 0.0
    least_clearance: float = 0.0

    @classmethod
    def filled(cls, size: Tuple[int, int], resolution: float, origin: Vector, cost: int, frame: str = "map") -> Costmap:
        """Return a costmap in which all cells are equal.

        Parameters
        ----------
        size : (rows, columns)
        resolution : float
            [m]
        origin : (2,) float
            [m]
        cost : int
            0 to 255
        frame : str
        """
        return cls(np.full(size, cost, np.uint8), float(resolution), np.array(origin, float), frame)

    @property
    def shape(self) -> Tuple[int, int]:
        """Rows and columns."""
        return self.costs.shape[0], self.costs.shape[1]

    @property
    def rows(self) -> int:
        """Number of rows."""
        return self.costs.shape[0]

    @property
    def columns(self) -> int:
        """Number of columns."""
        return self.costs.shape[1]

    @property
    def known_area(self) -> float:
        """Area of the cells that are not unknown [m^2]."""
        return float(np.count_nonzero(self.costs != NO_INFORMATION)) * self.resolution ** 2

    def copy(self) -> Costmap:
        """Return a costmap that shares no memory with this one."""
        return Costmap(self.costs.copy(), self.resolution, self.origin.copy(), self.frame, self.beside,
                       self.least_clearance)

    def cell(self, x: float, y: float) -> Optional[Tuple[int, int]]:
        """Return (row, column) of the cell that holds a point, or None outside.

        Parameters
        ----------
        x, y : float
            In the costmap's frame [m]. Numbers that are not finite are outside.
        """
        across, up = (x - self.origin[0]) / self.resolution, (y - self.origin[1]) / self.resolution
        if not (0.0 <= across < self.columns and 0.0 <= up < self.rows):
            return None
        return int(up), int(across)

    def cells(self, points: FloatArray) -> IndexArray:
        """Return (row, column) (N, 2) of the cells that hold points (N, 2) [m]; outside cells are not clipped."""
        offset = (np.asarray(points, float)[:, :2] - self.origin) / self.resolution
        return np.floor(offset).astype(np.int64)[:, ::-1]

    def inside(self, cells: IndexArray) -> BoolArray:
        """Return which (N,) of some cells (N, 2), as of :meth:`cells`, are in the costmap."""
        return np.asarray(((cells >= 0) & (cells < self.costs.shape)).all(axis=1))

    def centre(self, row: int, column: int) -> Tuple[float, float]:
        """Return x, y of the centre of a cell [m].

        Parameters
        ----------
        row, column : int
        """
        return (float(self.origin[0] + (column + 0.5) * self.resolution),
                float(self.origin[1] + (row + 0.5) * self.resolution))

    def cost_at(self, x: float, y: float) -> Optional[int]:
        """Return the cost of the cell that holds a point, or None outside.

        Parameters
        ----------
        x, y : float
            [m]
        """
        cell = self.cell(x, y)
        return None if cell is None else int(self.costs[cell])

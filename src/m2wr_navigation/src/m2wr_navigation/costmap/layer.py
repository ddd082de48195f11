# SPDX-License-Identifier: BSD-3-Clause
"""The interface of costmap layers, and the window of cells that an update changes."""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar, List, Mapping, Tuple

import numpy as np

from m2wr_navigation.parameters import Configurable

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray, IndexArray


@dataclass(frozen=True)
class Window:
    """Rows ``top`` to ``bottom`` - 1 and columns ``left`` to ``right`` - 1."""

    top: int
    bottom: int
    left: int
    right: int

    @classmethod
    def empty(cls) -> Window:
        """Return a window without cells."""
        return cls(0, 0, 0, 0)

    @classmethod
    def of(cls, bounds: IndexArray) -> Window:
        """Return the window of bounds (4,) as kernels grow them."""
        return cls(*(int(value) for value in bounds)) if bounds[0] < bounds[1] else cls.empty()

    @classmethod
    def whole(cls, costmap: Costmap) -> Window:
        """Return the window of all cells of a costmap."""
        return cls(0, costmap.rows, 0, costmap.columns)

    @property
    def is_empty(self) -> bool:
        """Whether there are no cells."""
        return self.top >= self.bottom or self.left >= self.right

    @property
    def slices(self) -> Tuple[slice, slice]:
        """Rows and columns, to index an array."""
        return slice(self.top, self.bottom), slice(self.left, self.right)

    def union(self, other: Window) -> Window:
        """Return the least window that holds both."""
        if self.is_empty or other.is_empty:
            return other if self.is_empty else self
        return Window(min(self.top, other.top), max(self.bottom, other.bottom), min(self.left, other.left),
                      max(self.right, other.right))

    def grown(self, cells: int, costmap: Costmap) -> Window:
        """Return a window with more cells at each side, cut to the costmap; an empty one stays empty.

        Parameters
        ----------
        cells : int
        costmap : Costmap
        """
        if self.is_empty:
            return self
        return Window(max(0, self.top - cells), min(costmap.rows, self.bottom + cells),
                      max(0, self.left - cells), min(costmap.columns, self.right + cells))


def no_bounds() -> IndexArray:
    """Return bounds (4,) that hold no cell, for kernels to grow."""
    return np.array([2**62, -1, 2**62, -1], np.int64)


class Layer(Configurable, ABC):
    """A layer of a costmap. :meth:`update_window` of all layers is called first, then :meth:`update_costs`.

    Parameters
    ----------
    name : str
        Its name in the list of layers, which is the namespace of its parameters.
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.

    Attributes
    ----------
    remarks : list of str
        Sentences for the log. Who runs the layer tells them, and takes them away.
    """

    #: Whether it holds obstacles that sensors see, which recovery behaviours may clear.
    HOLDS_OBSTACLES: ClassVar[bool] = False

    def __init__(self, name: str, values: Mapping[str, Any]) -> None:
        self.name = name
        self.remarks: List[str] = []
        super().__init__(values)

    @property
    def enabled(self) -> bool:
        """Whether the layer takes part in updates."""
        return bool(self.values.get("enabled", True))

    def set_footprint(self, corners: FloatArray) -> None:
        """Take the padded footprint (K, 2) of the robot in the base frame [m]."""
        return None

    def match(self, master: Costmap) -> None:
        """Take the size and place of the master grid, which has changed; what the layer held is lost.

        Parameters
        ----------
        master : Costmap
        """
        return None

    def shift(self, rows: int, columns: int) -> None:
        """Move the content, because the master's origin has moved by so many cells.

        Parameters
        ----------
        rows, columns : int
        """
        return None

    @abstractmethod
    def update_window(self, master: Costmap, pose: FloatArray, window: Window, now: float) -> Window:
        """Process what has arrived.

        Parameters
        ----------
        master : Costmap
            Its costs are those of the update before.
        pose : (3,) float64
            Robot, in the frame of the costmap [m, m, rad].
        window : Window
            Of the layers before.
        now : float
            [s]

        Returns
        -------
        Window
            That of the layers before, grown by the changes of this one.
        """

    @abstractmethod
    def update_costs(self, master: Costmap, window: Window) -> None:
        """Write the layer's costs into a window of the master.

        Parameters
        ----------
        master : Costmap
        window : Window
        """

    def reset(self) -> None:
        """Forget what sensors have told."""
        return None

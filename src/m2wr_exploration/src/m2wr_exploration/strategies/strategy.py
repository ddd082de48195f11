# SPDX-License-Identifier: BSD-3-Clause
"""The interface of strategies."""
from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, List

from m2wr_navigation.parameters import Configurable, Parameter

if TYPE_CHECKING:
    from m2wr_exploration.frontiers import Frontier, View

#: Parameters that several strategies have.
SENSOR_RANGE = Parameter(10.0, "m", 0.5, 100.0, "range of the laser, for the area that can be seen from a place")


class Strategy(Configurable, ABC):
    """Puts frontiers in an order.

    Parameters
    ----------
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    """

    @abstractmethod
    def order(self, view: View, frontiers: List[Frontier]) -> List[Frontier]:
        """Return frontiers, the next one first.

        Parameters
        ----------
        view : View
            The map and all its frontiers.
        frontiers : list of Frontier
            Those that may be chosen; not empty.

        Returns
        -------
        list of Frontier
        """

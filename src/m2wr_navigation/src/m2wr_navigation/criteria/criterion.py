# SPDX-License-Identifier: BSD-3-Clause
"""The interface of criteria: a drive in, an amount out, and what the amount costs."""
from __future__ import annotations

from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar

from m2wr_navigation.parameters import Configurable

if TYPE_CHECKING:
    from m2wr_navigation.best_path.track import ObstacleField, Track


class Criterion(Configurable, ABC):
    """A criterion. Its parameter ``weight`` says how many metres of path are as bad as one unit of its costs."""

    #: Unit of the amount.
    UNIT: ClassVar[str] = ""

    @abstractmethod
    def amount(self, track: Track, obstacles: ObstacleField) -> float:
        """Return what people read in a table, in :attr:`UNIT`.

        Parameters
        ----------
        track : Track
        obstacles : ObstacleField
        """

    def costs(self, amount: float) -> float:
        """Return the costs of an amount, which the weight multiplies: by default the amount itself."""
        return amount

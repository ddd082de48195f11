# SPDX-License-Identifier: BSD-3-Clause
"""The interface of recovery behaviours.

The node calls :meth:`Recovery.begin` once, then :meth:`Recovery.step` in each control cycle until it answers that it is
done. So a goal can be cancelled or replaced at any time, and there is no loop that waits inside a behaviour.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, List, Mapping, NamedTuple, Optional, Sequence

from m2wr_navigation.parameters import Configurable

if TYPE_CHECKING:
    from m2wr_navigation.controllers.controller import Situation
    from m2wr_node.array_types import FloatArray


class Costmaps(ABC):
    """What a behaviour may do to the two costmaps."""

    @abstractmethod
    def layer_names(self, which: str) -> List[str]:
        """Return the names of the layers of a costmap that hold obstacles (obstacle and voxel layers).

        Parameters
        ----------
        which : str
            ``global`` or ``local``.
        """

    @abstractmethod
    def clear(self, which: str, layers: Sequence[str], side: float, inside: bool) -> int:
        """Forget obstacles in a square around the robot, or outside of it.

        Parameters
        ----------
        which : str
            ``global`` or ``local``.
        layers : sequence of str
            Names of the layers.
        side : float
            Side of the square, centred on the robot [m].
        inside : bool
            Whether to clear inside of it; otherwise all outside.

        Returns
        -------
        int
            Number of occupied cells that were cleared.
        """


class SpeedLimit(NamedTuple):
    """How fast the robot may drive after a behaviour.

    Attributes
    ----------
    speed : float
        [m/s]
    rate : float
        Of turning [rad/s].
    distance : float
        From where the behaviour ended, until which this holds [m].
    """

    speed: float
    rate: float
    distance: float


@dataclass(frozen=True)
class Step:
    """What a behaviour answers in one cycle.

    Attributes
    ----------
    velocity : (3,) float64 or None
        Command in the base frame [m/s, m/s, rad/s]; None: the robot has to stop.
    done : bool
        Whether the behaviour has ended.
    reason : str
        What it did or why it ended, one sentence; empty: nothing new.
    limit : SpeedLimit or None
        For the commands of the controller after it.
    """

    velocity: Optional[FloatArray]
    done: bool
    reason: str = ""
    limit: Optional[SpeedLimit] = None


class Recovery(Configurable, ABC):
    """A recovery behaviour.

    Parameters
    ----------
    name : str
        Its name in the list of behaviours, which is the namespace of its parameters.
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    costmaps : Costmaps
    """

    def __init__(self, name: str, values: Mapping[str, Any], costmaps: Costmaps) -> None:
        self.name, self.costmaps = name, costmaps
        super().__init__(values)

    def begin(self, situation: Situation) -> None:
        """Start again from the beginning.

        Parameters
        ----------
        situation : Situation
            The plan is the last one, or only the robot's pose if there is none.
        """
        return None

    @abstractmethod
    def step(self, situation: Situation) -> Step:
        """Return what to do in this cycle.

        Parameters
        ----------
        situation : Situation
        """

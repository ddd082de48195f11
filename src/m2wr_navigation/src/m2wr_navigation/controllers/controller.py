# SPDX-License-Identifier: BSD-3-Clause
"""The interface of controllers (local planners): plan and costmap in, velocity command out.

The node calls :meth:`Controller.set_plan` with each new global plan, and once in each control cycle
:meth:`Controller.is_goal_reached`, then :meth:`Controller.compute`. A controller knows no ROS: transforms, time and
odometry come with the :class:`Situation`.
"""
from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Callable, Optional

from m2wr_navigation.parameters import Configurable

if TYPE_CHECKING:
    from m2wr_navigation.costmap.costmap import Costmap
    from m2wr_node.array_types import FloatArray


@dataclass(frozen=True)
class Situation:
    """What a controller sees in one cycle. All poses are in the frame of the local costmap.

    Attributes
    ----------
    stamp : float
        ROS time [s].
    period : float
        Time until the next cycle, 1 / controller_frequency [s].
    pose : (3,) float64
        Base: x, y, yaw [m, m, rad].
    velocity : (3,) float64
        By the odometry, in the base frame: x, y, yaw rate [m/s, m/s, rad/s].
    plan : (N, 3) float64
        The global plan, transformed at this cycle; the last pose is the goal [m, m, rad]. N >= 1.
    costmap : Costmap
        The local costmap. It does not change during the cycle.
    footprint : (K, 2) float64
        Padded corners of the base in the base frame, counter-clockwise [m].
    """

    stamp: float
    period: float
    pose: FloatArray
    velocity: FloatArray
    plan: FloatArray
    costmap: Costmap
    footprint: FloatArray


@dataclass(frozen=True)
class Command:
    """What a controller answers.

    Attributes
    ----------
    velocity : (3,) float64 or None
        Command in the base frame [m/s, m/s, rad/s]; None: there is no valid one, the robot has to stop.
    reason : str
        Why there is none, or what the controller does that a user may wonder about (it stops to turn). One sentence
        with the place and the numbers; empty: it follows the plan.
    local_plan : (M, 3) float64
        Poses that the command leads to, for display; M may be 0.
    used_plan : (L, 3) float64
        Part of the plan that was used, for display.
    costs : callable or None
        Called within the cycle if a display wants it; returns a cloud (P, 7): x, y, z, path_cost, goal_cost, occ_cost,
        total_cost.
    trajectories : callable or None
        The same for the samples, (Q, 5): x, y, z, theta, cost.
    """

    velocity: Optional[FloatArray]
    reason: str
    local_plan: FloatArray
    used_plan: FloatArray
    costs: Optional[Callable[[], FloatArray]] = None
    trajectories: Optional[Callable[[], FloatArray]] = None


class Controller(Configurable, ABC):
    """A controller. A subclass names its parameters and implements the three abstract methods.

    Parameters
    ----------
    values : mapping of str to object
        Value of every parameter of :attr:`PARAMETERS`, converted and clipped.
    """

    @property
    def drives_sideways(self) -> bool:
        """Whether commands may have a speed to the side."""
        return False

    @abstractmethod
    def set_plan(self, plan: FloatArray, new_goal: bool) -> None:
        """Take note of a new global plan; the plan itself comes with each :class:`Situation`.

        Parameters
        ----------
        plan : (N, 3) float64
            In the frame of the global costmap [m, m, rad].
        new_goal : bool
            Whether its goal differs from that of the plan before. Only then are latches and the memory of
            oscillations cleared: a robot that plans often would otherwise never keep them.
        """

    @abstractmethod
    def compute(self, situation: Situation) -> Command:
        """Return the command of this cycle.

        Parameters
        ----------
        situation : Situation
        """

    @abstractmethod
    def is_goal_reached(self, situation: Situation) -> bool:
        """Return whether the goal is reached and the robot has stopped.

        Parameters
        ----------
        situation : Situation
        """

# SPDX-License-Identifier: BSD-3-Clause
"""A fault between a simulated robot and the method that drives it: what the method sees, and what the drive gets."""
from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar, Dict, Mapping, Optional, Tuple

from m2wr_sim.geometry import quaternion_from_rpy

if TYPE_CHECKING:
    import numpy as np

    from m2wr_navigation.parameters import Parameter
    from m2wr_sim.api import Scan, StepResult

    Planar = Tuple[float, float, float]


class Fault:
    """No fault; the base of all. Override what the fault changes.

    Parameters
    ----------
    values : mapping of str to object
        Of all PARAMETERS.
    random : numpy.random.Generator
        Of the run.
    """

    PARAMETERS: ClassVar[Dict[str, Parameter]] = {}
    #: Whether the method may take another place for the goal.
    MOVES_POSE: ClassVar[bool] = False

    def __init__(self, values: Mapping[str, Any], random: np.random.Generator) -> None:
        self.values, self.random = values, random

    def scan(self, time: float, scan: Optional[Scan]) -> Optional[Scan]:
        """Return the scan that the method gets.

        Parameters
        ----------
        time : float
            Simulated time of this cycle [s].
        scan : Scan or None
            The newest; the same object until there is a newer one.
        """
        return scan

    def pose(self, time: float, pose: Planar) -> Planar:
        """Return the pose that the method gets: x, y [m], yaw [rad].

        Parameters
        ----------
        time : float
            [s]
        pose : (3,) float
            The true one.
        """
        return pose

    def command(self, time: float, linear: float, angular: float) -> Tuple[float, float]:
        """Return the command that the drive gets [m/s, rad/s].

        Parameters
        ----------
        time : float
            [s]
        linear, angular : float
            What the method commands.
        """
        return linear, angular


def seen_through(fault: Fault, result: StepResult) -> StepResult:
    """Return a step of the simulation as a method sees it.

    Parameters
    ----------
    fault : Fault
    result : StepResult
        With one robot.
    """
    (name, true), = result.robots.items()
    pose = true.pose
    x, y, yaw = fault.pose(result.time, pose)
    there = true
    if (x, y, yaw) != pose:
        place, turn = (x, y, true.position[2]), quaternion_from_rpy(0.0, 0.0, yaw)
        there = replace(there, position=place, orientation=turn, odometry=None if true.odometry is None else replace(
            true.odometry, position=place, orientation=turn))
    return replace(result, robots={name: replace(there, scan=fault.scan(result.time, true.scan))})

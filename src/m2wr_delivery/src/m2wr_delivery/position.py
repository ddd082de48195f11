# SPDX-License-Identifier: BSD-3-Clause
"""Where a robot takes itself to be: wheels, IMU and map, corrected by what the base tells it by radio."""
from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, Tuple

import numpy as np

if TYPE_CHECKING:
    from m2wr_elevation.dead_reckoning import DeadReckoning
    from m2wr_elevation.elevation_map import ElevationMap

GAIN = 0.3                  # of the difference that one fix corrects; the rest is noise of the fix
SLID = 0.4                  # m: a robot that is further away has slid, and its map is of the wrong place


class Mapping(Protocol):
    """A robot that maps."""

    map: ElevationMap
    reckoning: DeadReckoning


def take_fix(robot: Mapping, fix: Tuple[float, float]) -> bool:
    """Correct the position of a robot; return whether it had slid, so that its map begins again.

    Parameters
    ----------
    robot : Mapping
    fix : (float, float)
        Where the base says it is [m].

    Returns
    -------
    bool
    """
    gap = np.array((fix[0], fix[1], 0.0)) - robot.reckoning.position * (1.0, 1.0, 0.0)
    slid = bool(np.linalg.norm(gap) > SLID)
    robot.reckoning.shift(gap if slid else GAIN * gap)
    if slid:
        robot.map.forget()
    return slid

# SPDX-License-Identifier: BSD-3-Clause
"""Where wheels slip: learned from wheels and map while the robot drives, or told as friction; predicted for slopes.

Slip is 1 - way / distance of the wheels.  As in Angelova, Matthies, Helmick and Perona, "Learning and prediction of
slip from visual information", Journal of Field Robotics 24(3), 2007, it is learned as a function of slope, by kind of
ground; here ground is of one kind with what is near to it, for a laser does not see a texture.  By Coulomb's law a
slope whose tangent is the friction coefficient mu is the steepest that can be climbed, so slip is taken as
k tan(slope), with k = 1 / mu where friction is told, and from a regression through the origin where slip was measured.
"""
from __future__ import annotations

import math
from collections import deque
from typing import TYPE_CHECKING, Deque, List, Optional, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_elevation.elevation_map import ElevationMap

    Values = NDArray[np.float64]

MOST_SLIP = 0.97            # predicted: 33 times the cost, so that a robot that slips still has a way off
WINDOW = 0.15               # m of the wheels over which slip is measured: five clouds at 0.3 m/s
NEAR = 0.3                  # m: standard deviation of the distance within which ground is alike
LEAST_TANGENT = 0.1         # of a slope: wheels also slip against stones, which a slope does not show
PRIOR = 0.1 * LEAST_TANGENT ** 2        # how much counts that ground does not slip: a tenth of a measurement
LEAD = 0.5                  # m ahead of the axle: a robot that slips stands before the ground that it does not climb
NOISE = 0.15                # slip below it is an error of the measurement
SPINNING = 0.7              # slip of two measurements running, from which a robot gets nowhere
MOST_KEPT, MOST_TOLD = 300, 100         # measurements: 45 m of way; patches


class SlipMap:
    """Slip measured and told, by place.

    Parameters
    ----------
    window : float
        Distance of the wheels over which slip is measured [m].

    Attributes
    ----------
    measured : deque of (float, float, float)
        Place [m, m] and slip, the oldest first.
    """

    def __init__(self, window: float = WINDOW) -> None:
        self.measured: Deque[Tuple[float, float, float]] = deque(maxlen=MOST_KEPT)
        self._told: List[Tuple[float, float, float, float]] = []
        self._window, self._wheels, self._way = window, 0.0, 0.0
        self._before: Optional[Values] = None

    @property
    def spins(self) -> bool:
        """Whether the wheels turned in vain while slip was measured the last two times."""
        return len(self.measured) > 1 and min(self.measured[-1][2], self.measured[-2][2]) > SPINNING

    def travel(self, wheels: float, axle: Values, ahead: Values) -> None:
        """Take how far the wheels have rolled, and where the driven axle is by the map.

        Parameters
        ----------
        wheels : float
            Since the last call, backwards below 0 [m].
        axle, ahead : (3,) float64
            Place of the axle [m], and the direction of the robot, in the map.

        Raises
        ------
        ValueError
            If a number is not finite.
        """
        if not (math.isfinite(wheels) and np.isfinite(axle).all() and np.isfinite(ahead).all()):
            raise ValueError("wheels {} m, axle {}; expected finite numbers".format(wheels, axle))
        before, self._before = self._before, np.array(axle, float)
        if before is None or wheels == 0.0:
            return
        self._wheels += abs(wheels)
        self._way += math.copysign(1.0, wheels) * float(np.dot(axle - before, ahead))
        if self._wheels < self._window:
            return
        slip = min(1.0, 1.0 - self._way / self._wheels)
        slip = slip if slip > NOISE else 0.0
        place = self._before + math.copysign(LEAD, wheels) * slip * np.asarray(ahead)
        self.measured.append((float(place[0]), float(place[1]), slip))
        self._wheels = self._way = 0.0

    def tell(self, x: float, y: float, radius: float, friction: float) -> None:
        """Take the friction of a disc, as of an icy patch.

        Parameters
        ----------
        x, y, radius : float
            [m]
        friction : float
            Coefficient.

        Raises
        ------
        ValueError
            If a number is not finite, or radius or friction is not above 0, or too many patches were told.
        """
        if not all(map(math.isfinite, (x, y, radius, friction))) or radius <= 0.0 or friction <= 0.0:
            raise ValueError("a patch at ({}, {}) of radius {} with friction {}; expected finite numbers, the last two "
                             "above 0".format(x, y, radius, friction))
        if len(self._told) == MOST_TOLD:
            raise ValueError("more than {} patches".format(MOST_TOLD))
        self._told.append((x, y, radius, friction))

    def layer(self, elevation: ElevationMap, slope: Values) -> Values:
        """Return the slip to be expected in each cell (n, n), 0 to MOST_SLIP; about 0 where nothing is known of it.

        Parameters
        ----------
        elevation : ElevationMap
        slope : (n, n) float64
            Of its layers [rad].
        """
        cell, side = elevation.settings.cell, slope.shape[0]
        tangent = np.maximum(np.tan(np.where(np.isnan(slope), 0.0, slope)), LEAST_TANGENT)
        x = elevation.corner[0] + (np.arange(side) + 0.5) * cell
        y = elevation.corner[1] + (np.arange(side) + 0.5) * cell
        above, below = np.zeros(slope.shape), np.full(slope.shape, PRIOR)
        reach = int(math.ceil(3.0 * NEAR / cell))
        for place_x, place_y, slip in self.measured:
            column, row = (int(math.floor((place - corner) / cell))
                           for place, corner in zip((place_x, place_y), elevation.corner))
            if not (0 <= row < side and 0 <= column < side):
                continue
            rows, columns = (slice(max(0, middle - reach), middle + reach + 1) for middle in (row, column))
            weight = np.exp(-0.5 * ((y[rows, None] - place_y) ** 2 + (x[None, columns] - place_x) ** 2) / NEAR ** 2)
            there = tangent[row, column]
            above[rows, columns] += weight * slip * there
            below[rows, columns] += weight * there ** 2
        slipperiness = above / below
        for place_x, place_y, radius, friction in self._told:
            inside = (y[:, None] - place_y) ** 2 + (x[None, :] - place_x) ** 2 <= radius ** 2
            slipperiness[inside] = np.maximum(slipperiness[inside], 1.0 / friction)
        return np.clip(slipperiness * tangent, 0.0, MOST_SLIP)

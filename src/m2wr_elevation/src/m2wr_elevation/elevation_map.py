# SPDX-License-Identifier: BSD-3-Clause
"""A map of heights that moves with the robot, or stays."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Dict, Tuple

import numpy as np

from m2wr_elevation.elevation_kernels import fuse, gaps, shift, traverse

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Values = NDArray[np.float64]

MOST_CELLS = 1000           # a side
_LEAST_GAPS = 50            # points on known ground from which the height of a cloud is corrected
_GAP, _INDEPENDENT, _ROUNDS = 0.01, 200.0, 4        # m, of a gap; points; iterations


@dataclass(frozen=True)
class MapSettings:
    """Settings of an elevation map.

    Attributes
    ----------
    size, cell : float
        Of a side, and of a cell [m].
    range_noise, tilt_noise, height_noise : float
        Standard deviations: of ranges [m], of roll and pitch [rad], the least of a height in a cell [m].
    drift : float
        Growth of the variance of known heights with the distance travelled [m^2/m].
    radius : float
        Of the disc from which slope, step and roughness are taken [m]; about half the robot's length.
    most_slope, most_step, most_roughness : float
        Beyond these ground is not traversable [rad], [m], [m].
    """

    size: float = 10.0
    cell: float = 0.05
    range_noise: float = 0.01
    tilt_noise: float = 0.002
    height_noise: float = 0.01
    drift: float = 1e-5
    radius: float = 0.25
    most_slope: float = math.radians(25.0)
    most_step: float = 0.08
    most_roughness: float = 0.05

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError("{} is {}; expected a finite number above 0".format(name, value))
        if not 10 <= self.size / self.cell <= MOST_CELLS:
            raise ValueError("a side of {:g} m with cells of {:g} m; expected 10 to {} cells a side".format(
                self.size, self.cell, MOST_CELLS))


class ElevationMap:
    """Heights around a robot.

    Parameters
    ----------
    settings : MapSettings
    follow : bool
        Whether the map moves with the robot; else its middle stays at the origin of the frame.

    Attributes
    ----------
    height, variance : (n, n) float64
        [m], [m^2]; nan where unknown; rows along y, columns along x.
    """

    def __init__(self, settings: MapSettings, follow: bool = True) -> None:
        self.settings, self._follow = settings, follow
        self._side = int(round(settings.size / settings.cell))
        self.height = np.full((self._side, self._side), math.nan)
        self.variance = self.height.copy()
        self._misses = np.zeros(self.height.shape, np.int64)
        # number of the least cell along x and y, from the origin of the frame
        self._first = (0, 0) if follow else (-(self._side // 2), -(self._side // 2))
        self._place: Tuple[float, float] = (math.nan, math.nan)

    @property
    def corner(self) -> Tuple[float, float]:
        """Least x and y of the map [m]."""
        return self._first[0] * self.settings.cell, self._first[1] * self.settings.cell

    @property
    def centre(self) -> Tuple[float, float]:
        """Middle of the map [m]."""
        half = 0.5 * self._side * self.settings.cell
        return self.corner[0] + half, self.corner[1] + half

    def move(self, x: float, y: float) -> None:
        """Centre the map on the robot if it follows; what leaves it is forgotten, what is known becomes less certain.

        Parameters
        ----------
        x, y : float
            Place of the robot [m].

        Raises
        ------
        ValueError
            If a coordinate is not finite.
        """
        if not (math.isfinite(x) and math.isfinite(y)):
            raise ValueError("the robot is at ({}, {}); expected finite numbers".format(x, y))
        cell = self.settings.cell
        first = (int(round(x / cell)) - self._side // 2, int(round(y / cell)) - self._side // 2)
        if self._follow and first != self._first:
            right, down = first[0] - self._first[0], first[1] - self._first[1]
            height, variance = np.full(self.height.shape, math.nan), np.full(self.height.shape, math.nan)
            misses = np.zeros(self.height.shape, np.int64)
            if max(abs(right), abs(down)) < self._side:
                shift(self.height, down, right, height)
                shift(self.variance, down, right, variance)
                shift(self._misses, down, right, misses)
            self.height, self.variance, self._misses, self._first = height, variance, misses, first
        if math.isfinite(self._place[0]):
            self.variance += self.settings.drift * math.hypot(x - self._place[0], y - self._place[1])
        self._place = (x, y)

    def forget(self) -> None:
        """Forget all heights."""
        self.height[:] = self.variance[:] = math.nan
        self._misses[:] = 0

    def offset(self, points: NDArray[Any], rotation: Values, position: Values, slip: float = 0.02) -> Values:
        """Return by what a cloud has to be moved (3,) so that it lies on the map; zeros if little is known [m].

        The least squares of the distances from the ground, linearised at its slopes, with weights of Huber; how far
        wheels may have slipped since the last cloud is prior knowledge.

        Parameters
        ----------
        points, rotation, position
            As for :meth:`add`.
        slip : float
            Standard deviation of the position along x and y [m].
        """
        pose = np.concatenate((np.asarray(rotation, float).ravel(), np.asarray(position, float)))
        found = np.empty((len(points), 3))
        count = gaps(np.asarray(points), pose, np.array(self.corner), self.settings.cell, self.height,
                     self.settings.cell, found)
        moved = np.zeros(3)
        if count < _LEAST_GAPS:
            return moved
        gap = found[:count, 0]
        rows = np.column_stack((found[:count, 1:], -np.ones(count)))        # moved by (x, y, z) the gap falls by these
        moved[2] = -np.median(gap)
        prior = np.diag((1.0 / slip ** 2, 1.0 / slip ** 2, 0.0))
        for _ in range(_ROUNDS):
            # sums by einsum: the product of BLAS would keep a second core busy with waiting
            rest = np.abs(gap - np.einsum("ni,i->n", rows, moved))
            # neighbouring points share errors, so that all of them count as _INDEPENDENT
            weight = np.minimum(1.0, _GAP / np.maximum(rest, 1e-9)) * (min(1.0, _INDEPENDENT / count) / _GAP ** 2)
            moved = np.linalg.solve(np.einsum("ni,n,nj->ij", rows, weight, rows) + prior,
                                    np.einsum("ni,n,n->i", rows, weight, gap))
        return moved

    def add(self, points: NDArray[Any], rotation: Values, position: Values, axis: Values) -> int:
        """Fuse a cloud; return how many of its points are in the map.

        Parameters
        ----------
        points : (n, 3) float
            In the frame of the sensor [m].
        rotation, position : (3, 3), (3,) float64
            Of the sensor in the map.
        axis : (3,) float64
            Place of the robot in the map, about which its orientation is uncertain [m].

        Returns
        -------
        int

        Raises
        ------
        ValueError
            If a number of the pose is not finite.
        """
        pose = np.concatenate((np.asarray(rotation, float).ravel(), np.asarray(position, float)))
        if not np.all(np.isfinite(pose)):
            raise ValueError("the pose of the sensor is {}; expected finite numbers".format(pose.tolist()))
        settings = self.settings
        noise = np.array((settings.range_noise, settings.tilt_noise, settings.height_noise))
        return int(fuse(np.asarray(points), pose, np.asarray(axis, float), noise, np.array(self.corner), settings.cell,
                        self.height, self.variance, self._misses))

    def layers(self) -> Dict[str, Values]:
        """Return elevation, variance, slope, step, roughness and traversability, (n, n) float64 each.

        Traversability is 1 on level smooth ground and 0 beyond a limit; nan where unknown.
        """
        settings = self.settings
        slope, step, rough = (np.empty(self.height.shape) for _ in range(3))
        reach = max(1, int(round(settings.radius / settings.cell)))
        traverse(self.height, settings.cell, reach, 5, slope, step, rough)
        worst = np.maximum(np.maximum(slope / settings.most_slope, step / settings.most_step),
                           rough / settings.most_roughness)
        return {"elevation": self.height.copy(), "variance": self.variance.copy(), "slope": slope, "step": step,
                "roughness": rough, "traversability": np.clip(1.0 - worst, 0.0, 1.0)}

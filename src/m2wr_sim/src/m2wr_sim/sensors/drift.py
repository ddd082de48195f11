# SPDX-License-Identifier: BSD-3-Clause
"""Sensor errors of hector_gazebo_plugins: scale, offset, a slow drift, and Gaussian noise."""
from __future__ import annotations

import math
from typing import TYPE_CHECKING, Sequence

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Floats = NDArray[np.float64]


class DriftModel:
    """Turns true values into measured ones: ``value * scale + offset + drift + noise``.

    The drift is a first-order Gauss-Markov process, as in hector_gazebo_plugins 0.5:
    ``drift * exp(-dt f) + dt * N(0, sqrt(2 f) * deviation)``.  It begins with N(0, deviation).

    Parameters
    ----------
    size : int
        Number of values.
    offset, drift, frequency, noise, scale : sequences of float
        One number for each value: offset, standard deviation and frequency [Hz] of the drift, standard deviation of
        the noise, factor.
    rng : numpy.random.Generator

    Attributes
    ----------
    noise : (size,) float64
    drift : (size,) float64
        At present.
    """

    def __init__(self, size: int, offset: Sequence[float], drift: Sequence[float], frequency: Sequence[float],
                 noise: Sequence[float], scale: Sequence[float], rng: np.random.Generator) -> None:
        self._offset, self._deviation, self._frequency, self.noise, self._scale = (
            np.asarray(values, float).reshape(size) for values in (offset, drift, frequency, noise, scale))
        self.restart(rng)

    def restart(self, rng: np.random.Generator) -> None:
        """Restart from ``rng``: the drift is drawn again."""
        self._rng = rng
        self.drift = self._deviation * rng.standard_normal(self._offset.size)

    @property
    def bias(self) -> Floats:
        """Offset and drift at present, (size,)."""
        return self._offset + self.drift

    def measure(self, values: Sequence[float], elapsed: float) -> Floats:
        """Return measured values.

        Parameters
        ----------
        values : (size,) sequence of float
        elapsed : float
            Time since the last measurement [s].
        """
        draws = self._rng.standard_normal((2, self._offset.size))
        self.drift = (self.drift * np.exp(-elapsed * self._frequency)
                      + elapsed * np.sqrt(2.0 * self._frequency) * self._deviation * draws[0])
        return np.asarray(values, float) * self._scale + self._offset + self.drift + self.noise * draws[1]


def places_from(latitude: float, longitude: float, heading: float, north_x: float, west_y: float) -> Sequence[float]:
    """Return latitude and longitude [degrees] of a place, by the radii of WGS 84 at a reference.

    Parameters
    ----------
    latitude, longitude : float
        Reference [degrees].
    heading : float
        Of the x axis, clockwise from north [rad].
    north_x, west_y : float
        Place relative to the reference, along the x and y axes [m].
    """
    excentricity = 0.0818191908426 ** 2
    phi = math.radians(latitude)
    share = 1.0 / (1.0 - excentricity * math.sin(phi) ** 2)
    prime = 6378137.0 * math.sqrt(share)
    north_radius, east_radius = prime * (1.0 - excentricity) * share, prime * math.cos(phi)
    north = math.cos(heading) * north_x + math.sin(heading) * west_y
    west = -math.sin(heading) * north_x + math.cos(heading) * west_y
    return (latitude + math.degrees(north / north_radius),
            longitude - (math.degrees(west / east_radius) if abs(east_radius) > 1e-6 else 0.0))

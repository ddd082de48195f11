# SPDX-License-Identifier: BSD-3-Clause
"""Sensor noise as in Gazebo. All random numbers come from a generator that the caller provides."""
from __future__ import annotations

import logging
import math
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from m2wr_sim.model.types import Noise

_LOG = logging.getLogger(__name__)
TABLE_SIZE = 131072     # draws, 1 MB: at 20 Hz and 720 beams it repeats after 9 s
_DRAWS_AT_ONCE = 4096   # of a table that is drawn as it is used: some scans of 720 beams, so that calls cost little
_WITHOUT_NOISE = ('none', 'custom')
_GAUSSIAN = ('gaussian', 'gaussian_quantized')


class NoiseModel:
    """Gaussian noise with a constant bias.

    A value becomes ``value + bias + mean + stddev * normal``.  If ``precision`` is above 0, the result is rounded to a
    multiple of it.  The kinds ``none`` and ``custom`` do not change values.  An unknown kind is logged as an error and
    does not change values either.

    Parameters
    ----------
    noise : m2wr_sim.model.types.Noise
        Kind and parameters, in the unit of the values.
    rng : numpy.random.Generator
        Source of the bias and the noise.
    block : int
        Greatest number of values for one call of ``advance``.
    lazily : bool
        Whether ``rng`` is for this model alone, and its numbers may be drawn as they are used, which makes short runs
        faster.  The numbers are the same.

    Attributes
    ----------
    shift : float
        Bias plus mean.
    bias : float
        Drawn once from N(bias_mean, bias_stddev) with a random sign.  ``reset`` does not change it.
    stddev, precision : float
        0 if there is no noise or no rounding.
    normals : (M,) float64
        Standard normal draws, made once.  Reading them from a moving offset takes a tenth of the time of drawing.
        With ``lazily``, only those that ``advance`` has returned.

    Raises
    ------
    ValueError
        If a number is not finite, or a standard deviation or the precision is negative.
    """

    def __init__(self, noise: Noise, rng: np.random.Generator, block: int, lazily: bool = False) -> None:
        for name in ('mean', 'stddev', 'bias_mean', 'bias_stddev', 'precision'):
            value = getattr(noise, name)
            if not math.isfinite(value) or (value < 0.0 and name not in ('mean', 'bias_mean')):
                raise ValueError("sensor noise: %s %r: expected a finite number%s"
                                 % (name, value, "" if name in ('mean', 'bias_mean') else " not below 0"))
        active = noise.kind in _GAUSSIAN
        if not active and noise.kind not in _WITHOUT_NOISE:
            _LOG.error("Unrecognized noise type [%s], the sensor has no noise (known: %s)",
                       noise.kind, ", ".join(_WITHOUT_NOISE + _GAUSSIAN))
        self._biased = active and (noise.bias_mean != 0.0 or noise.bias_stddev != 0.0)
        self._bias_mean, self._bias_stddev = noise.bias_mean, noise.bias_stddev
        self.stddev = float(noise.stddev) if active else 0.0
        self.precision = float(noise.precision) if active else 0.0
        self._mean = float(noise.mean) if active else 0.0
        self._block, self._offset, self._lazily = max(int(block), 1), 0, lazily
        self.normals = np.zeros(max(TABLE_SIZE, 2 * self._block) if self.stddev > 0.0 else 1)
        self.restart(rng)

    def restart(self, rng: np.random.Generator) -> None:
        """Restart the noise and draw the bias, as a new model would do."""
        self.bias = self._fill(rng)
        self.shift = self.bias + self._mean

    def reset(self, rng: np.random.Generator) -> None:
        """Restart the noise from ``rng``. A generator with the initial seed gives the same noise again."""
        self._fill(rng)

    def advance(self, count: int) -> int:
        """Return the index in ``normals`` of the first of the next ``count`` draws.

        Raises
        ------
        ValueError
            If ``count`` is above ``block``.
        """
        if count > self._block:
            raise ValueError("noise for %d values: the table was made for at most %d at once" % (count, self._block))
        if self.stddev == 0.0:
            return 0
        start = self._offset
        if start + count > self._drawn:
            self._draw(start + count)
        self._offset = (start + count) % (self.normals.size - self._block + 1)
        return start

    def _fill(self, rng: np.random.Generator) -> float:
        """Draw bias and table, and return the bias. Drawing it each time keeps the table the same after a reset."""
        bias = 0.0
        if self._biased:
            bias = rng.normal(self._bias_mean, self._bias_stddev)
            bias = -bias if rng.random() < 0.5 else bias
        self._rng, self._drawn, self._offset = rng, 0, 0
        if self.stddev > 0.0 and not self._lazily:
            self._draw(self.normals.size)
        return float(bias)

    def _draw(self, least: int) -> None:
        """Draw the next numbers of the table, until there are at least that many."""
        end = min(self.normals.size, max(least, self._drawn + _DRAWS_AT_ONCE))
        self._rng.standard_normal(out=self.normals[self._drawn:end])
        self._drawn = end

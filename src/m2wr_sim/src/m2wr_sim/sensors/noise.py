# SPDX-License-Identifier: BSD-3-Clause
"""Range noise as Gazebo's sensors have it; all randomness comes from a generator that is handed in."""
import logging
import math

import numpy as np

_LOG = logging.getLogger(__name__)
TABLE_SIZE = 131072
_SILENT = ('none', 'custom')
_GAUSSIAN = ('gaussian', 'gaussian_quantized')


class NoiseModel:
    """Gaussian noise with a constant bias.

    A value becomes ``value + bias + mean + stddev * normal``, rounded to multiples of ``precision`` where that is
    above 0.  The kinds ``none`` and ``custom`` leave values as they are; a kind that is not known is reported and does
    the same.

    Parameters
    ----------
    noise : m2wr_sim.model.types.Noise
        Kind and numbers, in the unit of the values.
    rng : numpy.random.Generator
        Source of the bias and the noise.
    block : int
        Most values that one call of ``advance`` is asked for.

    Attributes
    ----------
    shift : float
        Bias plus mean.
    bias : float
        Drawn once, from N(bias_mean, bias_stddev) with either sign; ``reset`` keeps it, it belongs to the sensor.
    stddev, precision : float
        0 where there is none.
    normals : (M,) float64
        Standard normal draws, made once: reading them from a moving offset costs a tenth of drawing.

    Raises
    ------
    ValueError
        If a number is not finite, or a standard deviation or the precision is negative.
    """

    def __init__(self, noise, rng, block):
        for name in ('mean', 'stddev', 'bias_mean', 'bias_stddev', 'precision'):
            value = getattr(noise, name)
            if not math.isfinite(value) or (value < 0.0 and name not in ('mean', 'bias_mean')):
                raise ValueError("sensor noise: %s %r: expected a finite number%s"
                                 % (name, value, "" if name in ('mean', 'bias_mean') else " not below 0"))
        active = noise.kind in _GAUSSIAN
        if not active and noise.kind not in _SILENT:
            _LOG.error("Unrecognized noise type [%s], the sensor has no noise (known: %s)",
                       noise.kind, ", ".join(_SILENT + _GAUSSIAN))
        self._biased = active and (noise.bias_mean != 0.0 or noise.bias_stddev != 0.0)
        self._bias_mean, self._bias_stddev = noise.bias_mean, noise.bias_stddev
        self.stddev = float(noise.stddev) if active else 0.0
        self.precision = float(noise.precision) if active else 0.0
        self._block = max(int(block), 1)
        self.normals = np.zeros(max(TABLE_SIZE, 2 * self._block) if self.stddev > 0.0 else 1)
        self.bias = self._fill(rng)
        self.shift = self.bias + (float(noise.mean) if active else 0.0)

    def reset(self, rng):
        """Start the noise anew from ``rng``; a generator like that of the start gives the same noise again."""
        self._fill(rng)

    def advance(self, count):
        """Return the index in ``normals`` from where the next ``count`` draws are to be read.

        Raises
        ------
        ValueError
            If ``count`` is above the ``block`` the table was made for.
        """
        if count > self._block:
            raise ValueError("noise for %d values: the table was made for at most %d at once" % (count, self._block))
        if self.stddev == 0.0:
            return 0
        start = self._offset
        self._offset = (start + count) % (self.normals.size - self._block + 1)
        return start

    def _fill(self, rng):
        """Draw the bias and the table; the bias is drawn in any case so that the table stays the same."""
        bias = 0.0
        if self._biased:
            bias = rng.normal(self._bias_mean, self._bias_stddev)
            bias = -bias if rng.random() < 0.5 else bias
        if self.stddev > 0.0:
            rng.standard_normal(out=self.normals)
        self._offset = 0
        return float(bias)

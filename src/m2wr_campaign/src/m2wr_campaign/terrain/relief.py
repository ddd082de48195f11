# SPDX-License-Identifier: BSD-3-Clause
"""Heights of rough ground: a sum of reliefs, each from a seed of its own. A new relief is a function and a line."""
from __future__ import annotations

import math
import zlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Callable, Dict, Iterator, Mapping, Sequence, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]
    Relief = Callable[[np.random.Generator, "Grid", float], Array]

MOST_SAMPLES = 1025         # a side: 2 097 152 triangles, about what the simulator takes of one shape
LEAST_SIZE, MOST_SIZE = 1.0, 1000.0         # m, a side
MOST_HEIGHT = 10.0          # m, of one relief
ROUGHNESS = 2.2             # exponent of the power spectrum over the frequency, of a line across natural ground
LONGEST = 5.0               # m: longer waves of fractal ground are no higher than this one
START_RADIUS, START_BLEND = 0.6, 0.6        # m: level ground around the origin, and the ring in which it ends
KERB = 0.12                 # m, usual height of a kerb


@dataclass(frozen=True)
class Grid:
    """A square of samples around the origin.

    Attributes
    ----------
    samples : int
        A side, 2^n + 1 as Gazebo needs.
    size : float
        Of a side [m].
    """

    samples: int
    size: float

    def __post_init__(self) -> None:
        power = self.samples - 1
        if power < 2 or power & (power - 1) or self.samples > MOST_SAMPLES:
            raise ValueError("{} samples a side; expected 2^n + 1, which Gazebo needs, from 3 to {}, such as 257"
                             .format(self.samples, MOST_SAMPLES))
        if not LEAST_SIZE <= self.size <= MOST_SIZE:
            raise ValueError("a side of {:g} m; expected {:g} to {:g} m".format(self.size, LEAST_SIZE, MOST_SIZE))

    @property
    def cell(self) -> float:
        """Distance of two samples [m]."""
        return self.size / (self.samples - 1)

    @property
    def places(self) -> Tuple[Array, Array]:
        """Coordinates x and y of the samples, (samples, samples) each [m]; columns along x, rows against y."""
        ticks = np.linspace(-0.5 * self.size, 0.5 * self.size, self.samples)
        x, y = np.meshgrid(ticks, ticks[::-1])
        return x, y


def _fractal(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return ground with the spectrum of natural ground and the RMS height ``height``; by inverse Fourier transform."""
    count = grid.samples
    frequency = np.hypot(np.fft.fftfreq(2 * count, grid.cell)[:, None], np.fft.rfftfreq(2 * count, grid.cell)[None, :])
    # a line across the surface has the exponent ROUGHNESS if the surface has one more
    amplitude = np.maximum(frequency, 1.0 / LONGEST) ** (-0.5 * (ROUGHNESS + 1.0))
    amplitude[0, 0] = 0.0
    noise = random.standard_normal((2 * count, 2 * count))
    ground = np.fft.irfft2(np.fft.rfft2(noise) * amplitude, s=noise.shape)[:count, :count]
    ground -= ground.mean()
    return np.asarray(height * ground / max(float(ground.std()), 1e-12))


def _spots(random: np.random.Generator, grid: Grid, every: float) -> Array:
    """Return places (n, 2), one on each ``every`` square metres; at least one."""
    number = max(1, int(round(grid.size ** 2 / every)))
    return random.uniform(-0.5 * grid.size, 0.5 * grid.size, (number, 2))


def _turned(random: np.random.Generator, grid: Grid, spot: Array) -> Tuple[Array, Array]:
    x, y = grid.places
    yaw = random.uniform(-math.pi, math.pi)
    dx, dy = x - spot[0], y - spot[1]
    return dx * math.cos(yaw) + dy * math.sin(yaw), dy * math.cos(yaw) - dx * math.sin(yaw)


def _ramps(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return ramps 1 to 3 m long and 1.5 m wide that end in a drop of ``height``, one on 25 m^2."""
    ground = np.zeros((grid.samples, grid.samples))
    for spot in _spots(random, grid, 25.0):
        along, across = _turned(random, grid, spot)
        length = random.uniform(1.0, 3.0)
        inside = (np.abs(across) < 0.75) & (along >= 0.0) & (along <= length)
        ground = np.maximum(ground, np.where(inside, height * along / length, 0.0))
    return ground


def _steps(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return terraces along one direction: steps of ``height``, up and down at random, 0.6 to 2 m apart."""
    along, _ = _turned(random, grid, np.zeros(2))
    ground, at = np.zeros_like(along), -0.75 * grid.size
    level = 0
    while at < 0.75 * grid.size:
        up = 1 if level <= -2 else -1 if level >= 2 else int(random.choice((-1, 1)))
        level += up
        ground += np.where(along > at, up * height, 0.0)
        at += random.uniform(0.6, 2.0)
    return ground


def _kerbs(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return pavements 1.5 m wide, of ``height`` and with kerbs on both sides, straight across the square."""
    ground = np.zeros((grid.samples, grid.samples))
    for spot in _spots(random, grid, 100.0):
        _, across = _turned(random, grid, spot)
        ground = np.where(np.abs(across) < 0.75, height, ground)
    return ground


def _rubble(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return stones, two a square metre: ellipsoids half in the ground, 0.5 to 1.5 times ``height`` high."""
    ground = np.zeros((grid.samples, grid.samples))
    for spot in _spots(random, grid, 0.5):
        along, across = _turned(random, grid, spot)
        tall = height * random.uniform(0.5, 1.5)
        length, width = tall * random.uniform(1.0, 2.5), tall * random.uniform(1.0, 2.5)
        inside = np.maximum(1.0 - (along / length) ** 2 - (across / width) ** 2, 0.0) if tall > 0.0 else 0.0 * along
        ground = np.maximum(ground, tall * np.sqrt(inside))
    return ground


def _craters(random: np.random.Generator, grid: Grid, height: float) -> Array:
    """Return craters with the depth ``height`` and a rim of a quarter of it, radius 0.5 to 1.5 m, one on 20 m^2."""
    x, y = grid.places
    ground = np.zeros_like(x)
    for spot in _spots(random, grid, 20.0):
        radius = random.uniform(0.5, 1.5)
        away = np.hypot(x - spot[0], y - spot[1]) / radius
        bowl = height * (1.25 * away ** 2 - 1.0)
        rim = 0.25 * height * np.exp(-((away - 1.0) / 0.25) ** 2)
        ground += np.where(away < 1.0, bowl, rim)
    return ground


RELIEFS: Dict[str, Relief] = {"fractal": _fractal, "ramps": _ramps, "steps": _steps, "kerbs": _kerbs, "rubble": _rubble,
                              "craters": _craters}
DEFAULT_HEIGHTS = {"fractal": 0.05, "ramps": 0.2, "steps": 0.03, "kerbs": KERB, "rubble": 0.05, "craters": 0.25}     # m


def heights_of(grid: Grid, reliefs: Mapping[str, float], seed: int) -> Array:
    """Return the ground.

    Parameters
    ----------
    grid : Grid
    reliefs : mapping of str to float
        Of RELIEFS: the height of each [m].
    seed : int
        The same seed gives the same ground; a relief is the same whatever others there are.

    Returns
    -------
    (samples, samples) float64
        Heights [m], 0 around the origin, where a robot starts.

    Raises
    ------
    ValueError
        If a relief is unknown or a height is not 0 to MOST_HEIGHT.
    """
    ground = np.zeros((grid.samples, grid.samples))
    for name, height in sorted(reliefs.items()):
        if name not in RELIEFS:
            raise ValueError('there is no relief "{}"; expected some of {}'.format(name, ", ".join(sorted(RELIEFS))))
        if not 0.0 <= height <= MOST_HEIGHT:
            raise ValueError("{} has the height {:g} m; expected 0 to {:g} m".format(name, height, MOST_HEIGHT))
        ground += RELIEFS[name](np.random.default_rng([seed, zlib.crc32(name.encode())]), grid, height)
    x, y = grid.places
    middle = ground[grid.samples // 2, grid.samples // 2]
    outside = np.clip((np.hypot(x, y) - START_RADIUS) / START_BLEND, 0.0, 1.0)
    return np.asarray((ground - middle) * outside * outside * (3.0 - 2.0 * outside))


PATCHES = {"ground": 1.0, "sand": 0.5, "mud": 0.3, "ice": 0.1}      # friction coefficients of rubber, rounded


def patches_of(grid: Grid, names: Tuple[str, ...], share: float, seed: int) -> NDArray[np.int64]:
    """Return which patch the cells are of.

    Parameters
    ----------
    grid : Grid
    names : tuple of str
        Of PATCHES, without ``ground``.
    share : float
        Of the area that is not ``ground``, 0 to 1.
    seed : int

    Returns
    -------
    (samples - 1, samples - 1) int64
        0 for ground, else 1 + the index in ``names``.

    Raises
    ------
    ValueError
        If a patch is unknown or the share is not 0 to 1.
    """
    for name in names:
        if name not in PATCHES or name == "ground":
            raise ValueError('there is no patch "{}"; expected some of {}'.format(
                name, ", ".join(sorted(set(PATCHES) - {"ground"}))))
    if not 0.0 <= share <= 1.0:
        raise ValueError("patches on a share of {:g}; expected 0 to 1".format(share))
    cells = grid.samples - 1
    which = np.zeros((cells, cells), np.int64)
    if not names or share == 0.0:
        return which
    field = _fractal(np.random.default_rng([seed, zlib.crc32(b"patches")]), grid, 1.0)[:cells, :cells]
    covered = field >= np.quantile(field, 1.0 - share)
    kind = _fractal(np.random.default_rng([seed, zlib.crc32(b"kinds")]), grid, 1.0)[:cells, :cells]
    limits = np.quantile(kind[covered], np.arange(1, len(names)) / len(names))
    which[covered] = 1 + np.searchsorted(limits, kind[covered])
    return which


def patch_cells(which: NDArray[np.int64], names: Sequence[str]) -> Iterator[Tuple[str, NDArray[np.bool_]]]:
    """Yield the kind of ground of each patch that is there, and its cells; the first kind is ``ground``.

    Parameters
    ----------
    which : (samples - 1, samples - 1) int64
        See :func:`patches_of`.
    names : sequence of str
        Of the patches from 1 on.
    """
    for number, name in enumerate(["ground", *names]):
        chosen = which == number
        if chosen.any():
            yield name, chosen


def triangles_of(samples: NDArray[Any], chosen: NDArray[np.bool_]) -> NDArray[Any]:
    """Return the corners (n, 3, ...) of the two triangles of each chosen cell, split as those of a heightmap.

    Parameters
    ----------
    samples : (samples, samples, ...) array
        What a corner is: a point, or a number.
    chosen : (samples - 1, samples - 1) bool
    """
    top_left, top_right, low_left, low_right = (part[chosen] for part in (
        samples[:-1, :-1], samples[:-1, 1:], samples[1:, :-1], samples[1:, 1:]))
    return np.concatenate((np.stack((low_left, low_right, top_right), 1), np.stack((low_left, top_right, top_left), 1)))

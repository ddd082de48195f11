# SPDX-License-Identifier: BSD-3-Clause
"""What lies between a perfect picture and the one of a real camera: lens distortion, noise, and the pixel format."""
from __future__ import annotations

from typing import TYPE_CHECKING, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.rendering import output_kernels

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from m2wr_sim.model.types import Noise

    Bytes = NDArray[np.uint8]
    Floats = NDArray[np.float64]

TABLE = 2 ** 18             # draws of noise, 1 MB; each picture begins at a random one
_ROUNDS = 30                # of the inversion of the distortion
ENCODINGS = {"L8": "mono8", "L_INT8": "mono8", "L16": "mono16", "L_INT16": "mono16", "R8G8B8": "rgb8",
             "RGB8": "rgb8", "RGB_INT8": "rgb8", "B8G8R8": "bgr8", "BGR8": "bgr8", "BGR_INT8": "bgr8",
             "R16G16B16": "rgb16", "RGB_INT16": "rgb16", "BAYER_RGGB8": "bayer_rggb8", "BAYER_BGGR8": "bayer_bggr8",
             "BAYER_GBRG8": "bayer_gbrg8", "BAYER_GRBG8": "bayer_grbg8"}
_LUMINANCE = np.array((0.299, 0.587, 0.114), np.float32)


class PictureNoise:
    """Gaussian noise on each value of a picture; mean and standard deviation in units of the full range.

    Parameters
    ----------
    noise : Noise
    rng : numpy.random.Generator

    Raises
    ------
    ValueError
        If a number is not finite, or the standard deviation is negative.
    """

    def __init__(self, noise: Noise, rng: np.random.Generator) -> None:
        self._mean, self._stddev = (noise.mean, noise.stddev) if noise.kind.startswith("gaussian") else (0.0, 0.0)
        if not (abs(self._mean) <= 1.0 and 0.0 <= self._stddev <= 1.0):
            raise ValueError("camera: noise mean %r, stddev %r: expected -1 to 1, and 0 to 1"
                             % (self._mean, self._stddev))
        self.restart(rng)

    def restart(self, rng: np.random.Generator) -> None:
        """Restart from ``rng``; with the initial seed the noise is the same again."""
        self._rng, self._normals = rng, np.zeros(1, np.float32)

    def add(self, picture: Bytes) -> None:
        """Change a picture (height, width, 3) uint8."""
        if self._stddev == 0.0 and self._mean == 0.0:
            return
        if self._normals.size == 1 and self._stddev > 0.0:
            self._normals = self._rng.standard_normal(TABLE, np.float32)
        start = int(self._rng.integers(self._normals.size))
        output_kernels.add_noise(picture.reshape(-1), self._normals, start, self._mean, self._stddev)


class Distortion:
    """Distorts pictures as a lens does, by the model ``plumb_bob``.

    Parameters
    ----------
    coefficients : (7,) sequence of float
        k1 k2 k3 p1 p2, and the centre of distortion in x and y as shares of the picture.
    width, height : int
        [px].
    focal : float
        [px].
    crop : bool
        Whether a picture that the distortion shrinks is enlarged until its corners are filled.

    Raises
    ------
    ValueError
        If a coefficient is not finite, or too large for a picture to remain.
    """

    def __init__(self, coefficients: Sequence[float], width: int, height: int, focal: float, crop: bool) -> None:
        k1, k2, k3, p1, p2, cx, cy = coefficients
        if not all(abs(value) <= 100.0 for value in coefficients):
            raise ValueError("camera: distortion %r: expected numbers from -100 to 100" % (tuple(coefficients),))
        self._k, self._p = (k1, k2, k3), (p1, p2)
        middle = np.array((cx * width - 0.5, cy * height - 0.5))
        columns, rows = np.meshgrid(np.arange(width, dtype=float), np.arange(height, dtype=float))
        wanted = (np.stack((columns, rows), axis=-1) - middle) / focal      # in the distorted picture
        if crop and k1 < 0.0:
            corners = (np.array(((0.0, 0.0), (width - 1.0, height - 1.0))) - middle) / focal
            low, high = self._distorted(corners)
            share = np.stack((columns / max(width - 1, 1), rows / max(height - 1, 1)), axis=-1)
            wanted = low + share * (high - low)
        source = wanted.copy()
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):        # x = (wanted - tangential part) / radial part
                bent = self._distorted(source)
                source = source + (wanted - bent)
            inside = np.abs(self._distorted(source) - wanted).max(axis=-1) < 0.5 / focal
        pixels = source * focal + middle
        inside &= np.all(np.isfinite(pixels), axis=-1)
        pixels = np.where(inside[..., None], pixels, 0.0)
        limit = np.array((width - 1.0, height - 1.0))
        inside &= np.all((pixels >= -0.51) & (pixels <= limit + 0.51), axis=-1)
        if not inside.any():
            raise ValueError("camera: distortion %r leaves no picture" % (tuple(coefficients),))
        pixels = np.clip(pixels, 0.0, limit)
        first = np.minimum(np.floor(pixels), np.maximum(limit - 1.0, 0.0))
        self._sources = np.ascontiguousarray(np.where(inside[..., None], first, -1.0)[..., ::-1], np.int32)
        self._weights = np.ascontiguousarray((pixels - first)[..., ::-1], np.float32)
        self._flat = width < 2 or height < 2

    def _distorted(self, points: Floats) -> Floats:
        """Return where a lens shows points (..., 2) in units of the focal length."""
        x, y = points[..., 0], points[..., 1]
        square = x * x + y * y
        radial = 1.0 + square * (self._k[0] + square * (self._k[1] + square * self._k[2]))
        p1, p2 = self._p
        return np.stack((x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
                         y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y), axis=-1)

    def apply(self, picture: Bytes) -> Bytes:
        """Return the distorted picture (height, width, 3)."""
        if self._flat:
            return picture.copy()
        out = np.empty_like(picture)
        output_kernels.warp(out.reshape(-1, 3), picture, self._sources.reshape(-1, 2), self._weights.reshape(-1, 2))
        return out


def distortion_of(coefficients: Sequence[float], width: int, height: int, focal: float,
                  crop: bool) -> Optional[Distortion]:
    """Return the Distortion, or None if all coefficients are 0.

    Parameters
    ----------
    coefficients, width, height, focal, crop
        As for :class:`Distortion`.
    """
    if not any(coefficients[:5]):
        return None
    return Distortion(coefficients, width, height, focal, crop)


def encode(picture: Bytes, encoding: str) -> Tuple[Bytes, int]:
    """Return the data of an image message, (n,) uint8, and the bytes of a row.

    Parameters
    ----------
    picture : (height, width, 3) uint8
        Red, green, blue.
    encoding : str
        One of the values of ``ENCODINGS``.
    """
    width = picture.shape[1]
    if encoding == "rgb8":
        return picture.reshape(-1).copy(), 3 * width
    if encoding == "bgr8":
        return np.ascontiguousarray(picture[:, :, ::-1]).reshape(-1), 3 * width
    if encoding == "rgb16":
        return (picture.astype("<u2") * 257).reshape(-1).view(np.uint8), 6 * width
    if encoding.startswith("bayer_"):
        mosaic = np.empty(picture.shape[:2], np.uint8)
        for place, letter in enumerate(encoding[6:10]):
            j, i = divmod(place, 2)
            mosaic[j::2, i::2] = picture[j::2, i::2, "rgb".index(letter)]
        return mosaic.reshape(-1), width
    grey = (picture.astype(np.float32) @ _LUMINANCE + 0.5).astype(np.uint8)
    if encoding == "mono16":
        return (grey.astype("<u2") * 257).reshape(-1).view(np.uint8), 2 * width
    return grey.reshape(-1), width

# SPDX-License-Identifier: BSD-3-Clause
"""A depth image and its camera -> the ranges of a laser scan; without ROS."""
from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Mapping, Tuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

_MOST_ROWS = 10000
#: Encoding -> type of a pixel, and metres in its unit.
_DEPTHS = {"16UC1": ("u2", 0.001), "mono16": ("u2", 0.001), "32FC1": ("f4", 1.0)}


class ConfigurationError(Exception):
    """A parameter, an image or its calibration that cannot be used; the message says why."""


@dataclass(frozen=True)
class Settings:
    """Parameters of the node: rows, s, m, m, frame."""

    scan_height: int = 1
    scan_time: float = 0.033
    range_min: float = 0.45
    range_max: float = 10.0
    output_frame_id: str = "camera_depth_frame"


def read_settings(given: Mapping[str, Any]) -> Settings:
    """Read the parameters of the node.

    Parameters
    ----------
    given : mapping of str to object
        Name -> value; others are ignored.

    Returns
    -------
    Settings

    Raises
    ------
    ConfigurationError
        If a value is of a wrong type or out of its range.
    """
    default = Settings()
    rows = given.get("scan_height", default.scan_height)
    numbers = {name: given.get(name, getattr(default, name)) for name in ("scan_time", "range_min", "range_max")}
    frame = given.get("output_frame_id", default.output_frame_id)
    if isinstance(rows, bool) or not isinstance(rows, int) or not 1 <= rows <= _MOST_ROWS:
        raise ConfigurationError("scan_height is %r; expected a whole number of rows from 1 to %d" % (rows, _MOST_ROWS))
    for name, value in numbers.items():
        if isinstance(value, bool) or not isinstance(value, (int, float)) or not 0.0 <= value < math.inf:
            raise ConfigurationError("%s is %r; expected a finite number of at least 0" % (name, value))
    if numbers["range_min"] >= numbers["range_max"]:
        raise ConfigurationError("range_min is %g m and range_max %g m; expected the smaller one first" % (
            numbers["range_min"], numbers["range_max"]))
    if not isinstance(frame, str) or not frame:
        raise ConfigurationError("output_frame_id is %r; expected the name of a frame" % (frame,))
    return Settings(rows, float(numbers["scan_time"]), float(numbers["range_min"]), float(numbers["range_max"]), frame)


def depths_of(data: bytes, width: int, height: int, step: int, encoding: str,
              big_endian: bool) -> NDArray[np.float64]:
    """Return the depths [m] of an image as a (height, width) array; what has no depth is NaN, or inf if it is too far.

    Parameters
    ----------
    data : bytes
    width, height, step : int
        Columns, rows, bytes of a row.
    encoding : str
        16UC1 [mm] or 32FC1 [m].
    big_endian : bool

    Raises
    ------
    ConfigurationError
        If the encoding is another one or the size does not fit.
    """
    if encoding not in _DEPTHS:
        raise ConfigurationError("the encoding is %s; expected 16UC1 or 32FC1" % encoding)
    kind, unit = _DEPTHS[encoding]
    size = int(kind[1:])
    if width < 2 or height < 1 or step < width * size or len(data) < height * step:
        raise ConfigurationError("an image of %d x %d pixels with %d bytes a row has %d bytes; expected at least 2 x 1 "
                                 "pixels and all their bytes" % (width, height, step, len(data)))
    rows = np.frombuffer(data, np.uint8, height * step).reshape(height, step)[:, :width * size]
    depths = np.ascontiguousarray(rows).view((">" if big_endian else "<") + kind).astype(np.float64) * unit
    if kind == "u2":
        depths[depths == 0.0] = np.nan
    return depths


class Projection:
    """Where the columns of a camera go in a scan.

    Parameters
    ----------
    width : int
        Columns.
    fx, cx, cy : float
        Focal length and centre in pixels.

    Attributes
    ----------
    angle_min, angle_max, increment : float
        Of the scan [rad], from right to left.
    """

    def __init__(self, width: int, fx: float, cx: float, cy: float) -> None:
        if not (0.0 < fx < math.inf and math.isfinite(cx) and math.isfinite(cy)):
            raise ConfigurationError("a camera with a focal length of %g and its centre at %g, %g; expected finite "
                                     "numbers, the first above 0" % (fx, cx, cy))
        self.width, self.row = width, cy
        across = (np.arange(width) - cx) / fx
        angles = -np.arctan(across)
        self.angle_min, self.angle_max = float(angles[-1]), float(angles[0])
        self.increment = (self.angle_max - self.angle_min) / (width - 1)
        self._stretch = np.hypot(across, 1.0)
        self._places = np.clip(((angles - self.angle_min) / self.increment + 1e-9).astype(np.int64), 0, width - 1)

    def ranges(self, depths: NDArray[np.float64], settings: Settings) -> NDArray[np.float32]:
        """Return the ranges of a scan, from ``angle_min`` on.

        Parameters
        ----------
        depths : (height, width) float64
            [m].
        settings : Settings

        Returns
        -------
        (width,) float32
            [m]; NaN where nothing is seen, inf where all that is seen is too far.

        Raises
        ------
        ConfigurationError
            If the image has another width, or not as many rows above and below its centre.
        """
        first, last = self._rows(depths.shape, settings.scan_height)
        distances = depths[first:last] * self._stretch
        with np.errstate(invalid="ignore"):
            usable = (distances >= settings.range_min) & (distances <= settings.range_max)
        nearest = np.where(usable, distances, np.inf).min(axis=0)
        found = np.full(self.width, np.inf)
        np.minimum.at(found, self._places, nearest)
        far = np.zeros(self.width, bool)
        np.logical_or.at(far, self._places, np.isinf(distances).any(axis=0))
        found[np.isinf(found) & ~far] = np.nan
        return found.astype(np.float32)

    def _rows(self, shape: Tuple[int, ...], count: int) -> Tuple[int, int]:
        height, width = shape
        first = int(self.row - count // 2)
        if width != self.width:
            raise ConfigurationError("the image has %d columns and its calibration %d" % (width, self.width))
        if first < 0 or first + count > height:
            raise ConfigurationError("scan_height is %d; an image of %d rows with its centre in row %g does not have "
                                     "so many around it" % (count, height, self.row))
        return first, first + count

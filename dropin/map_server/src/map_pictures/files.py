# SPDX-License-Identifier: BSD-3-Clause
"""A map's YAML file and picture as a grid."""
from __future__ import annotations

import os
from typing import TYPE_CHECKING, NamedTuple, Optional, Tuple

import numpy as np

from m2wr_maps.map_input import MapInputError, number, origin_of, read_pixels, read_values, yes

if TYPE_CHECKING:
    from m2wr_node.array_types import FloatArray, Int8Array

MODES = ("trinary", "scale", "raw")


class SavedMap(NamedTuple):
    """A map: ``data`` (H, W) int8, lowest row first; ``resolution`` [m]; ``origin`` (x, y, yaw) [m, rad]."""

    data: Int8Array
    resolution: float
    origin: Tuple[float, float, float]


class MapError(ValueError):
    """A map cannot be read; the message names the file and what was expected."""


def cells(grey: FloatArray, alpha: Optional[FloatArray], negate: bool = False, occupied: float = 0.65,
          free: float = 0.196, mode: str = "trinary") -> Int8Array:
    """Return the values (H, W) int8 of a picture, lowest row first.

    Parameters
    ----------
    grey : (H, W) float64
        Mean of the colours, 0 to 255, top row first.
    alpha : (H, W) float64 or None
        Opacity; in the mode ``scale``, pixels that are not opaque are unknown.
    negate : bool
        Whether white is occupied.
    occupied, free : float
        Thresholds of the occupancy, 0 to 1.
    mode : str
        ``trinary``: 0, 100 or -1; ``scale``: also values between; ``raw``: grey values as they are, above 100 unknown.
    """
    if mode == "raw":
        value = grey.astype(int) if not negate else 255 - grey.astype(int)
        return np.where(value > 100, -1, value).astype(np.int8)[::-1]
    share = grey / 255.0 if negate else (255.0 - grey) / 255.0
    between = np.full(share.shape, -1.0)
    if mode == "scale":
        between = np.floor(99.0 * np.clip((share - free) / max(occupied - free, 1e-9), 0.0, 1.0))
        if alpha is not None:
            between = np.where(alpha < 1, -1.0, between)
    data = np.where(share > occupied, 100.0, np.where(share < free, 0.0, between))
    if mode == "scale" and alpha is not None:
        data = np.where(alpha < 1, -1.0, data)
    return data.astype(np.int8)[::-1]


def _named(path: str, error: Exception) -> MapError:
    return MapError("{}: {}".format(path, getattr(error, "strerror", None) or error))


def read_picture(path: str) -> Tuple[FloatArray, Optional[FloatArray]]:
    """Return the mean of the colours and the opacity, if any, of a picture: (H, W) 0 to 255; raises MapError."""
    try:
        pixels = read_pixels(path, lambda picture: "RGBA" if "A" in picture.getbands() or "transparency" in picture.info
                             else "RGB")
    except (OSError, MapInputError) as error:
        raise _named(path, error) from error
    return pixels[..., :3].mean(axis=2), pixels[..., 3] if pixels.shape[2] == 4 else None


def read_map(path: str) -> SavedMap:
    """Return the SavedMap of a YAML file; raises MapError."""
    try:
        values = read_values(path)
        resolution, (x, y, yaw) = number(values, "resolution", 1e-6, 1e6), origin_of(values, 3)
        mode = values.get("mode", "trinary")
        if mode not in MODES:
            raise MapInputError("mode is {!r:.60}; expected one of {}".format(mode, ", ".join(MODES)))
        occupied, free = (number(values, name, default=default) for name, default in (
            ("occupied_thresh", 0.65), ("free_thresh", 0.196)))
        negate = yes(values, "negate")
    except (OSError, MapInputError) as error:
        raise _named(path, error) from error
    grey, alpha = read_picture(os.path.join(os.path.dirname(os.path.abspath(path)), values["image"]))
    return SavedMap(cells(grey, alpha, negate, occupied, free, mode), resolution, (x, y, yaw))

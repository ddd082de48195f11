"""A map's YAML file and picture as a grid."""
import math
import os
from collections import namedtuple

import numpy as np
import yaml
from PIL import Image

MODES = ("trinary", "scale", "raw")

SavedMap = namedtuple("SavedMap", "data resolution origin")
SavedMap.__doc__ += ": data (H, W) int8, lowest row first; resolution [m]; origin (x, y, yaw) [m, rad]."


class MapError(ValueError):
    """A map cannot be read; the message names the file and what was expected."""


def _number(values, name, path, default=None):
    value = values.get(name, default)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise MapError("{}: {} is {!r}; expected a number".format(path, name, value))
    return float(value)


def cells(grey, alpha, negate=False, occupied=0.65, free=0.196, mode="trinary"):
    """Return the values (H, W) int8 of a picture, lowest row first.

    Parameters
    ----------
    grey : (H, W) float64
        Mean of the colours, 0 to 255, top row first.
    alpha : (H, W) uint8 or None
        Opaqueness; in the mode ``scale``, what is not opaque is unknown.
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


def read_picture(path):
    """Return (grey (H, W) float64, alpha or None) of a picture; raises MapError."""
    try:
        with Image.open(path) as picture:
            pixels = np.asarray(picture.convert("RGBA" if "A" in picture.getbands() or "transparency" in picture.info
                                                else "RGB"))
    except (OSError, ValueError) as error:
        raise MapError("{}: cannot be read as a picture: {}".format(path, error))
    return pixels[..., :3].mean(axis=2), pixels[..., 3] if pixels.shape[2] == 4 else None


def read_map(path):
    """Return the SavedMap of a YAML file; raises MapError."""
    try:
        with open(path, encoding="utf-8") as stream:
            values = yaml.safe_load(stream)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise MapError("{}: cannot be read: {}".format(path, error))
    if not isinstance(values, dict) or not isinstance(values.get("image"), str) or not values["image"]:
        raise MapError("{}: expected a map description with image, resolution and origin".format(path))
    resolution = _number(values, "resolution", path)
    if resolution <= 0.0:
        raise MapError("{}: resolution is {}; expected more than 0".format(path, resolution))
    origin = values.get("origin")
    if not isinstance(origin, list) or len(origin) != 3:
        raise MapError("{}: origin is {!r}; expected [x, y, yaw]".format(path, origin))
    origin = tuple(_number(dict(enumerate(origin)), index, path) for index in range(3))
    mode = values.get("mode", "trinary")
    if mode not in MODES:
        raise MapError("{}: mode is {!r}; expected one of {}".format(path, mode, ", ".join(MODES)))
    occupied, free = _number(values, "occupied_thresh", path, 0.65), _number(values, "free_thresh", path, 0.196)
    image = os.path.join(os.path.dirname(os.path.abspath(path)), values["image"])
    grey, alpha = read_picture(image)
    data = cells(grey, alpha, bool(_number(values, "negate", path, 0)), occupied, free, mode)
    return SavedMap(data, resolution, origin)

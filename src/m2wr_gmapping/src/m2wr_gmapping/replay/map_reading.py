"""Reading a map from the files that map_saver writes."""
import math
import os

import numpy as np
import yaml
from PIL import Image

from m2wr_gmapping.saved_map import SavedMap


class MapReadingError(ValueError):
    """A saved map cannot be read or used; says which file and what was expected."""


def _number(values, key, low, high):
    value = values.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not low <= value <= high:
        raise ValueError("{} is {!r}; expected a number from {} to {}".format(key, value, low, high))
    return float(value)


def read_map(path):
    """Return the SavedMap of a YAML file and its picture.

    Parameters
    ----------
    path : str
        The YAML file; its ending may be left out.

    Raises
    ------
    MapReadingError
        If a file cannot be read, a value is missing, or the map is turned against its frame.
    """
    path = path if os.path.splitext(path)[1] in (".yaml", ".yml") else path + ".yaml"
    try:
        with open(path, encoding="utf-8") as stream:
            values = yaml.safe_load(stream)
        if not isinstance(values, dict) or not isinstance(values.get("image"), str):
            raise ValueError("expected the keys image, resolution, origin, occupied_thresh, free_thresh, negate")
        resolution = _number(values, "resolution", 0.001, 10.0)
        origin = values.get("origin")
        if not (isinstance(origin, list) and len(origin) >= 2 and all(
                isinstance(v, (int, float)) and math.isfinite(v) for v in origin)):
            raise ValueError("origin is {!r}; expected [x, y, yaw]".format(origin))
        if len(origin) > 2 and abs(origin[2]) > 1e-6:
            raise ValueError("origin {} is turned; expected yaw 0".format(origin))
        if values.get("mode", "trinary") == "raw":
            raise ValueError("mode raw; expected trinary or scale")
        occupied, free = _number(values, "occupied_thresh", 0.0, 1.0), _number(values, "free_thresh", 0.0, 1.0)
        image = os.path.join(os.path.dirname(os.path.abspath(path)), values["image"])
        with Image.open(image) as opened:
            dark = 1.0 - np.asarray(opened.convert("L"), float)[::-1] / 255.0
    except (OSError, ValueError, yaml.YAMLError, Image.DecompressionBombError) as error:
        if isinstance(error, OSError) and error.strerror:
            error = "{}: {}".format(error.filename, error.strerror)
        raise MapReadingError("map {}: {}".format(path, error))
    if values.get("negate"):
        dark = 1.0 - dark
    data = np.select([dark > occupied, dark < free], [100, 0], -1).astype(np.int8)
    if not (data == 100).any():
        raise MapReadingError("map {}: no cell is occupied; there is nothing to begin on".format(path))
    return SavedMap(data, resolution, (float(origin[0]), float(origin[1])), path)

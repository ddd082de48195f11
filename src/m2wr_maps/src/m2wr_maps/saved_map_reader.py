# SPDX-License-Identifier: BSD-3-Clause
"""Reading a map from the files that map_saver writes."""
from __future__ import annotations

import os

import numpy as np

from m2wr_maps.map_input import MapInputError, number, origin_of, read_pixels, read_values, yes
from m2wr_maps.saved_map import SavedMap


class MapReadingError(ValueError):
    """A saved map cannot be read or used; says which file and what was expected."""


def read_map(path: str) -> SavedMap:
    """Return the SavedMap of a YAML file and its picture.

    Parameters
    ----------
    path : str
        The YAML file; its ending may be left out.

    Raises
    ------
    MapReadingError
        If a file cannot be read, a value is missing, or the map is rotated in its frame.
    """
    path = path if os.path.splitext(path)[1] in (".yaml", ".yml") else path + ".yaml"
    at = path
    try:
        values = read_values(path)
        resolution, origin = number(values, "resolution", 0.001, 10.0), origin_of(values)
        if abs(origin[2]) > 1e-6:
            raise MapInputError("origin {} is rotated; expected yaw 0".format(list(origin)))
        if values.get("mode", "trinary") == "raw":
            raise MapInputError("mode raw; expected trinary or scale")
        occupied, free = number(values, "occupied_thresh", 0.0, 1.0), number(values, "free_thresh", 0.0, 1.0)
        negate = yes(values, "negate")
        at = os.path.join(os.path.dirname(os.path.abspath(path)), values["image"])
        dark = 1.0 - read_pixels(at, lambda picture: "L")[::-1] / 255.0
    except (OSError, MapInputError) as error:
        raise MapReadingError("map {}: {}{}".format(
            path, "" if at == path else at + ": ", getattr(error, "strerror", None) or error)) from error
    if negate:
        dark = 1.0 - dark
    data = np.select([dark > occupied, dark < free], [100, 0], -1).astype(np.int8)
    if not (data == 100).any():
        raise MapReadingError("map {}: no cell is occupied; expected walls".format(path))
    return SavedMap(data, resolution, np.array(origin[:2], float), path)

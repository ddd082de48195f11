"""Saving a map as map_saver does, a PGM picture and a YAML file, without ever leaving half a map behind."""
import math
import os

import numpy as np

from m2wr_gmapping.whole_files import write_whole

FREE, OCCUPIED, UNKNOWN = 254, 0, 205


class MapFileError(OSError):
    """A map could not be written; the files that were there before are untouched."""


def picture(data, free=25, occupied=65):
    """Return the grey values (H, W) uint8 of a map, top row first.

    Parameters
    ----------
    data : (H, W) int8
        -1 unknown, 0 free to 100 occupied, lowest row first.
    free, occupied : int
        Values up to ``free`` are drawn free, from ``occupied`` on occupied, all others unknown.
    """
    values = np.arange(256).astype(np.uint8).view(np.int8)
    shades = np.full(256, UNKNOWN, np.uint8)
    shades[(values >= 0) & (values <= free)] = FREE
    shades[values >= occupied] = OCCUPIED
    return shades[np.ascontiguousarray(data, np.int8).view(np.uint8)[::-1]]


def pgm(data, resolution, free=25, occupied=65):
    """Return a map's picture as the parts of a file: bytes and what can be written like them."""
    grey = picture(data, free, occupied)
    head = "P5\n# CREATOR: map_saver.cpp {:.3f} m/pix\n{} {}\n255\n".format(resolution, grey.shape[1], grey.shape[0])
    return [head.encode(), np.ascontiguousarray(grey)]


def description(image, resolution, origin, free_thresh=0.196, occupied_thresh=0.65):
    """Return the text of a map's YAML file; ``origin`` is x, y, yaw of the lowest left cell."""
    return ("image: {}\nresolution: {:f}\norigin: [{:f}, {:f}, {:f}]\nnegate: 0\noccupied_thresh: {:g}\n"
            "free_thresh: {:g}\n\n".format(image, resolution, *origin, occupied_thresh, free_thresh))


def save(name, data, resolution, origin, free=25, occupied=65):
    """Write ``name``.pgm and ``name``.yaml.

    Both are complete on disk before either takes the place of an older one.

    Parameters
    ----------
    origin : (3,) float
        x, y [m], yaw [rad].

    Returns
    -------
    list of str
        The two paths.

    Raises
    ------
    ValueError
        If the thresholds do not fit, the map holds no cell or the name none.
    MapFileError
        If a file cannot be written.
    """
    data = np.asarray(data)
    if not 0 <= free < occupied <= 100:
        raise ValueError("thresholds free {} and occupied {}: expected 0 <= free < occupied <= 100".format(
            free, occupied))
    if data.ndim != 2 or not data.size:
        raise ValueError("the map has the shape {}; expected rows and columns".format(data.shape))
    if not (math.isfinite(resolution) and resolution > 0.0):
        raise ValueError("the map's resolution is {}; expected more than 0".format(resolution))
    if not os.path.basename(name):
        raise ValueError("the map's name is {!r}; expected one of a file, without ending".format(name))
    paths = [name + ".pgm", name + ".yaml"]
    image = os.path.basename(paths[0]) if os.path.isabs(name) or os.path.dirname(name) else paths[0]
    contents = [pgm(data, resolution, free, occupied), [description(image, resolution, origin).encode()]]
    try:
        write_whole(*zip(paths, contents))
    except OSError as error:
        raise MapFileError("cannot write the map {}.pgm and .yaml: {}; what was there before is kept".format(
            name, error.strerror or error))
    return paths

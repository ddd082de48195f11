# SPDX-License-Identifier: BSD-3-Clause
"""Reads the two files of a saved map, YAML and picture.  They are untrusted: bounded, checked, never evaluated."""
from __future__ import annotations

import math
import os
import stat
from typing import TYPE_CHECKING, Any, Callable, Dict, List, Optional, Tuple, Union

import numpy as np
import yaml
from PIL import Image

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_YAML = 64 * 1024               # [byte]; map_saver writes 130
MOST_DEPTH = 20                     # of lists and tables in it
MOST_PICTURE = 512 * 1024 * 1024    # of the file [byte]
MOST_PIXELS = 100000000
FORMATS = ("PNG", "PPM", "BMP", "GIF", "JPEG", "TIFF")      # others may start programs to be read


class MapInputError(ValueError):
    """A map's file cannot be used; says what was found and what was expected, not which file."""


def _regular(path: str, most: int) -> None:
    """Raise MapInputError unless a path leads to a regular file of at most ``most`` bytes; OSError without."""
    found = os.stat(path)
    if not stat.S_ISREG(found.st_mode):
        raise MapInputError("is no regular file")
    if found.st_size > most:
        raise MapInputError("has {} bytes; expected at most {}".format(found.st_size, most))


def read_values(path: str) -> Dict[str, Any]:
    """Return the table in a map's YAML file: words, lists and tables, no number is made of a word yet.

    Raises
    ------
    MapInputError, OSError
        If it is no table, too large or nested too deep.
    """
    _regular(path, MOST_YAML)
    try:
        with open(path, encoding="utf-8") as stream:
            text = stream.read()
        depth = 0
        for event in yaml.parse(text, Loader=yaml.BaseLoader):
            depth += isinstance(event, (yaml.SequenceStartEvent, yaml.MappingStartEvent))
            depth -= isinstance(event, (yaml.SequenceEndEvent, yaml.MappingEndEvent))
            if depth > MOST_DEPTH:
                raise MapInputError("nested more than {} deep".format(MOST_DEPTH))
        values = yaml.load(text, Loader=yaml.BaseLoader)        # makes text, lists and tables of everything
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise MapInputError("no YAML: {:.300}".format(" ".join(str(error).split()))) from error
    if not isinstance(values, dict) or not isinstance(values.get("image"), str) or not values["image"]:
        raise MapInputError("expected the keys image, resolution, origin, occupied_thresh, free_thresh, negate")
    return values


def number(values: Union[Dict[str, Any], List[Any]], key: Any, low: float = -1e9, high: float = 1e9,
           default: Optional[float] = None) -> float:
    """Return a number of a table or a list.

    Parameters
    ----------
    values : dict or list
        From :func:`read_values`, or a list in it.
    key : str or int
        Key in the table, or index in the list.
    low, high : float
        Limits, both allowed.
    default : float, optional
        Value of a missing key.

    Raises
    ------
    MapInputError
        If it is not a number within the limits.
    """
    word = values.get(key, default) if isinstance(values, dict) else values[key]
    try:
        value = float(word) if isinstance(word, (str, float, int)) and len(str(word)) < 100 else math.nan
    except ValueError:
        value = math.nan
    if not low <= value <= high:
        raise MapInputError("{} is {!r:.60}; expected a number from {:g} to {:g}".format(key, word, low, high))
    return value


def yes(values: Dict[str, Any], key: str) -> bool:
    """Return whether a table says 1, or true in any of YAML's spellings.

    Parameters
    ----------
    values : dict
        From :func:`read_values`.
    key : str
        Key in the table.

    Raises
    ------
    MapInputError
        If it is neither a truth value nor a number.
    """
    word = str(values.get(key, "0")).lower()
    if word in ("true", "yes", "on"):
        return True
    return word not in ("false", "no", "off", "") and bool(number(values, key, default=0))


def origin_of(values: Dict[str, Any], least: int = 2) -> Tuple[float, ...]:
    """Return x, y [m] and yaw [rad] of a table's ``origin``.

    Parameters
    ----------
    values : dict
        From :func:`read_values`.
    least : int
        Smallest number of values; with 2, a missing yaw is 0.

    Raises
    ------
    MapInputError
        If it is not a list of that many numbers.
    """
    origin = values.get("origin")
    if not isinstance(origin, list) or not least <= len(origin) <= 3:
        raise MapInputError("origin is {!r:.60}; expected [x, y, yaw]".format(origin))
    try:
        return tuple(number(origin, index) for index in range(len(origin))) + (0.0,) * (3 - len(origin))
    except MapInputError:
        raise MapInputError("origin is {!r:.60}; expected three numbers [x, y, yaw]".format(origin)) from None


def read_pixels(path: str, modes: Callable[[Image.Image], str]) -> NDArray[Any]:
    """Return the pixels of a picture, top row first.

    Parameters
    ----------
    path : str
    modes : callable
        From the opened picture to the mode of Pillow that is wanted.

    Raises
    ------
    MapInputError, OSError
        If it is no picture, of a kind that is not read, or too large; told before memory is taken for it.
    """
    if "\0" in path:
        raise MapInputError("its name holds a zero")
    _regular(path, MOST_PICTURE)
    try:
        with Image.open(path) as picture:
            if picture.format not in FORMATS:
                raise MapInputError("is a {} picture; expected one of {}".format(picture.format, ", ".join(FORMATS)))
            if picture.size[0] * picture.size[1] > MOST_PIXELS:
                raise MapInputError("has {} x {} pixels; expected at most {} in all".format(*picture.size, MOST_PIXELS))
            return np.asarray(picture.convert(modes(picture)))
    except MapInputError:
        raise
    except Exception as error:          # whatever a broken file provokes in its decoder
        raise MapInputError("cannot be read as a picture: {:.200}".format(str(error) or repr(error))) from error

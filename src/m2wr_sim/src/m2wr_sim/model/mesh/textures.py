# SPDX-License-Identifier: BSD-3-Clause
"""Pictures on surfaces, and Ogre's material scripts (``.material``) as far as they name a colour and a picture."""
from __future__ import annotations

import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Dict, List, Optional, Sequence, Tuple

import numpy as np

from m2wr_sim.model.source_files import note_file, stamp_of
from m2wr_sim.model.xml.safe import XmlError, shorten

if TYPE_CHECKING:
    from numpy.typing import NDArray

MOST_TEXELS = 4096 * 4096
_SIDE = 2048                    # px; larger pictures are reduced, as no camera resolves them
_PICTURES = ("PNG", "PPM", "BMP", "GIF", "JPEG", "TIFF", "TGA")     # others may start programs to be read
_MOST_SCRIPTS, _MOST_BYTES, _KEPT = 200, 2 ** 20, 64
_NAME = re.compile(r'^\s*material\s+("[^"]+"|[^\s:{]+)(?:\s*:\s*[^{]*)?', re.MULTILINE)


@dataclass(frozen=True, eq=False)
class Texture:
    """A picture on a surface; ``pixels`` is (height, width, 3) uint8, red, green, blue."""

    pixels: NDArray[np.uint8]


@dataclass(frozen=True)
class Script:
    """What a material script says: colour from 0 to 1, path of the picture, how often it repeats across a surface."""

    colour: Optional[Tuple[float, float, float]] = None
    picture: str = ""
    repeat: Tuple[float, float] = (1.0, 1.0)


_textures: Dict[Tuple[str, object], Texture] = {}


def read_texture(path: str) -> Texture:
    """Read a picture.

    Raises
    ------
    XmlError
        If it cannot be read or is too large.
    """
    note_file(path)
    key = os.path.realpath(path), stamp_of(path)
    if key in _textures:
        return _textures[key]
    try:
        from PIL import Image
    except ImportError as error:
        raise XmlError("{}: {}; expected the Python package Pillow, which reads pictures".format(path, error)) from None
    try:
        if not os.path.isfile(path):
            raise XmlError("{}: is no regular file; expected a picture such as a PNG".format(path))
        with Image.open(path) as picture:
            if picture.format not in _PICTURES:
                raise XmlError("{}: is a {} picture; expected one of {}".format(
                    path, picture.format, ", ".join(_PICTURES)))
            if picture.size[0] * picture.size[1] > MOST_TEXELS:
                raise XmlError("{}: the picture has {} x {} pixels; expected at most {} in all".format(
                    path, picture.size[0], picture.size[1], MOST_TEXELS))
            small = picture.convert("RGB")
            if max(small.size) > _SIDE:
                small.thumbnail((_SIDE, _SIDE))
            texture = Texture(np.array(small, np.uint8))
    except XmlError:
        raise
    except Exception as error:      # any error of the parser in a broken file
        raise XmlError("{}: cannot be read: {}; expected a picture such as a PNG".format(
            path, shorten(str(error), 200))) from None
    while len(_textures) >= _KEPT:
        del _textures[next(iter(_textures))]
    _textures[key] = texture
    return texture


def find_script(name: str, places: Sequence[str]) -> Optional[Script]:
    """Return the material of a name from scripts in files and folders, None if none defines it.

    Parameters
    ----------
    name : str
    places : sequence of str
        Paths of ``.material`` files, and of folders with such files or with pictures.
    """
    folders = [place if os.path.isdir(place) else os.path.dirname(place) for place in places]
    for path in _scripts(places):
        try:
            if os.path.getsize(path) > _MOST_BYTES:
                continue
            with open(path, encoding="utf-8", errors="replace") as stream:
                text = re.sub(r"//[^\n]*|/\*.*?\*/", "", stream.read(), flags=re.DOTALL)
        except OSError:
            continue
        for found in _NAME.finditer(text):
            if found.group(1).strip('"') == name:
                beside = os.path.dirname(path)
                return _parse(_block(text, found.end()),
                              folders + [beside, os.path.join(beside, "..", "textures")])
    return None


def _scripts(places: Sequence[str]) -> List[str]:
    found: List[str] = []
    for place in places:
        if os.path.isdir(place):
            found.extend(os.path.join(place, entry) for entry in sorted(os.listdir(place))
                         if entry.endswith(".material"))
        elif place.endswith(".material"):
            found.append(place)
    return found[:_MOST_SCRIPTS]


def _block(text: str, start: int) -> str:
    """Return what is between the next brace and the one that closes it."""
    depth, begin = 0, text.find("{", start)
    for place in range(max(begin, 0), len(text)):
        depth += {"{": 1, "}": -1}.get(text[place], 0)
        if depth == 0:
            return text[begin + 1:place]
    return text[begin + 1:]


def _parse(block: str, folders: Sequence[str]) -> Script:
    colour: Optional[Tuple[float, float, float]] = None
    numbers = _words(block, "diffuse") or _words(block, "ambient")
    try:
        red, green, blue = (min(max(float(word), 0.0), 1.0) for word in numbers[:3])
        colour = red, green, blue
    except ValueError:
        pass
    named, path = _words(block, "texture"), ""
    if named:
        candidates = [os.path.join(folder, named[0].strip('"')) for folder in folders]
        path = next((candidate for candidate in candidates if os.path.isfile(candidate)), named[0])
    repeat = (1.0, 1.0)
    try:
        x, y = (float(word) for word in _words(block, "scale")[:2])
        if 1e-6 < abs(x) < 1e6 and 1e-6 < abs(y) < 1e6:
            repeat = 1.0 / x, 1.0 / y
    except ValueError:
        pass
    return Script(colour, path, repeat)


def _words(block: str, key: str) -> List[str]:
    """Return the words after the first ``key`` at the beginning of a line."""
    found = re.search(r"(?:^|[{{;])\s*{}[ \t]+([^\n}}]*)".format(key), block, re.MULTILINE)
    return found.group(1).split() if found else []

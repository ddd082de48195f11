# SPDX-License-Identifier: BSD-3-Clause
"""Saving of a map as map_saver does: a PGM picture and a YAML file, which belong together at every moment.

Two files cannot be replaced atomically, but the YAML file can, and it names the picture. If there is an older map, the
new picture is first written as ``NAME-DIGEST.pgm``, and the YAML file is replaced by one that names it. Then
``NAME.pgm`` is replaced, and the YAML file again, and the picture with the digest is removed. A killed program leaves a
consistent pair and perhaps one more picture, which ``tidy`` removes.
"""
from __future__ import annotations

import hashlib
import logging
import math
import os
import re
from dataclasses import dataclass
from typing import TYPE_CHECKING, Iterable, Iterator, List, Optional, Sequence

import numpy as np

from m2wr_files.atomic_files import Part, remove_stale, write_atomically

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from m2wr_node.array_types import Int8Array, Uint8Array

log = logging.getLogger(__name__)
DIGITS = 12             # of the digest in a name

FREE, OCCUPIED, UNKNOWN = 254, 0, 205
BAND = 256              # rows of the picture in one part


class MapFileError(OSError):
    """A map could not be written; older files are unchanged."""


def picture(data: ArrayLike, free: int = 25, occupied: int = 65) -> Uint8Array:
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


@dataclass(frozen=True)
class PgmFile:
    """The content of a map's picture, in parts that each iteration makes again: a second map would need memory.

    Attributes
    ----------
    data : (H, W) int8
        As for :func:`picture`.
    resolution : float
        Cell size [m].
    free, occupied : int
        As for :func:`picture`.
    """

    data: Int8Array
    resolution: float
    free: int
    occupied: int

    def __iter__(self) -> Iterator[Part]:
        """Yield the header and the grey values, top row first."""
        rows, columns = self.data.shape
        yield "P5\n# CREATOR: map_saver.cpp {:.3f} m/pix\n{} {}\n255\n".format(self.resolution, columns, rows).encode()
        for end in range(rows, 0, -BAND):
            yield np.ascontiguousarray(picture(self.data[max(0, end - BAND):end], self.free, self.occupied)).data


def description(image: str, resolution: float, origin: Sequence[float], free_thresh: float = 0.196,
                occupied_thresh: float = 0.65) -> str:
    """Return the text of a map's YAML file.

    Parameters
    ----------
    image : str
        File name of the picture.
    resolution : float
        Cell size [m].
    origin : (3,) float
        x, y [m], yaw [rad] of the lower left corner in the frame of the map.
    free_thresh, occupied_thresh : float
        Probabilities below and above which map_server reads a cell as free or occupied.
    """
    return ("image: {}\nresolution: {:f}\norigin: [{:f}, {:f}, {:f}]\nnegate: 0\noccupied_thresh: {:g}\n"
            "free_thresh: {:g}\n\n".format(image, resolution, *origin, occupied_thresh, free_thresh))


def save(name: str, data: ArrayLike, resolution: float, origin: Sequence[float], free: int = 25,
         occupied: int = 65) -> List[str]:
    """Write ``name``.pgm and ``name``.yaml; the YAML file names a picture of the same map at every moment.

    Parameters
    ----------
    name : str
        Path without ending.
    data : (H, W) int8
        As for :func:`picture`.
    resolution : float
        Cell size [m].
    origin : (3,) float
        x, y [m], yaw [rad] of the lower left corner in the frame of the map.
    free, occupied : int
        As for :func:`picture`.

    Returns
    -------
    list of str
        The two paths. If only ``name``.pgm cannot be replaced, the picture has a digest in its name.

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
    parts = PgmFile(data, resolution, free, occupied)
    spare = "{}-{}.pgm".format(name, _digest(parts))

    def described(image: str) -> List[Part]:
        return [description(os.path.basename(image), resolution, origin).encode()]
    picture_path, yaml_path = name + ".pgm", name + ".yaml"
    try:
        if not os.path.lexists(yaml_path):
            write_atomically((picture_path, parts), (yaml_path, described(picture_path)))
            tidy(name)
            return [picture_path, yaml_path]
        write_atomically((spare, parts))
        try:
            write_atomically((yaml_path, described(spare)))
        except OSError:
            os.unlink(spare)
            raise
    except OSError as error:
        raise MapFileError("cannot write the map {}.pgm and .yaml: {}; what was there before is kept".format(
            name, error.strerror or error)) from error
    try:
        write_atomically((picture_path, parts))
        write_atomically((yaml_path, described(picture_path)))
    except OSError as error:
        log.warning("cannot replace %s: %s; the picture of the new map is %s", picture_path, error.strerror or error,
                    spare)
        return [spare, yaml_path]
    tidy(name)
    return [picture_path, yaml_path]


def _digest(parts: Iterable[Part]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:DIGITS]


def tidy(name: str) -> List[str]:
    """Remove files that a killed writer of the map ``name`` left; returns the paths.

    These are temporary files without a writer, and pictures with a digest in their name that the YAML file does not
    name.
    """
    folder, base = os.path.split(os.path.abspath(name))
    removed = remove_stale(folder)
    spare = re.compile(re.escape(base) + "-([0-9a-f]{%d})[.]pgm" % DIGITS)
    try:
        found = [(entry, spare.fullmatch(entry)) for entry in os.listdir(folder)]
        named = _named_by(name + ".yaml")
        for entry, match in found:
            path = os.path.join(folder, entry)
            if match and entry != named and os.path.isfile(path) and not os.path.islink(path):
                with open(path, "rb") as stream:
                    if _digest(iter(lambda: stream.read(1 << 20), b"")) == match.group(1):
                        os.unlink(path)
                        removed.append(path)
    except OSError as error:
        log.warning("cannot tidy up beside the map %s: %s", name, error)
    return removed


def _named_by(path: str) -> Optional[str]:
    """Return the picture that a YAML file of this module names; None if there is no such file."""
    try:
        with open(path, "rb") as stream:
            first = stream.readline(4096)
    except FileNotFoundError:
        return None
    return os.fsdecode(first[len(b"image: "):].strip()) if first.startswith(b"image: ") else None

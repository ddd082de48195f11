# SPDX-License-Identifier: BSD-3-Clause
"""Saving of a map as map_saver does: a PGM picture and a YAML file, which belong together at every moment.

Two files cannot be replaced atomically, but the YAML file can, and it names the picture. If there is an older map, the
new picture is first written as ``NAME-DIGEST.pgm``, and the YAML file is replaced by one that names it. Then
``NAME.pgm``
is replaced, and the YAML file again, and the picture with the digest is removed. A killed program leaves a consistent
pair and perhaps one more picture, which ``tidy`` removes.
"""
import hashlib
import logging
import math
import os
import re

import numpy as np

from m2wr_gmapping.io.atomic_files import remove_stale, write_atomically

log = logging.getLogger(__name__)
DIGITS = 12             # of the digest in a name

FREE, OCCUPIED, UNKNOWN = 254, 0, 205


class MapFileError(OSError):
    """A map could not be written; older files are unchanged."""


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
    """Return a map's picture as parts of a file: bytes-like objects."""
    grey = picture(data, free, occupied)
    head = "P5\n# CREATOR: map_saver.cpp {:.3f} m/pix\n{} {}\n255\n".format(resolution, grey.shape[1], grey.shape[0])
    return [head.encode(), np.ascontiguousarray(grey)]


def description(image, resolution, origin, free_thresh=0.196, occupied_thresh=0.65):
    """Return the text of a map's YAML file; ``origin`` is x, y, yaw of the lowest left cell."""
    return ("image: {}\nresolution: {:f}\norigin: [{:f}, {:f}, {:f}]\nnegate: 0\noccupied_thresh: {:g}\n"
            "free_thresh: {:g}\n\n".format(image, resolution, *origin, occupied_thresh, free_thresh))


def save(name, data, resolution, origin, free=25, occupied=65):
    """Write ``name``.pgm and ``name``.yaml; the YAML file names a picture of the same map at every moment.

    Parameters
    ----------
    origin : (3,) float
        x, y [m], yaw [rad].

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
    parts = pgm(data, resolution, free, occupied)
    spare = "{}-{}.pgm".format(name, _digest(parts))

    def described(image):
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


def _digest(parts):
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()[:DIGITS]


def tidy(name):
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


def _named_by(path):
    """Return the picture that a YAML file of this module names; None if there is no such file."""
    try:
        with open(path, "rb") as stream:
            first = stream.readline(4096)
    except FileNotFoundError:
        return None
    return os.fsdecode(first[len(b"image: "):].strip()) if first.startswith(b"image: ") else None

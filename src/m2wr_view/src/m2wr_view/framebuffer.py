# SPDX-License-Identifier: BSD-3-Clause
"""Reads the screen of a virtual display, which Xvfb keeps in a file in the format of xwd."""
from __future__ import annotations

import struct

import numpy as np
from PIL import Image

from m2wr_view.errors import ViewError

_FIELDS = 25                # 32-bit numbers, the high byte first
_VERSION, _Z_PIXMAP = 7, 2
_COLOUR_BYTES = 12          # of an entry of the colour table


def read_xwd(data: bytes, origin: str) -> Image.Image:
    """Return the picture in an X window dump.

    Parameters
    ----------
    data : bytes
        The dump: depth 24 in 32 bits a pixel.
    origin : str
        Where it is from, for messages.

    Returns
    -------
    PIL.Image.Image
        RGB.

    Raises
    ------
    ViewError
        If it is no such dump, or incomplete.
    """
    if len(data) < 4 * _FIELDS:
        raise ViewError("screen %s: %d bytes; expected an X window dump" % (origin, len(data)))
    fields = struct.unpack(">%dI" % _FIELDS, data[:4 * _FIELDS])
    header, version, kind, _, width, height, _, low_first, _, _, _, bits, line = fields[:13]
    masks, colours = fields[14:17], fields[19]
    low_first = low_first == 0
    if version != _VERSION or kind != _Z_PIXMAP or bits != 32 or masks != (0xff0000, 0xff00, 0xff) \
            or width * height == 0 or line < 4 * width:
        raise ViewError("screen %s: version %d, kind %d, %d x %d, %d bits a pixel, masks %s; expected depth 24"
                        % (origin, version, kind, width, height, bits, masks))
    start = header + _COLOUR_BYTES * colours
    if len(data) < start + line * height:
        raise ViewError("screen %s: %d bytes; expected %d for %d x %d pixels"
                        % (origin, len(data), start + line * height, width, height))
    pixels = np.frombuffer(data, dtype=np.uint8, count=line * height, offset=start).reshape(height, line)
    pixels = pixels[:, :4 * width].reshape(height, width, 4)
    return Image.fromarray(np.ascontiguousarray(pixels[:, :, 2::-1] if low_first else pixels[:, :, 1:]))

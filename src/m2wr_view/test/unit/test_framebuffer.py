# SPDX-License-Identifier: BSD-3-Clause
"""Reading the screen that Xvfb keeps in a file."""
import struct

import numpy as np
import pytest

from m2wr_view.errors import ViewError
from m2wr_view.framebuffer import read_xwd

WIDTH, HEIGHT = 3, 2
PIXELS = np.arange(WIDTH * HEIGHT * 3, dtype=np.uint8).reshape(HEIGHT, WIDTH, 3)


def dump(low_first=True, version=7, bits=32, pad=0, colours=2, masks=(0xff0000, 0xff00, 0xff)):
    """Return an X window dump of PIXELS, written here after the format's description."""
    name = b"screen\0\0"
    line = 4 * WIDTH + pad
    header = struct.pack(">25I", 100 + len(name), version, 2, 24, WIDTH, HEIGHT, 0, 0 if low_first else 1, 32, 0, 32,
                         bits, line, 4, *masks, 8, 256, colours, WIDTH, HEIGHT, 0, 0, 0)
    rows = b""
    for row in PIXELS.tolist():
        for red, green, blue in row:
            rows += bytes((blue, green, red, 0)) if low_first else bytes((0, red, green, blue))
        rows += b"\0" * pad
    return header + name + b"\0" * (12 * colours) + rows


@pytest.mark.parametrize("options", [{}, {"low_first": False}, {"pad": 4}, {"colours": 256}])
def test_pixels_come_out_as_they_are(options):
    assert np.array_equal(np.asarray(read_xwd(dump(**options), "of a test")), PIXELS)


def test_more_bytes_than_needed_do_no_harm():
    assert np.array_equal(np.asarray(read_xwd(dump() + b"\0" * 100, "of a test")), PIXELS)


@pytest.mark.parametrize("data", [b"", b"\0" * 200, dump()[:-1], dump(version=6), dump(bits=16),
                                  dump(masks=(0xff, 0xff00, 0xff0000))])
def test_anything_else_is_refused_by_name(data):
    with pytest.raises(ViewError, match="screen of a test"):
        read_xwd(data, "of a test")

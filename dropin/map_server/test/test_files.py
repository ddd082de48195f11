# SPDX-License-Identifier: BSD-3-Clause
"""Reading of saved maps: thresholds, modes, and faulty files."""
import os
import sys

import numpy as np
import pytest
from PIL import Image

sys.path.insert(0, os.path.join(os.path.dirname(os.path.dirname(os.path.abspath(__file__))), "src"))
from map_pictures.files import MapError, cells, read_map  # noqa: E402

YAML = "image: {}\nresolution: 0.05\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
GREY = np.array([[0.0, 254.0], [205.0, 100.0]])


def write(folder, text=None, pixels=GREY, picture="m.pgm"):
    Image.fromarray(pixels.astype(np.uint8)).save(str(folder / picture))
    path = folder / "m.yaml"
    path.write_text(YAML.format(picture) if text is None else text)
    return str(path)


def test_grey_values_become_cells_lowest_row_first(tmp_path):
    saved = read_map(write(tmp_path))
    np.testing.assert_array_equal(saved.data, [[-1, -1], [100, 0]])
    assert (saved.resolution, saved.origin) == (0.05, (-1.0, 2.0, 0.0))


def test_negate_swaps_black_and_white():
    np.testing.assert_array_equal(cells(GREY, None, negate=True), [[100, -1], [0, 100]])


def test_scale_grades_between_the_thresholds():
    data = cells(np.array([[0.0, 255.0, 127.5]]), None, occupied=0.9, free=0.1, mode="scale")
    np.testing.assert_array_equal(data, [[100, 0, 49]])


def test_scale_regards_transparent_pixels_as_unknown():
    data = cells(np.array([[0.0, 255.0]]), np.array([[0, 255]]), mode="scale")
    np.testing.assert_array_equal(data, [[-1, 0]])


def test_raw_keeps_values_up_to_100():
    np.testing.assert_array_equal(cells(np.array([[0.0, 100.0, 101.0]]), None, mode="raw"), [[0, 100, -1]])


@pytest.mark.parametrize("text, words", [
    ("- 1", "expected the keys image"),
    ("image: gone.pgm\nresolution: 0.05\norigin: [0, 0, 0]", "gone.pgm: No such file"),
    ("image: m.pgm\nresolution: 0\norigin: [0, 0, 0]", "resolution is '0'; expected a number from 1e-06"),
    ("image: m.pgm\nresolution: wide\norigin: [0, 0, 0]", "resolution is 'wide'"),
    ("image: m.pgm\nresolution: 0.05\norigin: [0, 0]", "expected [x, y, yaw]"),
    ("image: m.pgm\nresolution: 0.05\norigin: [0, 0, 0]\nmode: fancy", "trinary, scale, raw"),
    ("image: [", "no YAML"),
])
def test_the_fault_of_a_file_is_named(tmp_path, text, words):
    with pytest.raises(MapError) as caught:
        read_map(write(tmp_path, text))
    assert words in str(caught.value)

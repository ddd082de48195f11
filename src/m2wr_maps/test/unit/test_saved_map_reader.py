# SPDX-License-Identifier: BSD-3-Clause
"""Reading a saved map: its cells and place, and a clear error for each fault."""
import numpy as np
import pytest
from PIL import Image

from m2wr_maps.saved_map_reader import MapReadingError, read_map

GOOD = {"image": "a.pgm", "resolution": 0.1, "origin": [1.0, 2.0, 0.0], "negate": 0, "occupied_thresh": 0.65,
        "free_thresh": 0.196}


def written(tmp_path, **values):
    """Write a map; a value of None leaves the key out."""
    lines = ["%s: %s" % item for item in dict(GOOD, **values).items() if item[1] is not None]
    (tmp_path / "a.yaml").write_text("\n".join(lines) + "\n")
    Image.fromarray(np.array([[0, 254, 205], [254, 254, 100]], np.uint8)).save(str(tmp_path / "a.pgm"))
    return str(tmp_path / "a.yaml")


def test_row_order_and_thresholds(tmp_path):
    saved = read_map(written(tmp_path))
    np.testing.assert_array_equal(saved.data, [[0, 0, -1], [100, 0, -1]])
    assert saved.origin.tolist() == [1.0, 2.0] and saved.walls().tolist() == [[1.0], [2.1]]
    np.testing.assert_array_equal(read_map(written(tmp_path, negate=1)).data[1], [0, 100, 100])


@pytest.mark.parametrize("values, words", [
    (dict(image=None), "expected the keys"), (dict(resolution=None), "resolution is None"),
    (dict(resolution=-0.05), "expected a number"), (dict(resolution="fine"), "'fine'"),
    (dict(origin=[1.0, 2.0, 0.5]), "rotated"), (dict(origin="[here]"), "origin"), (dict(origin=None), "origin"),
    (dict(mode="raw"), "raw"), (dict(occupied_thresh=65), "occupied_thresh is '65'"),
    (dict(occupied_thresh=1.0), "no cell is occupied"), (dict(image="other.pgm"), "other.pgm: No such file")])
def test_map_errors_name_the_fault(tmp_path, values, words):
    with pytest.raises(MapReadingError, match=words):
        read_map(written(tmp_path, **values))


def test_invalid_pictures_are_reported(tmp_path):
    name = written(tmp_path)
    for content in (b"", b"P5\n3 2\n255\n\x00", b"not a picture"):
        (tmp_path / "a.pgm").write_bytes(content)
        with pytest.raises(MapReadingError, match="a.yaml"):
            read_map(name)
    (tmp_path / "a.yaml").write_text("{{{")
    with pytest.raises(MapReadingError, match="a.yaml"):
        read_map(name)
    with pytest.raises(MapReadingError, match="none.yaml: No such file"):
        read_map(str(tmp_path / "none"))

# SPDX-License-Identifier: BSD-3-Clause
"""Untrusted map files: a clear error for each kind of invalid content, and no memory for sizes only claimed."""
import pytest
from PIL import Image

from m2wr_maps.map_input import MapInputError, number, origin_of, read_pixels, read_values, yes

YAML = "image: a.png\nresolution: {}\norigin: {}\nnegate: {}\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"


def read(folder, text):
    (folder / "m.yaml").write_text(text)
    values = read_values(str(folder / "m.yaml"))
    return number(values, "resolution", 0.0, 10.0), origin_of(values), yes(values, "negate")


@pytest.mark.parametrize("words, found", [
    (("0.05", "[-1, 2.5, 0]", "0"), (0.05, (-1.0, 2.5, 0.0), False)),
    (("5e-2", "[1, 2]", "true"), (0.05, (1.0, 2.0, 0.0), True)),
    (("'0.05'", "[1e1, -2, 3.14]", "1"), (0.05, (10.0, -2.0, 3.14), True))])
def test_numbers_are_read_as_people_write_them(tmp_path, words, found):
    assert read(tmp_path, YAML.format(*words)) == found


@pytest.mark.parametrize("text", [
    YAML.format("1" + "0" * 400, "[0, 0, 0]", 0), YAML.format("9" * 5000, "[0, 0, 0]", 0),
    YAML.format("0.05", "[1" + "0" * 400 + ", 0, 0]", 0), YAML.format("0.05", "[" * 3000, 0),
    "[" * 3000 + "]" * 3000, "a: " * 3000, "- " * 3000, YAML.format(".inf", "[0, 0, 0]", 0),
    YAML.format("nan", "[0, 0, 0]", 0),
    YAML.format("0.05", "[[], 0, 0]", 0), YAML.format("0.05", "[0, 0, 0]", "[1]"),
    YAML.format("0.05", "{a: b}", 0), "2001-99-99: 1", "x: !!int '_'\n", "x: !!python/object/apply:os.system [ls]",
    "&a [*a]",
    "{[1, 2]: 3}",
    "? [a]",
    "\0",
    "a: *b",
    "x" * 100000, "", "image: [a]", "%YAML 9.9\n---\na", "\ud800"])
def test_nonsense_is_an_error_of_the_map(tmp_path, text):
    with pytest.raises((MapInputError, UnicodeEncodeError)):
        read(tmp_path, text)


@pytest.mark.parametrize("content", [
    b"P5\n100000 100000\n255\n", b"P5\n20000 20000\n255\n", b"P5\n" + b"9" * 50 + b" 1\n255\n", b"P5\n0 0\n255\n", b"",
    b"\x89PNG\r\n\x1a\n" + b"\0" * 30, b"%!PS-Adobe-3.0 EPSF-3.0\n%%BoundingBox: 0 0 9 9\n%%EndComments\n", b"GIF89a"])
def test_pictures_that_are_none_or_claim_too_much_are_refused(tmp_path, content):
    (tmp_path / "a.png").write_bytes(content)
    with pytest.raises(MapInputError):
        read_pixels(str(tmp_path / "a.png"), lambda picture: "L")


def test_devices_are_refused(tmp_path):
    with pytest.raises(MapInputError, match="no regular file"):
        read_pixels("/dev/zero", lambda picture: "L")
    with pytest.raises(MapInputError, match="no regular file"):
        read_values("/dev/zero")


def test_a_picture_is_read(tmp_path):
    Image.new("L", (3, 2), 7).save(str(tmp_path / "a.png"))
    assert read_pixels(str(tmp_path / "a.png"), lambda picture: "L").tolist() == [[7, 7, 7], [7, 7, 7]]

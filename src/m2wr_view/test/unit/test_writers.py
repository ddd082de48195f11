# SPDX-License-Identifier: BSD-3-Clause
"""Files of pictures: what they hold, and what happens where they cannot be written."""
import os
import stat

import numpy as np
import pytest
from PIL import Image

from m2wr_view import writers
from m2wr_view.errors import ViewError
from m2wr_view.writers import Mp4, PngSeries, make_writer, png_bytes


def picture(shade, size=(30, 20)):
    pixels = np.zeros((size[1], size[0], 3), dtype=np.uint8)
    pixels[...] = (shade, 255 - shade, 40)
    pixels[3, 5] = (1, 2, 3)
    return Image.fromarray(pixels)


def test_a_png_holds_the_picture(tmp_path):
    path = tmp_path / "one.png"
    path.write_bytes(png_bytes(picture(200)))
    with Image.open(str(path)) as image:
        image.load()
        assert np.array_equal(np.asarray(image), np.asarray(picture(200)))


def test_a_series_is_numbered(tmp_path):
    series = make_writer(str(tmp_path / "new" / "folder"))
    for shade in (0, 100, 200):
        series.write(picture(shade))
    series.close()
    assert sorted(os.listdir(series.path)) == ["frame_00000.png", "frame_00001.png", "frame_00002.png"]
    with Image.open(os.path.join(series.path, "frame_00002.png")) as image:
        assert image.getpixel((0, 0)) == (200, 55, 40)


def test_a_gif_holds_all_pictures_at_their_speed(tmp_path):
    gif = make_writer(str(tmp_path / "run.gif"), 5.0)
    moved = picture(0)
    moved.putpixel((25, 15), (250, 0, 0))           # only a small rectangle differs
    for image in (picture(0), moved, picture(100), picture(100), picture(200)):
        gif.write(image)
    gif.close()
    with Image.open(gif.path) as image:
        assert image.n_frames == 5 and image.info["duration"] == 200 and image.info["loop"] == 0
        seen = (((0, 0), (0, 255, 40)), ((25, 15), (250, 0, 0)), ((25, 15), (100, 155, 40)), ((0, 0), (100, 155, 40)),
                ((0, 0), (200, 55, 40)))
        for number, (place, colour) in enumerate(seen):
            image.seek(number)
            assert image.convert("RGB").getpixel(place) == pytest.approx(colour, abs=12)
        image.seek(1)
        assert image.convert("RGB").getpixel((0, 0)) == pytest.approx((0, 255, 40), abs=12)     # kept from before


def test_a_gif_that_was_never_finished_can_be_looked_at(tmp_path):
    gif = make_writer(str(tmp_path / "run.gif"), 5.0)
    for shade in (0, 100):
        gif.write(picture(shade))
    with Image.open(gif.path) as image:
        image.seek(1)
        assert image.convert("RGB").getpixel((0, 0)) == pytest.approx((100, 155, 40), abs=12)


def program(tmp_path, text):
    path = tmp_path / "bin" / "ffmpeg"
    path.parent.mkdir()
    path.write_text("#!/bin/sh\n" + text)
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return str(path)


def test_ffmpeg_gets_size_rate_and_every_pixel(tmp_path):
    keeping = 'for last in "$@"; do :; done\necho "$@" > "$last".said\ncat > "$last"\n'
    film = Mp4(str(tmp_path / "run.mp4"), 5.0, program(tmp_path, keeping))
    for shade in (0, 100):
        film.write(picture(shade))
    film.close()
    assert (tmp_path / "run.mp4").read_bytes() == picture(0).tobytes() + picture(100).tobytes()
    said = (tmp_path / "run.mp4.said").read_text()
    assert "-s 30x20" in said and "-r 5" in said and "-pix_fmt rgb24" in said


def test_ffmpeg_that_fails_is_quoted(tmp_path):
    film = Mp4(str(tmp_path / "run.mp4"), 5.0, program(tmp_path, "cat > /dev/null\necho no such codec >&2\nexit 3\n"))
    film.write(picture(0))
    with pytest.raises(ViewError, match="run.mp4: ffmpeg: no such codec"):
        film.close()


def test_a_missing_ffmpeg_is_named_with_the_cure(tmp_path):
    with pytest.raises(ViewError, match="no program ffmpeg_that_is_not_there; install it"):
        Mp4(str(tmp_path / "run.mp4"), 5.0, "ffmpeg_that_is_not_there")


def test_a_folder_that_cannot_be_made_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    for path in ("file", "file/below", "file/run.gif"):
        with pytest.raises(ViewError, match="folder .*file.*: .*expected"):
            make_writer(str(tmp_path / path))


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="needs /dev/full")
def test_a_full_disk_is_named_and_leaves_no_half_picture(tmp_path, monkeypatch):
    series = PngSeries(str(tmp_path / "out"))
    series.write(picture(0))
    real = writers.tempfile.NamedTemporaryFile

    def full(**options):
        stream = real(**options)
        stream.write = lambda data: open("/dev/full", "wb", buffering=0).write(data)
        return stream

    monkeypatch.setattr(writers.tempfile, "NamedTemporaryFile", full)
    with pytest.raises(ViewError, match="picture .*frame_00001.png: No space left on device"):
        series.write(picture(1))
    assert os.listdir(series.path) == ["frame_00000.png"]
